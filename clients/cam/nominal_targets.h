#pragma once

#include <optional>
#include <string>
#include <vector>

#include "clients/cam/cell_tools.h"
#include "clients/cam/configuration.h"
#include "clients/cam/program.h"
#include "server/exchange/answer.h"

namespace trammel::cam {

/// A target of a program as the controller takes it.
struct NominalTarget {
  exchange::AskedTarget asked;   ///< as a model is asked to correct it
  std::optional<JointVector> q;  ///< the controller's joints; empty: not found
  std::string why_not;           ///< why it cannot be corrected; empty: it may be
  std::string doubt = {};        ///< what the program says of it that contradicts itself
};

struct NominalTargets {
  std::vector<ToolChoice> tools;       ///< of each tool of the program
  std::vector<NominalTarget> targets;  ///< of each target of the program
  std::vector<std::string> notes;
};

/// Where motions command axes, and no pose depends on the tool: which tool of the cell is it?
enum class BareTools {
  kAsInTheProgram,
  kOfTheCell  ///< the one that is asked for, or the cell's only one: measuring programs leave it to
              ///< the controller
};

/// In the order of the motions, since one motion may leave its configuration to the one before.
/// Refuses what choose_tools() refuses, and files that check_files() refuses.
[[nodiscard]] Result<NominalTargets> nominal_targets(const Program& program,
                                                     const ArmOfProgram& arm, const CellTools& cell,
                                                     const std::string& tool,
                                                     const std::string& payload,
                                                     BareTools bare = BareTools::kAsInTheProgram);

/// X_BT of a target; empty for joints that were not found.
[[nodiscard]] std::optional<Pose> wanted_pose(const Program& program, const Chain& robot,
                                              const CellTools& cell, const NominalTargets& nominal,
                                              std::size_t target);

/// Targets of one tool and payload of the cell, to be asked for together; those that cannot be
/// corrected left out.
struct TargetGroup {
  std::string tool, payload;
  std::vector<std::size_t> targets;
};
[[nodiscard]] std::vector<TargetGroup> groups_of(const Program& program,
                                                 const NominalTargets& nominal);

/// Axes of a joint target in degrees, whatever its dialect writes.
[[nodiscard]] std::vector<double> in_degrees(Coordinates coordinates, std::vector<double> axes);
[[nodiscard]] std::vector<double> in_degrees(const ProgramTarget& target, std::vector<double> axes);

}  // namespace trammel::cam
