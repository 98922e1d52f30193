#include "server/bias/choose_bias.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <set>

#include "server/base/units.h"
#include "server/bias/flange/flange_views.h"
#include "server/bias/kernels/kernel_spelling.h"
#include "server/bias/process/halves.h"
#include "server/measurement/pose_groups.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::array kCheap = {"se", "matern52", "se + parameters"};
/// Kernels for tool points at several levers.
constexpr std::array kAtFlange = {"se + flange", "matern52 + flange"};
constexpr std::array kDear = {"matern52 + joint_map + parameters", "se + joint_map"};
constexpr Index kBlocks =
    8;  // eight give a standard error, and seven eighths still show the physics
constexpr std::size_t kFewestBlocks = 4;  // half of them: of fewer the standard error means little
constexpr Index kFewestToJudge = 30;      // joint vectors: blocks of fewer than four show nothing
constexpr double kStandardErrors = 2;     // chance alone exceeds them in 1 of 40 cases
constexpr double kHyperparametersOfNone = 3;  // the standard deviation of each coordinate
constexpr double kFitShare =
    0.5;  // share of the time for one candidate: the rest is for leaving out blocks
constexpr double kGainOfPhysics =
    0.9;  // rms with parameters over rms without: a tenth less is worth a diagnosis
constexpr double kAboveNoise =
    1.3;  // rms over the instrument's noise, which a cell's file knows to a tenth
constexpr Index kMostRows =
    900;  // rows that choose: each candidate is fitted, and conditioned for each left-out block
constexpr Index kManyRows = 1200;  // of fewer all choose
constexpr double kChoosing = 0.7;  // share of the time, if only some rows choose

std::vector<Index> in_order(Index count) {
  std::vector<Index> all(static_cast<std::size_t>(count));
  std::iota(all.begin(), all.end(), Index{0});
  return all;
}

double rms(const MatrixXd& error) {
  return std::sqrt(error.squaredNorm() / static_cast<double>(error.rows()));
}

/// -log density of each observation, summed over its coordinates, nat.
VectorXd negative_log_density(const MatrixXd& error, const MatrixXd& stddev) {
  const auto z = error.array() / stddev.array();
  const double constant = 0.5 * std::log(2 * std::numbers::pi);
  return (0.5 * z.square() + stddev.array().log() + constant).rowwise().sum();
}

/// The sum of `of_row` over the rows of each pose.
VectorXd by_pose(const std::vector<PoseGroup>& poses, const VectorXd& of_row) {
  VectorXd sum(std::ssize(poses));
  for (std::size_t p = 0; p < poses.size(); ++p)
    sum[static_cast<Index>(p)] = of_row(poses[p]).sum();
  return sum;
}

/// One block left out: the rest, and all residuals with the physics identified from the rest.
struct Fold {
  std::vector<Index> block, rest;
  MatrixXd residual_B;  // N x 3
};

/// The blocks of whole poses, whose first rows are neighbours in `table` (N x n). Blocks that the
/// physics cannot be identified without are left out.
std::vector<Fold> folds(const BiasProblem& problem, const std::vector<PoseGroup>& poses,
                        const MatrixXd& table, const ResidualWithout& residual_without) {
  const std::vector<Index> observations = in_order(problem.q.rows());
  std::vector<Fold> all;
  for (const std::vector<Index>& block :
       halved(table, poses, (std::ssize(poses) + kBlocks - 1) / kBlocks)) {
    std::optional<MatrixXd> residual_B =
        residual_without ? residual_without(block) : problem.residual_B;
    if (!residual_B) continue;
    Fold fold{block, {}, *std::move(residual_B)};
    std::set_difference(observations.begin(), observations.end(), block.begin(), block.end(),
                        std::back_inserter(fold.rest));
    all.push_back(std::move(fold));
  }
  return all;
}

/// The errors of the observations of each fold's block.
using Missed = std::vector<MatrixXd>;

Missed missed_by_none(const std::vector<Fold>& folds) {
  Missed error;
  for (const Fold& fold : folds) error.emplace_back(fold.residual_B(fold.block, Eigen::all));
  return error;
}

