#pragma once

#include <Eigen/Dense>
#include <optional>
#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"

/// Tells if the residual of a model is noise, or a function of something.
namespace trammel {

/// The residuals in one order of the poses: that of the rows, or that of one joint's angle. Noise
/// changes its sign as often as a coin; a course that wanders with the order changes it less often
/// (Wald and Wolfowitz, On a test whether two samples are from the same population, 1940).
struct ResidualOrder {
  int joint = -1;          ///< 0-based; -1: the order of the rows
  double runs = 0;         ///< number of stretches of one sign
  double expected = 0;     ///< the number to expect of noise
  double stddev = 0;       ///< standard deviation of that number
  double correlation = 0;  ///< of one pose with the next

  /// The lack of runs, in standard deviations.
  [[nodiscard]] double z() const { return stddev > 0 ? (expected - runs) / stddev : 0; }
  /// Chance alone goes so far in one of ten thousand orders.
  static constexpr double kBeyondChance = 3.72;
};

/// All orders of a batch (its rows, then each joint that turns), for residuals in B (3 x N). The
/// order of the rows uses the three axes together. That of a joint uses the tool's error along the
/// direction in which the joint moves it.
[[nodiscard]] std::vector<ResidualOrder> residual_orders(const CompensatedModel& model,
                                                         const MeasurementBatch& batch,
                                                         const Eigen::Matrix3Xd& residual_B);

/// The order that is farthest from noise, if one is beyond chance.
[[nodiscard]] std::optional<ResidualOrder> most_structured(
    const std::vector<ResidualOrder>& orders);

/// `what the calibrated model leaves is no noise: in the order of joint 2 it keeps its sign (...):
/// its parameters are less certain than their U(k=2) says`
[[nodiscard]] std::string in_words(const ResidualOrder& order);

}  // namespace trammel
