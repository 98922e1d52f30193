#include "server/tasks/train/bias_spread.h"

#include <cmath>

#include "server/bias/kernels/kernel_spelling.h"
#include "server/measurement/pose_groups.h"

namespace trammel {

namespace {

using Eigen::Index;

constexpr Index kFewObservations = 200;  // with more observations the hyperparameters stay, because
                                         // they are known well
constexpr Index kMostAsked = 1000;       // more poses do not improve one number
constexpr Index kFolds = 5;
constexpr int kStarts = 5;            // of each search: the remaining poses resemble the whole set
constexpr double kPriorSpread = 0.3;  // of log f: usual among kernels that fit
constexpr double kLargestLog = 2.3;   // f 10: beyond it the bias is wrong, not uncertain
constexpr int kThirds = 40;           // steps by a third of that interval
constexpr double kNothing = 1e-4;     // of log f

/// The errors at left-out poses: actual squares, and stated variances. All m², sums of three
/// coordinates.
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

/// The variance of a left-out pose: the bias, the noise that the bias attributes beyond the
/// instrument's, and the parameters as far as the bias lacks them (`identified`, m² of a
/// coordinate).
double uncertain(const BiasPrediction& bias, double instrument, double identified) {
  const Vector3 noise = bias.measured_stddev_B.cwiseAbs2() - bias.stddev_B.cwiseAbs2();
  return bias.covariance_B.trace() + (noise.array() - instrument).max(0.0).sum() +
         3 * bias.prior_share * identified;
}

/// The bias of these observations. With many observations the hyperparameters of `all` stay.
Result<BiasModel> learned_from(const BiasProblem& fewer, const BiasModel& all, Index of,
                               const BiasOptions& options) {
  if (of <= kFewObservations) return BiasModel::fit(fewer, options);
  BiasState state = all.state();
  state.q = fewer.q;
  state.residual_B = fewer.residual_B;
  state.sigma = fewer.sigma;
  state.features = fewer.features;
  return BiasModel::restore(std::move(state));
}

/// Adds every fifth pose from `first` on, with all rows of its joint vector; false where nothing
/// can be said without them.
bool add_fold(const BiasProblem& problem, const BiasModel& all, const BiasOptions& options,
              const LeftOut& left_out, Index first, Missed& missed) {
  const bool has_parameters = spelled_bias(all.state().kernel)->has("parameters");
  std::vector<Index> block, rest;
  const std::vector<PoseGroup> poses = pose_groups(problem.q);
  for (Index p = 0; p < std::ssize(poses); ++p) {
    const PoseGroup& rows = poses[static_cast<std::size_t>(p)];
    std::vector<Index>& to = p % kFolds == first ? block : rest;
    to.insert(to.end(), rows.begin(), rows.end());
  }
  const auto without = left_out.without(block);
  if (!without) return false;
  const BiasProblem fewer{problem.q(rest, Eigen::all), without->residual_B(rest, Eigen::all),
                          problem.sigma(rest), at(problem.features, rest)};
  const Result<BiasModel> bias = learned_from(fewer, all, problem.q.rows(), options);
  if (!bias) return false;
  const auto said = bias->predict_all(problem.q(block, Eigen::all), at(problem.features, block));
  for (std::size_t k = 0; k < block.size(); ++k) {
    const double instrument = std::pow(problem.sigma(block[k]), 2);
    const double identified = has_parameters ? 0 : without->variance(static_cast<Index>(k));
    missed.square.push_back(
        (without->residual_B.row(block[k]).transpose() - said[k].mean_B).squaredNorm());
    missed.uncertain.push_back(uncertain(said[k], instrument, identified));
    missed.instrument.push_back(3 * instrument);
  }
  return true;
}

/// -2 log of the likelihood of f and of its prior, without constant terms.
double misfit(const Missed& missed, double log_f) {
  double sum = std::pow(log_f / kPriorSpread, 2);
  for (std::size_t k = 0; k < missed.square.size(); ++k) {
    const double expected = std::exp(2 * log_f) * missed.uncertain[k] + missed.instrument[k];
    sum += 3 * (std::log(expected) + missed.square[k] / expected);
  }
  return sum;
}

/// The likeliest f, at least 1. If the uncertainty is small beside the instrument's noise, hundreds
/// of poses determine f poorly, and it stays near 1.
double likeliest_spread(const Missed& missed) {
  double low = 0, high = kLargestLog;
  for (int k = 0; k < kThirds; ++k) {
    const double first = low + (high - low) / 3, second = high - (high - low) / 3;
    if (misfit(missed, first) <= misfit(missed, second)) {
      high = second;
    } else {
      low = first;
    }
  }
  return low < kNothing ? 1 : std::exp(low);
}

}  // namespace

double bias_spread(const BiasProblem& problem, const BiasModel& bias, const LeftOut& left_out,
                   std::uint64_t seed, const std::function<bool(double)>& progress) {
  if (left_out.size() != problem.q.rows()) return 1;
  BiasOptions options;
  options.kernel = bias.state().kernel;
  options.starts = kStarts;
  options.seed = seed;
  Missed missed;
  for (Index fold = 0; fold < kFolds; ++fold) {
    options.progress = [&](double share) {
      return progress((static_cast<double>(fold) + share) / kFolds);
    };
    if (!add_fold(problem, bias, options, left_out, fold, missed)) return 1;
    if (std::ssize(missed.square) >= kMostAsked) break;
  }
  return likeliest_spread(missed);
}

}  // namespace trammel
