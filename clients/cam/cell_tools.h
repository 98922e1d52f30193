#pragma once

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "clients/cam/program.h"

/// Which tool and load of the cell each tool of a program is.
namespace trammel::cam {

/// The cell with the model's tools: the training found those that the cell file leaves open.
struct CellTools {
  std::map<std::string, Pose> tools;  ///< X_FT
  std::map<std::string, Payload> payloads;
  std::optional<Pose> X_WB =
      {};  ///< the cell's base, seen from its measuring system; empty: found from the data
  /// Refuses a tool and payload that the model has not learned with; empty: it knows all.
  std::function<Status(const std::string& tool, const std::string& payload)> check_known = {};
  std::optional<Vector3> gravity_B =
      {};  ///< unit vector, seen from the robot's base; empty: not known
  std::set<std::string> idle_axes = {};  ///< axes that carry neither robot nor part, by
                                         ///< axis_called()
};

struct ToolChoice {
  std::string tool, payload;  ///< of the cell
  std::string note;           ///< what could not be compared, in words
  std::string load_note;      ///< the same of the load
  std::string why_not;  ///< the reason why targets of this tool cannot be corrected; empty: they
                        ///< can
};

/// The kind of a tool's targets.
enum class ToolUse {
  kNone,
  kJoints,  ///< axes alone, and it does not matter which tool the program has
  kPoses
};

constexpr double kToolPositionTolerance = 1e-5;  // m
constexpr double kToolRotationTolerance =
    9e-5;  // rad, 0.005 deg; the rounding of the program's digits is added
constexpr double kLoadMassTolerance = 0.02;    // of the mass
constexpr double kLoadCentreTolerance = 5e-3;  // m

/// True for a placeholder load in a program: at most 1 kg, at most 1 mm from the flange.
[[nodiscard]] bool is_placeholder(const StatedLoad& load);

/// One choice per tool of the program, from its targets. `tool` and `payload` are the user's, or
/// empty. Refuses a tool that differs from the cell's of that name, tools that are all foreign to
/// the cell, and a load that differs from the cell's, with both values and their difference. If
/// motions set a foreign load, only these motions cannot be corrected, as long as others can. A
/// tool that is not in the files must have the name of one of the cell's, or be named by the user.
[[nodiscard]] Result<std::vector<ToolChoice>> choose_tools(const Program& program,
                                                           const std::vector<ToolUse>& uses,
                                                           const CellTools& cell,
                                                           const std::string& tool,
                                                           const std::string& payload);

}  // namespace trammel::cam