double rms(const Missed& error) {
  double squares = 0;
  Index count = 0;
  for (const MatrixXd& block : error) {
    squares += block.squaredNorm();
    count += block.rows();
  }
  return std::sqrt(squares / static_cast<double>(count));
}

template <typename T>
std::vector<T> at(const std::vector<T>& all, const std::vector<Index>& rows) {
  std::vector<T> some;
  for (const Index i : rows) {
    if (!all.empty()) some.push_back(all[static_cast<std::size_t>(i)]);
  }
  return some;
}

/// Errors of the block of `fold`, predicted by a bias conditioned on the rest; the hyperparameters
/// stay.
Result<MatrixXd> missed(const BiasModel& model, const Fold& fold) {
  if (auto error = model.left_out_error_B(fold.residual_B, fold.block)) return *std::move(error);
  const BiasState& state = model.state();
  BiasState part = state;
  part.q = state.q(fold.rest, Eigen::all);
  part.residual_B = fold.residual_B(fold.rest, Eigen::all);
  part.sigma = state.sigma(fold.rest);
  part.features = at(state.features, fold.rest);
  const BiasModel rest = TRY(BiasModel::restore(part));
  return fold.residual_B(fold.block, Eigen::all) -
         rest.mean_all_B(state.q(fold.block, Eigen::all), at(state.features, fold.block));
}

