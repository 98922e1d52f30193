#pragma once

#include <string>
#include <vector>

#include "server/compensate/budget/budget.h"
#include "server/compensate/compensated_model.h"

/// The difference between two models of one robot.
namespace trammel {

/// A parameter of either model; one that a model does not have is 0 there, on the drawing.
struct ParameterDifference {
  std::string name;
  std::string unit;
  double before = 0, now = 0;  ///< in `unit`
  double u95 = 0;              ///< U(k = 2) of the difference, in `unit`
  [[nodiscard]] double difference() const { return now - before; }
};

struct ModelDifference {
  std::vector<ParameterDifference> parameters;  ///< parameters of `now`, then those of `before`
                                                ///< alone
  /// The predicted poses of `now` minus those of `before`, line by line; `error_rms` is that of the
  /// difference. The two models explain the difference completely, so there are no steps to put
  /// right.
  ErrorBudget budget;
  std::vector<Vector3> moved_B;  ///< m, of each pose, seen from the base
};

/// `before` and `now` have the same drawing; `poses` are not empty. Measurements that both models
/// learned from count as independent in U, so U is then too large.
[[nodiscard]] ModelDifference difference_between(const CompensatedModel& before,
                                                 const CompensatedModel& now,
                                                 const std::vector<PoseContext>& poses);

}  // namespace trammel
