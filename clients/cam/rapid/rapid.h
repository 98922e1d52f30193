#pragma once

#include <string>
#include <utility>
#include <vector>

#include "clients/cam/program.h"

namespace trammel::cam {

/// Reads ABB RAPID modules (.mod .prg .sys) of one program. Targets are the ends of motions:
/// declared, in arrays and records, written in the motion, `Offs` and `RelTool` of them with
/// constant numbers, also through parameters of procedures. A target that a variable, a loop, a
/// sensor or another module decides is left alone, with the reason. The controller's world counts
/// as the robot's base.
[[nodiscard]] Program read_rapid(std::vector<SourceFile> files, const ReadOptions& options);

/// The declarations of modules, whether motions use them or not: tools, work objects and loads that
/// are constant or persistent.
struct RapidData {
  struct Frame {
    ProgramFrame frame;  ///< seen from the controller's world
    std::string where;   ///< `user.sys line 12`
  };
  struct Load {
    std::string name;
    StatedLoad load;
    std::string where;
  };
  std::vector<ProgramTool> tools;
  std::vector<Frame> frames;
  std::vector<Load> loads;
};
[[nodiscard]] RapidData read_rapid_data(std::vector<SourceFile> files);

}  // namespace trammel::cam
