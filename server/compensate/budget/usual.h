#pragma once

#include "server/compensate/budget/items.h"

/// The usual sizes by which a value is judged.
namespace trammel {

/// The size that a healthy arm does not exceed in about one of twenty cases, SI. Estimates of
/// this project: no published table stands behind them.
struct UsualSizes {
  double zero = 0, twist = 0;  ///< rad
  double rail_zero = 0;        ///< m
  double length = 0;           ///< m
  double tool = 0;             ///< m, of its point
};
[[nodiscard]] UsualSizes usual_sizes(const Chain& robot);

/// The usual size of the value of a line, in the unit of the value; empty where nothing is usual (a
/// base stands anywhere).
[[nodiscard]] std::optional<double> usual_value(const BudgetItem& item, const PhysicalModel& model);

/// The size by which parameters are compared when the poses cannot tell them apart, SI, one for
/// each of the model's: what is usual for the arm; for frames far more, so that what a frame can
/// take is counted as the frame's.
[[nodiscard]] Eigen::VectorXd sizes_to_compare_by(const PhysicalModel& model);

/// From so many times what is usual on, a line stands out.
inline constexpr double kStandsOut = 3;

/// The advice for a line that stands out.
[[nodiscard]] std::string action_for(const BudgetLine& line, const PhysicalModel& model);

}  // namespace trammel
