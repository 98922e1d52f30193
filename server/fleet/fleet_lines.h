#pragma once

#include <string>
#include <vector>

#include "server/compensate/budget/budget.h"

/// In which line of its error budget a robot differs from its sisters.
namespace trammel {

/// A number of a line beside those of the sisters that have the line, in the unit of the line.
struct LineAmongSisters {
  std::string line, name;
  int joint = -1;             ///< 0-based; -1: of no single joint
  BudgetNumber own, sisters;  ///< `sisters`: their mean, and U(k = 2) of the next sister's value
  double difference_rms = 0;  ///< m rms: what the difference does alone, at the robot's own poses
  double z = 0;               ///< standard deviations apart, U of the own value included
  int robots = 0;             ///< sisters that have the line
  bool differs = false;       ///< beyond what the next sister would show by chance
};

/// The fewest sisters by which a robot is judged: of two robots nobody knows which of them is odd.
inline constexpr int kFewestSisters = 2;

/// Each line of the arm itself that at least kFewestSisters sisters have, of a line with several
/// numbers the one that is farthest from theirs; what does most comes first. The spread from sister
/// to sister is drawn to what is usual for the line, as if three more robots had that. A line
/// differs where a fleet of equal robots shows as much in at most kFalseFleets of fleets (Student's
/// t, Bonferroni over lines and robots).
[[nodiscard]] std::vector<LineAmongSisters> lines_among_sisters(
    const ErrorBudget& own, const std::vector<const ErrorBudget*>& sisters);

/// `the zero of joint 4 is 3.000 ± 0.004 deg, its 3 sisters have 0.01 ± 0.06 deg: 14.600 mm`.
[[nodiscard]] std::string to_string(const LineAmongSisters& line);

}  // namespace trammel
