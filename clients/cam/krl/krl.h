#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "clients/cam/program.h"
#include "server/robot/chain.h"

namespace trammel::cam {

/// Reads KUKA KRL (.src with its .dat, `$config.dat`) of one program: positions and axes in data
/// lists, in assignments and in motions, spline blocks, inline forms with their FDAT, `a:b` of
/// constant frames. Tools and bases come from `$TOOL`, `$BASE`, `BAS(#TOOL,n)`, FDAT and `WITH`,
/// followed through calls and branches. `$machine.dat` gives the robot's type and its place in
/// $WORLD.
[[nodiscard]] Program read_krl(std::vector<SourceFile> files, const ReadOptions& options);

/// The cell as a KUKA's own `$machine.dat` and `$config.dat` describe it. Tools are seen from the
/// flange, bases from the robot's base.
struct KukaData {
  StatedRobot stated;
  std::map<int, ProgramTool> tools;  ///< the defined tools, with their loads; a reason if one is
                                     ///< unknown
  std::map<int, ProgramFrame> bases;
  std::vector<std::pair<double, double>> limits;  ///< rad, of each axis; empty: not all are said
  std::optional<Chain> arm;                       ///< with these limits, where its lengths are told
  std::string why_no_arm;                         ///< a clause; empty: there is one
  std::vector<std::string> notes;                 ///< on missing information
};
[[nodiscard]] KukaData read_kuka_data(const std::vector<SourceFile>& files);

}  // namespace trammel::cam
