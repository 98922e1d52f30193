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
  std::string doubt = {};        ///< the contradiction in its configuration
};

struct NominalTargets {
  std::vector<ToolChoice> tools;       ///< of each tool of the program
  std::vector<NominalTarget> targets;  ///< of each target of the program
  std::vector<std::string> notes;
  std::vector<std::string> contradictions = {};  ///< as contradictions_of() has them
};

/// The choice of the tool if motions command axes, and no pose depends on the tool.
enum class BareTools {
  kAsInTheProgram,
  kOfTheCell  ///< the requested one, or the cell's only one: measuring programs leave it to the
              ///< controller
};

/// The targets in the order of the motions, since a motion may leave its configuration to the
/// previous one. Refuses the same as choose_tools() and check_files().
[[nodiscard]] Result<NominalTargets> nominal_targets(const Program& program,
                                                     const ArmOfProgram& arm, const CellTools& cell,
                                                     const std::string& tool,
                                                     const std::string& payload,
                                                     BareTools bare = BareTools::kAsInTheProgram);

/// X_BT of a target; empty for joints that were not found.
[[nodiscard]] std::optional<Pose> wanted_pose(const Program& program, const Chain& robot,
                                              const CellTools& cell, const NominalTargets& nominal,
                                              std::size_t target);

/// Targets with one tool and payload of the cell, for one request, without those that cannot be
/// corrected.
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
