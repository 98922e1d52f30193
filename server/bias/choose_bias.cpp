#include "server/bias/choose_bias.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include "server/base/units.h"
#include "server/bias/kernel_spelling.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::array kCheap = {"se", "matern52", "se + parameters"};
constexpr std::array kDear = {"matern52 + joint_map + parameters", "se + joint_map"};
constexpr int kHalvings = 3;         // of the observations: eight blocks
constexpr Index kFewest = 30;        // observations; of fewer no block could be left out and judged
constexpr double kBeyondChance = 2;  // standard errors
constexpr double kLeavesMore = 1.3;  // of metrology's noise, rms: worth the dear ones

using Blocks = std::vector<std::vector<Index>>;

std::vector<Index> in_order(Index count) {
  std::vector<Index> all(static_cast<std::size_t>(count));
  std::iota(all.begin(), all.end(), Index{0});
  return all;
}

/// Halves and halves again; `before` says in which order a part is cut.
template <typename Before>
void halve(std::vector<Index> part, int times, const Before& before, Blocks* blocks) {
  if (times == 0) {
    std::sort(part.begin(), part.end());
    blocks->push_back(std::move(part));
    return;
  }
  const auto order = before(part);
  std::stable_sort(part.begin(), part.end(), order);
  const auto middle = part.begin() + static_cast<std::ptrdiff_t>(part.size() / 2);
  halve(std::vector<Index>(part.begin(), middle), times - 1, before, blocks);
  halve(std::vector<Index>(middle, part.end()), times - 1, before, blocks);
}

Blocks blocks_in_time(Index count) {
  Blocks blocks;
  halve(
      in_order(count), kHalvings, [](const std::vector<Index>&) { return std::less<>(); }, &blocks);
  return blocks;
}

/// Each part is cut across the joint that spreads widest in it.
Blocks blocks_in_joint_space(const MatrixXd& q) {
  Blocks blocks;
  const auto along_widest = [&q](const std::vector<Index>& part) {
    Index widest = 0;
    double width = -1;
    for (Index j = 0; j < q.cols(); ++j) {
      const VectorXd column = q.col(j)(part);
      const double spread = column.maxCoeff() - column.minCoeff();
      if (spread > width) widest = j;
      width = std::max(width, spread);
    }
    return [&q, widest](Index a, Index b) { return q(a, widest) < q(b, widest); };
  };
  halve(in_order(q.rows()), kHalvings, along_widest, &blocks);
  return blocks;
}

double rms(const MatrixXd& error) { return std::sqrt(error.squaredNorm() / static_cast<double>(error.rows())); }

/// -log density of each observation, summed over its coordinates, nat.
VectorXd negative_log_density(const MatrixXd& error, const MatrixXd& stddev) {
  const auto z = error.array() / stddev.array();
  const double constant = 0.5 * std::log(2 * std::numbers::pi);
  return (0.5 * z.square() + stddev.array().log() + constant).rowwise().sum();
}

/// One of the blocks, and all residuals as they are without it.
struct Fold {
  std::vector<Index> block, rest;
  MatrixXd residual_B;  // N x 3
};

std::vector<Fold> folds(const BiasProblem& problem, const Blocks& blocks, const ResidualWithout& residual_without) {
  const std::vector<Index> observations = in_order(problem.q.rows());
  std::vector<Fold> all;
  for (const std::vector<Index>& block : blocks) {
    Fold fold{block, {}, residual_without ? residual_without(block) : problem.residual_B};
    std::set_difference(observations.begin(), observations.end(), block.begin(), block.end(),
                        std::back_inserter(fold.rest));
    all.push_back(std::move(fold));
  }
  return all;
}

/// N x 3: what `none` misses of each observation when its block is left out.
MatrixXd missed_by_none(const std::vector<Fold>& folds, Index count) {
  MatrixXd error(count, 3);
  for (const Fold& fold : folds) error(fold.block, Eigen::all) = fold.residual_B(fold.block, Eigen::all);
  return error;
}

template <typename T>
std::vector<T> at(const std::vector<T>& all, const std::vector<Index>& rows) {
  std::vector<T> some;
  for (const Index i : rows) {
    if (!all.empty()) some.push_back(all[static_cast<std::size_t>(i)]);
  }
  return some;
}