/// The misses of all folds; `progress` is told the share done.
Result<Missed> missed(const BiasModel& model, const std::vector<Fold>& folds,
                      const std::function<bool(double)>& progress) {
  Missed error;
  for (const Fold& fold : folds) {
    Result<MatrixXd> of_block = missed(model, fold);
    if (!of_block) return tl::make_unexpected(of_block.error());
    error.push_back(*std::move(of_block));
    if (!progress(static_cast<double>(error.size()) / static_cast<double>(folds.size())))
      return failure(ErrorCode::kBusy, "bias choice: given up on request");
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

/// m²: the reduction of the mean square error from `without` to `with`, mean over the blocks.
Mean gain_of(const Missed& without, const Missed& with) {
  VectorXd gain(static_cast<Index>(without.size()));
  for (std::size_t b = 0; b < without.size(); ++b)
    gain[static_cast<Index>(b)] =
        (without[b].squaredNorm() - with[b].squaredNorm()) / static_cast<double>(without[b].rows());
  return mean_of(gain);
}

/// Without a bias each coordinate is expected to spread as the residual does.
VectorXd negative_log_density_of_none(const MatrixXd& error) {
  const Vector3 stddev = (error.colwise().squaredNorm() / static_cast<double>(error.rows()))
                             .cwiseSqrt()
                             .cwiseMax(1e-9);
  return negative_log_density(error, stddev.transpose().replicate(error.rows(), 1));
}

VectorXd negative_log_density_left_out(const BiasProblem& problem, const BiasModel& model) {
  return negative_log_density(problem.residual_B - model.leave_one_out_mean_B(),
                              model.leave_one_out_stddev_B());
}

double hyperparameters_of(const BiasModel& model) {
  const BiasState& state = model.state();
  return static_cast<double>(state.hyperparameters.size() + state.block_hyperparameters.size());
}

/// True if `nlpd` (per pose, the sum of its rows) is clearly below `other`. The left-out pose took
/// part in the search, so each hyperparameter adds a bias of one nat to the sum (Akaike 1974).
bool clearly_likelier(const VectorXd& nlpd, const VectorXd& other, double more_hyperparameters) {
  const Mean likelier = mean_of(other - nlpd);
  return likelier.value - more_hyperparameters / static_cast<double>(nlpd.size()) >
         kStandardErrors * likelier.stddev;
}

/// The best candidate so far.
struct Best {
  std::size_t candidate = 0;
  VectorXd nlpd;  // of each pose
  double hyperparameters = kHyperparametersOfNone;
  std::optional<BiasModel> model;
};

class Choosing {
 public:
  /// `problem` is all of `all`, or the rows of it that choose.
  Choosing(const BiasProblem& problem, const BiasProblem& all, const BiasOptions& options,
           const ResidualWithout& residual_without, Index most_coupled)
      : problem_(problem),
        all_(all),
        poses_(pose_groups(problem.q)),
        options_(options),
        most_coupled_(most_coupled),
        several_levers_(!problem.features.empty() && has_several_levers(problem.features)) {
    if (std::ssize(poses_) < kFewestToJudge) return;
    const Index count = problem.q.rows();
    in_time_ = folds(problem, poses_, VectorXd::LinSpaced(count, 0, static_cast<double>(count - 1)),
                     residual_without);
    in_joint_space_ = folds(problem, poses_, problem.q, residual_without);
  }

  Result<ChosenBias> run() {
    if (std::ssize(poses_) < kFewestToJudge) {
      choice_.sentence = fmt::format("no bias: {} poses are too few to judge one, at least {}",
                                     poses_.size(), kFewestToJudge);
      choice_.kernel = "none";
      return ChosenBias{choice_, std::nullopt};
    }
    if (std::min(in_time_.size(), in_joint_space_.size()) < kFewestBlocks) {
      choice_.sentence =
          "no bias: too little is left to identify the physics from without blocks of the poses, "
          "so none can be judged";
      choice_.kernel = "none";
      return ChosenBias{choice_, std::nullopt};
    }
    ask_none();
    for (const char* kernel : kCheap) {
      TRY(ask(kernel));
    }
    if (several_levers_) {
      for (const char* kernel : kAtFlange) {
        TRY(ask(kernel));
      }
    }
    const double noise =
        std::sqrt(3 * problem_.sigma.squaredNorm() / static_cast<double>(problem_.sigma.size()));
    for (const char* kernel : kDear) {
      if (choice_.candidates[best_.candidate].leave_one_out_rms < kAboveNoise * noise) break;
      TRY(ask(kernel));
    }
    return chosen();
  }

 private:
  void ask_none() {
    const MatrixXd& error = problem_.residual_B;
    const VectorXd nlpd = negative_log_density_of_none(error);
    best_.nlpd = by_pose(poses_, nlpd);
    without_in_time_ = missed_by_none(in_time_);
    without_in_joint_space_ = missed_by_none(in_joint_space_);
    choice_.candidates.push_back({"none", rms(error), nlpd.mean() / 3, rms(without_in_time_),
                                  rms(without_in_joint_space_), 0, 0, ""});
  }

  Status ask(const std::string& kernel) {
    const Result<SpelledBias> bias = spelled_bias(kernel);
    if (bias->needs_features() && problem_.features.empty()) return {};
    if (const std::string too_many = too_many_for(*bias); !too_many.empty()) {
      choice_.candidates.push_back({.kernel = kernel, .verdict = too_many, .skipped = true});
      return {};
    }
    BiasOptions options = options_;
    options.kernel = kernel;
    const auto most = static_cast<double>(kCheap.size() + kDear.size() +
                                          (several_levers_ ? kAtFlange.size() : 0));
    const auto report = [this, most, done = asked_++](double share) {
      return !options_.progress || options_.progress((done + share) / most);
    };
    options.progress = [&](double share) { return report(kFitShare * share); };
    BiasModel model = TRY(BiasModel::fit(problem_, options));
    const MatrixXd error = problem_.residual_B - model.leave_one_out_mean_B();
    const VectorXd nlpd = negative_log_density_left_out(problem_, model);
    constexpr double kBoth = (1 - kFitShare) / 2;
    const auto in_time = TRY(
        missed(model, in_time_, [&](double share) { return report(kFitShare + kBoth * share); }));
    const auto in_joint_space = TRY(missed(
        model, in_joint_space_, [&](double share) { return report(1 - kBoth + kBoth * share); }));
    const Mean gain = gain_of(without_in_time_, in_time);
    const Mean far = gain_of(without_in_joint_space_, in_joint_space);
    choice_.candidates.push_back({kernel, rms(error), nlpd.mean() / 3, rms(in_time),
                                  rms(in_joint_space), gain.value, gain.stddev, ""});
    BiasCandidate& candidate = choice_.candidates.back();

    const double hyperparameters = hyperparameters_of(model);
    const VectorXd of_poses = by_pose(poses_, nlpd);
    if (!clearly_likelier(of_poses, best_.nlpd, hyperparameters - best_.hyperparameters)) {
      candidate.verdict =
          fmt::format("not clearly better than {}", choice_.candidates[best_.candidate].kernel);
      not_likelier_.insert(choice_.candidates.size() - 1);
    } else if (gain.value <= kStandardErrors * gain.stddev) {
      candidate.verdict = "does not help beyond chance where neighbours in time are left out";
    } else if (far.value < -kStandardErrors * far.stddev) {
      candidate.verdict = "harms where neighbours in joint space are left out";
    } else {
      best_ = {choice_.candidates.size() - 1, of_poses, hyperparameters, std::move(model)};
    }
    return {};
  }

  /// The reason why the kernel cannot be tried; empty if it can.
  [[nodiscard]] std::string too_many_for(const SpelledBias& bias) const {
    if (!bias.blocks.empty() && most_coupled_ == 0) return "its causes are in the physics already";
    if (!bias.blocks.empty() && all_.q.rows() > most_coupled_)
      return fmt::format("more than {} poses", most_coupled_);
    if (bias.flange && !check_flange(all_.q, all_.features))
      return fmt::format("more than {} numbers at the flange", kMostFlangeNumbers);
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
          "bias {}: leave-one-out {:.4f} mm, the residual is {:.4f} mm; blocks left out in time "
          "{:.4f} mm, in joint space {:.4f} mm",
          taken.kernel, to_mm(taken.leave_one_out_rms), to_mm(none.leave_one_out_rms),
          to_mm(taken.time_block_rms), to_mm(taken.joint_block_rms));
      if (learns_physics()) {
        choice_.sentence +=
            "; it gains by what physics would that the error sources may lack: diagnose the batch, "
            "a model that has it holds farther out";
      }
    } else {
      const auto other = std::min_element(
          choice_.candidates.begin() + 1, choice_.candidates.end(),
          [](const auto& a, const auto& b) {
            return a.skipped != b.skipped ? b.skipped : a.leave_one_out_nlpd < b.leave_one_out_nlpd;
          });
      const bool likelier =
          !not_likelier_.contains(static_cast<std::size_t>(other - choice_.candidates.begin()));
      choice_.sentence = fmt::format(
          "no bias helps: the residual is {:.4f} mm, leave-one-out {:.4f} mm with {}, which {}; "
          "left out",
          to_mm(none.leave_one_out_rms), to_mm(other->leave_one_out_rms), other->kernel,
          likelier ? other->verdict : "is not clearly likelier");
    }
    if (const std::size_t unjudged = 2 * kBlocks - in_time_.size() - in_joint_space_.size();
        unjudged > 0) {
      choice_.sentence += fmt::format(
          "; {} of {} blocks do not judge: without them the physics cannot be identified", unjudged,
          2 * kBlocks);
    }
    return {std::move(choice_), std::move(best_.model)};
  }

  /// True if the block `parameters` leaves clearly less error than the same kernel without it.
  [[nodiscard]] bool learns_physics() const {
    const BiasCandidate& taken = choice_.candidates[best_.candidate];
    const auto plain = std::find_if(choice_.candidates.begin(), choice_.candidates.end(),
                                    [](const BiasCandidate& one) { return one.kernel == "se"; });
    return taken.kernel == "se + parameters" && plain != choice_.candidates.end() &&
           taken.leave_one_out_rms < kGainOfPhysics * plain->leave_one_out_rms;
  }

  const BiasProblem& problem_;
  const BiasProblem& all_;
  const std::vector<PoseGroup> poses_;
  const BiasOptions& options_;
  const Index most_coupled_;
  const bool several_levers_;
  std::vector<Fold> in_time_, in_joint_space_;
  Missed without_in_time_, without_in_joint_space_;  // by `none`
  BiasChoice choice_;
  std::set<std::size_t> not_likelier_;  // candidates
  Best best_;
  int asked_ = 0;
};

