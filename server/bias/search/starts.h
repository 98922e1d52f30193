#pragma once

#include <Eigen/Dense>

/// The parts that searches from several starts share.
namespace trammel {

/// Ends within so many nat of each other are the same optimum. It is a tenth of the difference that
/// makes one likelier.
inline constexpr double kSameOptimum = 0.1;
/// Points of the first searches: few enough for many starts, and enough to tell the optima apart.
inline constexpr Eigen::Index kStartPoints = 150;

}  // namespace trammel