/// The same with the bias conditioned on the rest; the hyperparameters stay.
Result<MatrixXd> missed(const BiasState& state, const std::vector<Fold>& folds) {
  MatrixXd error(state.q.rows(), 3);
  for (const Fold& fold : folds) {
    BiasState part = state;
    part.q = state.q(fold.rest, Eigen::all);
    part.residual_B = fold.residual_B(fold.rest, Eigen::all);
    part.sigma = state.sigma(fold.rest);
    part.features = at(state.features, fold.rest);
    const Result<BiasModel> rest = BiasModel::restore(part);
    if (!rest) return tl::make_unexpected(rest.error());
    error(fold.block, Eigen::all) = fold.residual_B(fold.block, Eigen::all) -
                                    rest->mean_all_B(state.q(fold.block, Eigen::all), at(state.features, fold.block));
  }
  return error;
}

struct Mean {
  double value = 0, stddev = 0;
};

Mean mean_of(const VectorXd& samples) {
  const auto n = static_cast<double>(samples.size());
  const double mean = samples.mean();
  return {mean, std::sqrt((samples.array() - mean).square().sum() / (n - 1) / n)};
}

/// By how much the mean square of `without` falls in `with`, block by block, m².
Mean gain_of(const MatrixXd& without, const MatrixXd& with, const std::vector<Fold>& folds) {
  VectorXd gain(static_cast<Index>(folds.size()));
  for (Index b = 0; b < gain.size(); ++b) {
    const std::vector<Index>& block = folds[static_cast<std::size_t>(b)].block;
    gain[b] = (without(block, Eigen::all).squaredNorm() - with(block, Eigen::all).squaredNorm()) /
              static_cast<double>(block.size());
  }
  return mean_of(gain);
}

/// The one that no other asked so far beats.
struct Best {
  std::size_t candidate = 0;
  VectorXd nlpd;               // of each observation
  double hyperparameters = 3;  // the residual's stddev, of each coordinate
  std::optional<BiasModel> model;
};

class Choosing {
 public:
  Choosing(const BiasProblem& problem, const BiasOptions& options, const ResidualWithout& residual_without,
           Index most_coupled)
      : problem_(problem), options_(options), most_coupled_(most_coupled) {
    if (problem.q.rows() < kFewest) return;
    in_time_ = folds(problem, blocks_in_time(problem.q.rows()), residual_without);
    in_joint_space_ = folds(problem, blocks_in_joint_space(problem.q), residual_without);
  }

  Result<ChosenBias> run() {
    if (problem_.q.rows() < kFewest) {
      choice_.sentence =
          fmt::format("no bias: {} observations are too few to judge one, at least {}", problem_.q.rows(), kFewest);
      choice_.kernel = "none";
      return ChosenBias{choice_, std::nullopt};
    }
    ask_none();
    for (const char* kernel : kCheap) {
      if (const Status asked = ask(kernel); !asked) return tl::make_unexpected(asked.error());
    }
    const double noise = std::sqrt(3 * problem_.sigma.squaredNorm() / static_cast<double>(problem_.sigma.size()));
    for (const char* kernel : kDear) {
      if (choice_.candidates[best_.candidate].leave_one_out_rms < kLeavesMore * noise) break;
      if (const Status asked = ask(kernel); !asked) return tl::make_unexpected(asked.error());
    }
    return chosen();
  }

 private:
  void ask_none() {
    const MatrixXd& error = problem_.residual_B;
    const Vector3 stddev =
        (error.colwise().squaredNorm() / static_cast<double>(error.rows())).cwiseSqrt().cwiseMax(1e-9);
    best_.nlpd = negative_log_density(error, stddev.transpose().replicate(error.rows(), 1));
    without_in_time_ = missed_by_none(in_time_, error.rows());
    without_in_joint_space_ = missed_by_none(in_joint_space_, error.rows());
    choice_.candidates.push_back(
        {"none", rms(error), best_.nlpd.mean() / 3, rms(without_in_time_), rms(without_in_joint_space_), 0, 0, ""});
  }

