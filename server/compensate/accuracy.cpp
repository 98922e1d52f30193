#include "server/compensate/accuracy.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "server/base/units.h"
#include "server/compensate/arm_steps.h"
#include "server/compensate/known_rows.h"
#include "server/numerics/seeded_random.h"

namespace trammel {

namespace {

constexpr int kPoses = 600;     // of the domain, drawn
constexpr int kDraws = 16;      // of the true error at each
constexpr int kMostDraws = 50;  // draws of joint vectors for each pose near a measured one
constexpr std::uint64_t kSeed = 20261123;
constexpr int kGrid = 20;        // steps on each side of 1
constexpr double kFarthest = 4;  // standard deviations that the grids reach
constexpr double kMostlyInDomain =
    0.9;  // share of held-out poses; errors of the others say nothing of the domain
constexpr double kNothing = 1e-18;  // m²: no variance at all

/// Two independent standard normal numbers (Box and Muller 1958).
std::pair<double, double> normal_pair(SeededRandom& random) {
  const double length = std::sqrt(-2 * std::log(1 - random.uniform(0, 1)));
  const double angle = random.uniform(0, 2 * kPi);
  return {length * std::cos(angle), length * std::sin(angle)};
}

Vector3 normal_vector(SeededRandom& random) {
  const auto [x, y] = normal_pair(random);
  return {x, y, normal_pair(random).first};
}

/// L with L L' = the covariance of the true error: the stated one without the tracker's noise,
/// never negative.
Matrix3 root_of_true(const Matrix3& covariance, double tracker_variance) {
  const Eigen::SelfAdjointEigenSolver<Matrix3> solver(covariance -
                                                      tracker_variance * Matrix3::Identity());
  return solver.eigenvectors() * solver.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

double quantile_of(const std::vector<double>& rising, double share) {
  const double place = share * static_cast<double>(rising.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, rising.size() - 1);
  return rising[below] + (place - static_cast<double>(below)) * (rising[above] - rising[below]);
}

double share_below(const std::vector<double>& rising, double value) {
  return static_cast<double>(std::upper_bound(rising.begin(), rising.end(), value) -
                             rising.begin()) /
         static_cast<double>(rising.size());
}

/// Grid of ln x, x about 1, by its place.
double grid_value(int place, double stddev) { return kFarthest * stddev * place / kGrid; }

/// The log likelihood of these coordinates if the stated deviations are wrong by `factor` and the
/// tracker's sigma by `noise`.
double log_likelihood(const std::vector<JudgingCoordinate>& coordinates, double factor,
                      double noise) {
  double sum = 0;
  for (const JudgingCoordinate& one : coordinates) {
    const double variance =
        factor * factor * one.stated_variance + noise * noise * one.tracker_variance + kNothing;
    sum -= 0.5 * (std::log(variance) + one.squared_error / variance);
  }
  return sum;
}

double of_tracker(const CompensatedModel& model) {
  return model.cell().tracker.sigma * model.cell().tracker.sigma;
}

/// The coordinates of the poses of a batch that are in the domain.
std::vector<JudgingCoordinate> coordinates_of(const CompensatedModel& model,
                                              const MeasurementBatch& batch) {
  std::vector<JudgingCoordinate> all;
  const MeasurementBatch known = known_rows(model, batch);
  if (known.measurements.empty()) return all;
  const CompensatedModel::LevelErrors errors = model.errors_B(known);
  for (Eigen::Index i = 0; i < errors.compensated.cols(); ++i) {
    if (!errors.in_domain[static_cast<std::size_t>(i)]) continue;
    for (int k = 0; k < 3; ++k) {
      const double measured = std::pow(errors.stddev(k, i), 2);
      all.push_back({std::pow(errors.compensated(k, i), 2),
                     std::max(0.0, measured - of_tracker(model)), of_tracker(model)});
    }
  }
  return all;
}

/// True if the model's own figures on held-out poses are of poses in its domain.
bool judges_domain(const std::optional<Evaluation>& held_out) {
  return held_out && held_out->poses > 0 && std::isfinite(held_out->compensated.rms) &&
         held_out->in_domain >= kMostlyInDomain * held_out->poses;
}

}  // namespace

std::vector<PoseContext> poses_in_range(const CompensatedModel& model, int count) {
  const ModelParts& parts = model.parts();
  std::vector<std::pair<std::string, std::string>> trained_with;
  for (const auto& [tool, payload] : parts.trained_with) {
    const bool there = model.cell().tools.contains(tool) &&
                       (payload.empty() || model.cell().payloads.contains(payload));
    if (there) trained_with.emplace_back(tool, payload);
  }
  std::vector<PoseContext> poses;
  SeededRandom random(kSeed);
  if (trained_with.empty()) return poses;
  for (int drawn = 0; drawn < kMostDraws * count && static_cast<int>(poses.size()) < count;
       ++drawn) {
    PoseContext context;
    context.q = parts.q_min;
    for (Eigen::Index j = 0; j < context.q.size(); ++j)
      context.q(j) = random.uniform(parts.q_min(j), parts.q_max(j));
    if (parts.measured && !parts.measured->is_near(model.cell().robot, context.q)) continue;
    std::tie(context.tool, context.payload) = trained_with[poses.size() % trained_with.size()];
    context.served = true;
    poses.push_back(std::move(context));
  }
  return poses;
}

std::vector<PoseContext> poses_of_domain(const CompensatedModel& model, int count) {
  std::vector<PoseContext> poses = poses_in_range(model, count);
  const std::vector<ErrorPrediction> predictions = model.predict_all(poses);
  std::size_t next = 0;
  std::erase_if(poses, [&](const PoseContext&) { return !predictions[next++].in_domain; });
  return poses;
}

void PositionAccuracy::draw(const std::vector<ErrorPrediction>& poses, double tracker_sigma) {
  SeededRandom random(kSeed + 1);
  Vector3 last_error = Vector3::Zero(), last_place = Vector3::Zero();
  for (const ErrorPrediction& pose : poses) {
    const Vector3 place = pose.X_BT_predicted.translation();
    const Matrix3 root = root_of_true(pose.covariance_B, tracker_sigma * tracker_sigma);
    for (int k = 0; k < kDraws; ++k) {
      const Vector3 error = root * normal_vector(random);
      errors_.push_back(error.norm());
      if (k == 0)
        distances_.push_back(std::abs((place - last_place).normalized().dot(error - last_error)));
      if (k == 0) last_error = error;
    }
    last_place = place;
  }
  std::sort(errors_.begin(), errors_.end());
  std::sort(distances_.begin(), distances_.end());
}

/// `count_as`: a coordinate is worth so many.
void PositionAccuracy::weigh(const std::vector<JudgingCoordinate>& coordinates, double count_as) {
  std::vector<double> logs;
  for (int f = -kGrid; f <= kGrid; ++f) {
    const double log_factor = grid_value(f, kDoubt);
    for (int g = -kGrid; g <= kGrid; ++g) {
      const double log_noise = grid_value(g, kNoiseDoubt);
      logs.push_back(
          count_as * log_likelihood(coordinates, std::exp(log_factor), std::exp(log_noise)) -
          0.5 * (std::pow(log_factor / kDoubt, 2) + std::pow(log_noise / kNoiseDoubt, 2)));
    }
  }
  const double most = *std::max_element(logs.begin(), logs.end());
  double sum = 0;
  for (double& one : logs) sum += one = std::exp(one - most);
  constexpr std::size_t kRow = 2 * kGrid + 1;
  for (std::size_t f = 0; f < kRow; ++f) {
    double weight = 0;
    for (std::size_t g = 0; g < kRow; ++g) weight += logs[f * kRow + g];
    factors_.push_back({std::exp(grid_value(static_cast<int>(f) - kGrid, kDoubt)), weight / sum});
  }
}

std::optional<PositionAccuracy> PositionAccuracy::of(const CompensatedModel& model,
                                                     const std::optional<MeasurementBatch>& batch) {
  const std::vector<PoseContext> contexts = poses_of_domain(model, kPoses);
  if (contexts.empty()) return std::nullopt;
  const std::vector<ErrorPrediction> poses = model.predict_all(contexts);
  PositionAccuracy accuracy;
  accuracy.draw(poses, model.cell().tracker.sigma);
  for (const PoseContext& context : contexts)
    accuracy.smallest_step_ = std::max(accuracy.smallest_step_, smallest_step(model, context));
  accuracy.hidden_ = std::sqrt(1 - std::pow(1 - kNoiseDoubt, 2)) * model.cell().tracker.sigma;
  const std::optional<Evaluation>& held_out = model.parts().validation;
  std::vector<JudgingCoordinate> coordinates;
  double count_as = 1;
  if (batch) {
    coordinates = coordinates_of(model, *batch);
    accuracy.judged_by_ = static_cast<int>(coordinates.size() / 3);
  } else if (judges_domain(held_out)) {
    // Only the rms of these poses is known, so each coordinate gets the mean of a pose of the
    // domain.
    const double squared = std::pow(held_out->compensated.rms, 2) / 3;
    double stated = 0;
    for (const ErrorPrediction& pose : poses) stated += pose.true_stddev_B.squaredNorm() / 3;
    coordinates.push_back({squared, stated / static_cast<double>(poses.size()), of_tracker(model)});
    count_as = 3.0 * held_out->poses;
    accuracy.judged_by_ = held_out->poses;
  }
  accuracy.weigh(coordinates, count_as);
  return accuracy;
}

double PositionAccuracy::within(double radius) const {
  if (radius < smallest_step_) return 0;
  double share = 0;
  for (const Factor& one : factors_)
    share += one.weight * share_below(errors_, radius / one.factor);
  return share;
}

double PositionAccuracy::at(double share) const {
  double low = 0, high = std::max(errors_.back() * factors_.back().factor, smallest_step_);
  for (int step = 0; step < 60; ++step) {
    const double middle = 0.5 * (low + high);
    (within(middle) < share ? low : high) = middle;
  }
  return high;
}

/// The quantile of the factor at `share`.
double PositionAccuracy::factor_at(double share) const {
  double sum = 0;
  for (const Factor& one : factors_) {
    sum += one.weight;
    if (sum >= share) return one.factor;
  }
  return factors_.back().factor;
}

double PositionAccuracy::least() const {
  return std::max(smallest_step_, factor_at(0.025) * quantile_of(errors_, kShare));
}
double PositionAccuracy::most() const {
  return std::max(smallest_step_, factor_at(0.975) * quantile_of(errors_, kShare));
}
double PositionAccuracy::of_distances() const {
  return std::max(smallest_step_, factor_at(0.975) * quantile_of(distances_, kShare));
}

}  // namespace trammel