/// Whole poses, evenly in the order of measuring, with few enough rows for a quick choice.
std::vector<Index> rows_to_choose_by(const BiasProblem& problem) {
  if (problem.q.rows() <= kManyRows) return in_order(problem.q.rows());
  const std::vector<PoseGroup> poses = pose_groups(problem.q);
  const std::size_t wanted =
      std::max<std::size_t>(1, poses.size() * static_cast<std::size_t>(kMostRows) /
                                   static_cast<std::size_t>(problem.q.rows()));
  std::vector<Index> rows;
  for (std::size_t k = 0; k < wanted; ++k) {
    const PoseGroup& pose = poses[k * poses.size() / wanted];
    rows.insert(rows.end(), pose.begin(), pose.end());
  }
  std::sort(rows.begin(), rows.end());
  return rows;
}

BiasProblem rows_of(const BiasProblem& problem, const std::vector<Index>& rows) {
  return {problem.q(rows, Eigen::all), problem.residual_B(rows, Eigen::all), problem.sigma(rows),
          at(problem.features, rows)};
}

/// The residuals by `residual_without` of the rows `some`, except those at `rows` among them.
std::optional<MatrixXd> left_of(const ResidualWithout& residual_without,
                                const std::vector<Index>& some, const std::vector<Index>& rows) {
  const std::optional<MatrixXd> all = residual_without(at(some, rows));
  return all ? std::optional<MatrixXd>((*all)(some, Eigen::all)) : std::nullopt;
}

