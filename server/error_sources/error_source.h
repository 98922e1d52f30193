#pragma once

#include <Eigen/Dense>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/error_sources/cause.h"
#include "server/robot/arm_state.h"
#include "server/robot/cell.h"
#include "server/robot/pose_context.h"

namespace trammel {

/// One number that calibration may identify. Values are in SI; `unit` and `scale` convert them for
/// people.
struct Parameter {
  std::string name;        ///< as in the source: `d4`, `alpha2`, `C3`, `x0`
  std::string unit;        ///< for people: `mm`, `rad`, `rad/Nmm`
  double scale = 1;        ///< value for people = scale * SI value
  double prior = 0;        ///< mean of the prior, SI
  double prior_scale = 1;  ///< standard deviation of the prior, SI
  double lower = -std::numeric_limits<double>::infinity();  ///< physical bound, SI
  bool is_place = false;  ///< gives the place of an effect (the order of an oscillation), not its
                          ///< size
};

/// One physical cause of error: its parameters and their effect on the arm. Immutable; thread-safe.
class ErrorSource {
 public:
  virtual ~ErrorSource() = default;
  /// The record of its cause.
  [[nodiscard]] virtual const CauseRecord& cause() const = 0;
  /// The spelling in a cell file: the cause, then `:joint` if it belongs to one joint.
  [[nodiscard]] virtual std::string name() const = 0;
  [[nodiscard]] virtual const std::vector<Parameter>& parameters() const = 0;
  [[nodiscard]] const ContextNeeds& needs() const { return cause().needs; }
  /// 0-based joint it concerns; -1 where it concerns the whole arm.
  [[nodiscard]] virtual int joint() const { return -1; }
  /// Range and step of a search over its first parameter, for a source that needs one before
  /// refinement (the order of a gear's ripple).
  struct Search {
    double from = 0, to = 0, step = 0;
  };
  [[nodiscard]] virtual std::optional<Search> search() const { return std::nullopt; }
  /// One sentence about it for reports.
  [[nodiscard]] virtual std::string explanation() const = 0;
  /// Changes `state` by the effect of the cause at this pose, with `values` (SI) for its
  /// parameters. If `jacobian` is given, its columns first_column... receive the exact derivative,
  /// and sources that depend on the state pass the derivatives of earlier sources on. The joints of
  /// `context` are the angles of their gears (Chain::gear_angles), not the counts of a controller
  /// with couplings.
  virtual void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
                     ArmState& state, StateJacobian* jacobian, int first_column) const = 0;
};

using ErrorSourcePtr = std::shared_ptr<const ErrorSource>;

}  // namespace trammel
