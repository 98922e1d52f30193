#pragma once

#include "server/compensate/budget/items.h"

/// The usual sizes by which a value is judged.
namespace trammel {

/// The size that a healthy arm exceeds in about one of twenty cases, SI. These are estimates of
/// this project, without a published table.
struct UsualSizes {
  double zero = 0, twist = 0;  ///< rad
  double rail_zero = 0;        ///< m
  double length = 0;           ///< m
  double tool = 0;             ///< m, of its point
  double gear = 0, wrist = 0;  ///< rad/Nm, the compliance of a joint: up to the wrist, and of the
                               ///< wrist
};
[[nodiscard]] UsualSizes usual_sizes(const Chain& robot);

/// The usual size of the value of a line, in the unit of the value; empty where nothing is usual (a
/// base stands anywhere).
[[nodiscard]] std::optional<double> usual_value(const BudgetItem& item, const PhysicalModel& model);

/// The sizes by which parameters are compared if the poses cannot distinguish them, SI, one for
/// each parameter of the model. For the arm they are the usual sizes. For frames they are far
/// larger, so a shared effect counts as an effect of the frame.
[[nodiscard]] Eigen::VectorXd sizes_to_compare_by(const PhysicalModel& model);

/// A line stands out from this multiple of the usual size on.
inline constexpr double kStandsOut = 3;

/// The advice for a line that stands out.
[[nodiscard]] std::string action_for(const BudgetLine& line, const PhysicalModel& model);

}  // namespace trammel
