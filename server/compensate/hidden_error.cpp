#include "server/compensate/hidden_error.h"

#include <cmath>
#include <vector>

#include "server/compensate/accuracy.h"

namespace trammel {

namespace {

constexpr double kOverstated = 0.5;  // of the stated sigma
constexpr double kFreedom = 60;      // known to a tenth
constexpr double kAll = 0.995;
constexpr double kChanged = 1.1;  // times the stated accuracy
constexpr int kAsked = 40;        // poses of the domain

/// m² per axis: the variance of the true error that the model states, mean over some poses of its
/// domain.
double stated_variance(const CompensatedModel& model) {
  const std::vector<PoseContext> poses = poses_in_range(model, kAsked);
  double sum = 0;
  for (const ErrorPrediction& one : model.predict_all(poses))
    sum += one.true_stddev_B.squaredNorm() / 3;
  return poses.empty() ? 0 : sum / static_cast<double>(poses.size());
}

}  // namespace

double left_within_sigma(const ModelParts& parts) {
  const double freedom = 3.0 * parts.training.poses - parts.rank;
  if (freedom < kFreedom) return 0;
  const double left = parts.training.calibrated.rms * std::sqrt(parts.training.poses / freedom);
  // Means of repeats and rows with their own sigma have a smaller one. They do not all lie within
  // it.
  const bool all_inside = parts.training.coverage_95_stated.value_or(0) > kAll;
  return all_inside && left < kOverstated * parts.physics.cell->tracker.sigma ? left : 0;
}

double hidden_by_sigma(const CompensatedModel& model) {
  const double left = left_within_sigma(model.parts());
  if (left == 0) return 0;
  const double promised = stated_variance(model);
  return std::sqrt(promised + left * left) > kChanged * std::sqrt(promised) ? left : 0;
}

}  // namespace trammel
