#include "server/trainer/pipeline/bias_spread.h"

#include <cmath>

#include "server/bias/kernels/kernel_spelling.h"

namespace trammel {

namespace {

using Eigen::Index;

constexpr Index kMostObservations = 200;  // of more the hyperparameters are known well enough
constexpr Index kFolds = 5;
constexpr int kStarts = 5;        // of each search: the poses that are left are much like all
constexpr double kLargest = 100;  // f²: beyond it the bias is wrong, not uncertain
constexpr int kBisections = 50;

/// Of the poses left out: squares of what is missed, and what is said of them. All m², sums of three coordinates.
struct Missed {
  std::vector<double> square, uncertain, instrument;
};

std::vector<BiasFeatures> at(const std::vector<BiasFeatures>& all, const std::vector<Index>& rows) {
  std::vector<BiasFeatures> some;
  for (const Index i : rows) {
    if (!all.empty()) some.push_back(all[static_cast<std::size_t>(i)]);
  }
  return some;
}

/// What is uncertain of a pose left out: the bias, what it takes for noise beyond the instrument's, and the parameters
/// as far as it does not know them (`identified`, m² of a coordinate).
double uncertain(const BiasPrediction& bias, double instrument, double identified) {
  const Vector3 noise = bias.measured_stddev_B.cwiseAbs2() - bias.stddev_B.cwiseAbs2();
  return bias.covariance_B.trace() + (noise.array() - instrument).max(0.0).sum() + 3 * bias.prior_share * identified;
}

/// Adds every fifth pose from `first` on; false where nothing can be said without them.
bool add_fold(const BiasProblem& problem, const BiasOptions& options, bool has_parameters, const LeftOut& left_out,
              Index first, Missed& missed) {
  std::vector<Index> block, rest;
  for (Index i = 0; i < problem.q.rows(); ++i) (i % kFolds == first ? block : rest).push_back(i);
  const auto without = left_out.without(block);
  if (!without) return false;
  const BiasProblem fewer{problem.q(rest, Eigen::all), without->residual_B(rest, Eigen::all), problem.sigma(rest),
                          at(problem.features, rest)};
  const Result<BiasModel> bias = BiasModel::fit(fewer, options);
  if (!bias) return false;
  const auto said = bias->predict_all(problem.q(block, Eigen::all), at(problem.features, block));
  for (std::size_t k = 0; k < block.size(); ++k) {
    const double instrument = std::pow(problem.sigma(block[k]), 2);
    const double identified = has_parameters ? 0 : without->variance(static_cast<Index>(k));
    missed.square.push_back((without->residual_B.row(block[k]).transpose() - said[k].mean_B).squaredNorm());
    missed.uncertain.push_back(uncertain(said[k], instrument, identified));
    missed.instrument.push_back(3 * instrument);
  }
  return true;
}

/// f² under which the squares are as large as expected, from 1 on.
double square_of_spread(const Missed& missed) {
  const auto beyond = [&](double factor) {
    double sum = 0;
    for (std::size_t k = 0; k < missed.square.size(); ++k)
      sum += missed.square[k] / (factor * missed.uncertain[k] + missed.instrument[k]) - 1;
    return sum > 0;
  };
  if (missed.square.empty() || !beyond(1)) return 1;
  double low = 1, high = kLargest;
  for (int k = 0; k < kBisections; ++k) {
    const double middle = std::sqrt(low * high);
    (beyond(middle) ? low : high) = middle;
  }
  return low;
}

}  // namespace

double bias_spread(const BiasProblem& problem, const BiasModel& bias, const LeftOut& left_out, std::uint64_t seed,
                   const std::function<bool(double)>& progress) {
  if (problem.q.rows() > kMostObservations || left_out.size() != problem.q.rows()) return 1;
  BiasOptions options;
  options.kernel = bias.state().kernel;
  options.starts = kStarts;
  options.seed = seed;
  Missed missed;
  for (Index fold = 0; fold < kFolds; ++fold) {
    options.progress = [&](double share) { return progress((static_cast<double>(fold) + share) / kFolds); };
    if (!add_fold(problem, options, spelled_bias(bias.state().kernel)->has("parameters"), left_out, fold, missed))
      return 1;
  }
  return std::sqrt(square_of_spread(missed));
}

}  // namespace trammel
