#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/base/result.h"
#include "server/robot/arm_state.h"
#include "server/robot/chain.h"

/// A cell as its owner describes it: the robot, its base, tools and payloads, and the tracker.
namespace trammel {

struct Tracker {
  double sigma = 13e-6;            ///< m, one measurement, one axis
  double sigma_rotation = 61e-6;   ///< rad, one measurement, one axis
  std::optional<Vector3> p_W;      ///< position of the tracker, for visibility
  std::optional<double> aperture;  ///< rad, half angle of the cone in which the target is visible
  Vector3 target_normal_T =
      Vector3::UnitZ();  ///< direction in which the target faces, unit vector in T
};

/// Written in a list of error sources, or in its place: training chooses by the measurements.
inline constexpr std::string_view kAutoSources = "auto";

/// The parameters to identify and the bias to learn. Sources as spelled on the command line:
/// `geometry`, `gear_transmission:3`.
struct ModelSpec {
  std::vector<std::string> error_sources = {"base", "geometry", "compliance"};
  /// The sources that the cell file names beside `auto`; set only where it says `auto`. A training
  /// keeps these and adds the sources that the measurements ask for. It then ignores error_sources,
  /// which holds these or, if there are none, the usual ones.
  std::optional<std::vector<std::string>> beside_auto;
  std::string bias = "se";
};

/// The rule by which a training by the service takes batches: its own, and some or all of those
/// from which the cell was trained before.
struct SessionRule {
  enum class Kind { kAll, kLast, kDays };
  Kind kind = Kind::kAll;
  int count = 0;  ///< of the last batches, its own among them; or days before its own

  friend bool operator==(const SessionRule&, const SessionRule&) = default;
};

/// Closed box in B, m.
struct Workspace {
  Vector3 lower, upper;
};

struct Cell {
  std::string name;
  Chain robot;
  std::optional<Pose> X_WB;               ///< nominal base; empty = unknown, found from data
  Vector3 gravity_W = -Vector3::UnitZ();  ///< unit vector
  std::map<std::string, std::optional<Pose>> tools;  ///< X_FT; empty = unknown, found from data
  std::map<std::string, Payload> payloads;
  Tracker tracker;
  ModelSpec model;
  std::vector<std::pair<double, double>>
      joint_ranges;  ///< rad, for this cell; empty = the robot's limits
  std::optional<Workspace> workspace;
  SessionRule sessions;
  std::optional<double>
      step_limit;  ///< m: a model that moves a pose recently asked for by more waits for a person
  std::string
      cell_yaml;  ///< the texts it was read from, kept so that a stored model is self-contained
  std::string robot_yaml;
};

/// Reads the two texts (DESIGN section 3); `where` names the cell file in errors. Refuses unknown
/// keys, wrong types, non-unit quaternions, missing rows, each with file, key and limit.
[[nodiscard]] Result<Cell> parse_cell(const std::string& cell_yaml, const std::string& robot_yaml,
                                      const std::string& where);
/// Reads a cell file and the robot file it names, relative to itself.
[[nodiscard]] Result<Cell> read_cell(const std::string& path);
/// Reads a robot file. `where` names it in errors.
[[nodiscard]] Result<Chain> parse_robot(const std::string& robot_yaml, const std::string& where);
[[nodiscard]] Result<Chain> read_robot(const std::string& path);

/// The tool of a request: `requested`, or the only tool if that is empty. Refuses an unknown name.
/// Refuses an empty name if the cell has several tools.
[[nodiscard]] Result<std::string> resolve_tool(const Cell& cell, const std::string& requested);
/// The payload of a request, by the rules for tools. A cell without payloads has one named "" (no
/// load).
[[nodiscard]] Result<std::string> resolve_payload(const Cell& cell, const std::string& requested);

}  // namespace trammel