  Status ask(const std::string& kernel) {
    if (!spelled_bias(kernel)->blocks.empty()) {
      if (problem_.features.empty()) return {};
      if (problem_.q.rows() > most_coupled_) {
        choice_.candidates.push_back(
            {.kernel = kernel, .verdict = fmt::format("more than {} poses", most_coupled_), .skipped = true});
        return {};
      }
    }
    BiasOptions options = options_;
    options.kernel = kernel;
    const double most = kCheap.size() + kDear.size();
    options.progress = [this, most, done = asked_++](double share) {
      return !options_.progress || options_.progress((done + share) / most);
    };
    Result<BiasModel> model = BiasModel::fit(problem_, options);
    if (!model) return tl::make_unexpected(model.error());
    const MatrixXd error = problem_.residual_B - model->leave_one_out_mean_B();
    const VectorXd nlpd = negative_log_density(error, model->leave_one_out_stddev_B());
    const auto in_time = missed(model->state(), in_time_);
    if (!in_time) return tl::make_unexpected(in_time.error());
    const auto in_joint_space = missed(model->state(), in_joint_space_);
    if (!in_joint_space) return tl::make_unexpected(in_joint_space.error());
    const Mean gain = gain_of(without_in_time_, *in_time, in_time_);
    const Mean far = gain_of(without_in_joint_space_, *in_joint_space, in_joint_space_);
    choice_.candidates.push_back(
        {kernel, rms(error), nlpd.mean() / 3, rms(*in_time), rms(*in_joint_space), gain.value, gain.stddev, ""});
    BiasCandidate& candidate = choice_.candidates.back();

    // The hyperparameters were found with the observation left out, too: each lends the sum a nat (Akaike 1974).
    const BiasState& state = model->state();
    const auto count = static_cast<double>(nlpd.size());
    const double hyperparameters =
        static_cast<double>(state.hyperparameters.size() + state.block_hyperparameters.size());
    const Mean likelier = mean_of(best_.nlpd - nlpd);
    const double lent = (hyperparameters - best_.hyperparameters) / count;
    if (likelier.value - lent <= kBeyondChance * likelier.stddev) {
      candidate.verdict = fmt::format("not clearly better than {}", choice_.candidates[best_.candidate].kernel);
    } else if (gain.value <= kBeyondChance * gain.stddev) {
      candidate.verdict = "does not help beyond chance where neighbours in time are left out";
    } else if (far.value < -kBeyondChance * far.stddev) {
      candidate.verdict = "harms where neighbours in joint space are left out";
    } else {
      best_ = {choice_.candidates.size() - 1, nlpd, hyperparameters, std::move(*model)};
    }
    return {};
  }

  ChosenBias chosen() {
    BiasCandidate& taken = choice_.candidates[best_.candidate];
    for (BiasCandidate& candidate : choice_.candidates) {
      if (candidate.verdict.empty()) candidate.verdict = fmt::format("{} is better", taken.kernel);
    }
    taken.verdict = "taken";
    choice_.kernel = taken.kernel;
    const BiasCandidate& none = choice_.candidates.front();
    if (best_.candidate > 0) {
      choice_.sentence = fmt::format(
          "bias {}: leave-one-out {:.4f} mm, {:.4f} mm without; blocks left out in time {:.4f} mm, in joint space "
          "{:.4f} mm",
          taken.kernel, to_mm(taken.leave_one_out_rms), to_mm(none.leave_one_out_rms), to_mm(taken.time_block_rms),
          to_mm(taken.joint_block_rms));
    } else {
      const auto other =
          std::min_element(choice_.candidates.begin() + 1, choice_.candidates.end(), [](const auto& a, const auto& b) {
            return a.skipped != b.skipped ? b.skipped : a.leave_one_out_nlpd < b.leave_one_out_nlpd;
          });
      choice_.sentence =
          fmt::format("no bias helps: leave-one-out {:.4f} mm without, {:.4f} mm with {}, which {}; left out",
                      to_mm(none.leave_one_out_rms), to_mm(other->leave_one_out_rms), other->kernel,
                      other->verdict.starts_with("not clearly") ? "is not clearly likelier" : other->verdict);
    }
    return {std::move(choice_), std::move(best_.model)};
  }

  const BiasProblem& problem_;
  const BiasOptions& options_;
  const Index most_coupled_;
  std::vector<Fold> in_time_, in_joint_space_;
  MatrixXd without_in_time_, without_in_joint_space_;  // N x 3, m: what `none` misses there
  BiasChoice choice_;
  Best best_;
  int asked_ = 0;
};

}  // namespace

Result<ChosenBias> choose_bias(const BiasProblem& problem, const BiasOptions& options,
                               const ResidualWithout& residual_without, Index most_coupled) {
  BiasOptions nothing = options;
  nothing.kernel = "none";
  if (const Result<BiasModel> fine = BiasModel::fit(problem, nothing); !fine) return tl::make_unexpected(fine.error());
  return Choosing(problem, options, residual_without, most_coupled).run();
}

}  // namespace trammel
