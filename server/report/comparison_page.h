#pragma once

#include <string>

#include "server/compensate/budget/between.h"

namespace trammel {

/// Two models of one robot, and their difference.
struct Comparison {
  const CompensatedModel& before;
  const CompensatedModel& now;
  const ModelDifference& difference;
  std::string where;  ///< the poses of the comparison, for people
  std::string text;   ///< as on a terminal
};
[[nodiscard]] std::string comparison_page(const Comparison& comparison);

}  // namespace trammel