/// `options` whose progress is the part [from, to] of the whole.
BiasOptions as_share(BiasOptions options, double from, double to) {
  if (const auto whole = options.progress)
    options.progress = [whole, from, to](double share) {
      return whole(from + (to - from) * share);
    };
  return options;
}

/// Refits `model`, which was found on some rows of `problem`, to all rows. The search continues
/// from its end.
Result<BiasModel> grown(const BiasModel& model, const BiasProblem& problem,
                        const BiasOptions& options) {
  BiasState state = model.state();
  state.q = problem.q;
  state.residual_B = problem.residual_B;
  state.sigma = problem.sigma;
  state.features = model.needs_features() ? problem.features : std::vector<BiasFeatures>();
  return BiasModel::restore(state).and_then(
      [&](const BiasModel& whole) { return whole.refit(options); });
}

}  // namespace

bool is_worth_it(const BiasProblem& problem, const BiasModel& model) {
  const std::vector<PoseGroup> poses = pose_groups(problem.q);
  return clearly_likelier(by_pose(poses, negative_log_density_left_out(problem, model)),
                          by_pose(poses, negative_log_density_of_none(problem.residual_B)),
                          hyperparameters_of(model) - kHyperparametersOfNone);
}

Result<ChosenBias> choose_bias(const BiasProblem& problem, const BiasOptions& options,
                               const ResidualWithout& residual_without, Index most_coupled) {
  BiasOptions nothing = options;
  nothing.kernel = "none";
  TRY(BiasModel::fit(problem, nothing));
  const std::vector<Index> some = rows_to_choose_by(problem);
  if (std::ssize(some) == problem.q.rows())
    return Choosing(problem, problem, options, residual_without, most_coupled).run();
  const BiasProblem part = rows_of(problem, some);
  ResidualWithout of_part;
  if (residual_without)
    of_part = [&](const std::vector<Index>& rows) { return left_of(residual_without, some, rows); };
  const BiasOptions first = as_share(options, 0, kChoosing), rest = as_share(options, kChoosing, 1);
  ChosenBias chosen = TRY(Choosing(part, problem, first, of_part, most_coupled).run());
  chosen.choice.sentence +=
      fmt::format("; chosen by {} of {} rows", part.q.rows(), problem.q.rows());
  if (chosen.model) chosen.model = TRY(grown(*chosen.model, problem, rest));
  return chosen;
}

}  // namespace trammel
