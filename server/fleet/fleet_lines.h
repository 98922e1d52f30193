#pragma once

#include <string>
#include <vector>

#include "server/compensate/budget/budget.h"

/// In which line of its error budget a robot differs from its sisters.
namespace trammel {

/// A number of a line compared with those of the sisters that have the line, in the unit of the
/// line.
struct LineAmongSisters {
  std::string line, name;
  int joint = -1;             ///< 0-based; -1: of no single joint
  BudgetNumber own, sisters;  ///< `sisters`: their mean, and U(k = 2) of the next sister's value
  double difference_rms = 0;  ///< m rms: the effect of the difference by itself, at the robot's own
                              ///< poses
  double z = 0;               ///< standard deviations apart, U of the own value included
  int robots = 0;             ///< sisters that have the line
  bool differs = false;       ///< the deviation is beyond chance for the next sister
};

/// The fewest sisters for judging a robot: among two robots nobody knows which one is odd.
inline constexpr int kFewestSisters = 2;

/// Each line of the arm itself that at least kFewestSisters sisters have, the line with the largest
/// effect first. For a line with several numbers, it is the number farthest from the sisters'
/// numbers. The spread between sisters is drawn towards the usual spread of the line, as if three
/// more robots had it. A line differs if at most kFalseFleets of fleets of equal robots show such a
/// deviation (Student's t, Bonferroni over lines and robots).
[[nodiscard]] std::vector<LineAmongSisters> lines_among_sisters(
    const ErrorBudget& own, const std::vector<const ErrorBudget*>& sisters);

/// `the zero of joint 4 is 3.000 ± 0.004 deg, its 3 sisters have 0.01 ± 0.06 deg: 14.600 mm`.
[[nodiscard]] std::string to_string(const LineAmongSisters& line);

}  // namespace trammel
