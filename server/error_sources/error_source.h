#pragma once

#include <Eigen/Dense>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/robot/arm_state.h"
#include "server/robot/cell.h"
#include "server/robot/pose_context.h"

namespace trammel {

/// One number that calibration may identify. Values are in SI; `unit` and `scale` say how people read it.
struct Parameter {
  std::string name;        ///< as in the source: `d4`, `alpha2`, `C3`, `x0`
  std::string unit;        ///< for people: `mm`, `rad`, `rad/Nmm`
  double scale = 1;        ///< value for people = scale * SI value
  double prior = 0;        ///< what it is believed to be before any data, SI
  double prior_scale = 1;  ///< how far from there it may reasonably be (one standard deviation), SI
  double lower = -std::numeric_limits<double>::infinity();  ///< physical bound, SI
};

/// What must have been recorded with each pose for a cause to show.
struct ContextNeeds {
  bool time = false;
  bool temperature = false;
  bool direction = false;  ///< of the source's joint
  bool velocity = false;
  bool payload = false;  ///< something must hang on the flange
};

/// One physical cause of error: its parameters and what they do to the arm. Immutable; thread-safe.
class ErrorSource {
 public:
  virtual ~ErrorSource() = default;
  /// As spelled in a cell file: the cause, then `:joint` where it concerns one.
  [[nodiscard]] virtual std::string name() const = 0;
  [[nodiscard]] virtual const std::vector<Parameter>& parameters() const = 0;
  [[nodiscard]] virtual ContextNeeds needs() const { return {}; }
  /// 0-based joint it concerns; -1 where it concerns the whole arm.
  [[nodiscard]] virtual int joint() const { return -1; }
  /// A source that needs a search over its first parameter before anything can be refined (the order of a gear's error)
  /// says so: range and step of the search.
  struct Search {
    double from = 0, to = 0, step = 0;
  };
  [[nodiscard]] virtual std::optional<Search> search() const { return std::nullopt; }
  /// What a report says of it in one sentence.
  [[nodiscard]] virtual std::string explanation() const = 0;
  /// Changes `state` as the cause does at this pose, with `values` (SI) for its parameters. Where `jacobian` is given,
  /// its columns first_column... receive the exact derivative, and sources that depend on the state pass the
  /// derivatives of earlier sources on.
  virtual void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values, ArmState& state,
                     StateJacobian* jacobian, int first_column) const = 0;
};

using ErrorSourcePtr = std::shared_ptr<const ErrorSource>;

/// The forms of a cause between which the data decide, the first being the usual one: `compliance` has three where
/// `cell` carries anything. All other specs stand for themselves.
[[nodiscard]] std::vector<std::string> alternatives(const std::string& spec, const Cell& cell);

/// The source that `spec` names for this cell, in its usual form: a cause, `:joint` (1-based) where it concerns one,
/// and
/// `@numbers` joined by `+` where more must be said (`gear_transmission:3@48+97`, `tracker_moved@120`). Refuses an
/// unknown name, joint or number.
[[nodiscard]] Result<ErrorSourcePtr> make_error_source(const std::string& spec, const Cell& cell);

/// Place of a source in the order in which causes act on the arm: frames and links first, what hangs on the loaded
/// posture last. By the source's name.
[[nodiscard]] int acting_order(const std::string& source_name);

/// Names of all causes, in acting order.
[[nodiscard]] std::vector<std::string> known_causes();

/// Expands a level into source names: `M0`..`M3`, a list, or a level and more: `M2,gear_transmission:3`.
[[nodiscard]] Result<std::vector<std::string>> parse_level(const std::string& level);
/// Its inverse: what parse_level() reads as these sources; `M0` where there are none.
[[nodiscard]] std::string level_of(const std::vector<std::string>& sources);

}  // namespace trammel
