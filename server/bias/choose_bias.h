#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/bias/bias_checks.h"
#include "server/bias/bias_model.h"

namespace trammel {

/// What a bias is worth: errors of observations that it was conditioned without.
struct BiasCandidate {
  std::string kernel;             ///< as spelled; `none` first
  double leave_one_out_rms = 0;   ///< m, Euclidean, under the physics identified with all; of `none` the residual
  double leave_one_out_nlpd = 0;  ///< mean over coordinates of -log density, nat, of positions in m
  double time_block_rms = 0;      ///< m, Euclidean; every eighth of the observations in their order left out at once
  double joint_block_rms = 0;     ///< m; the same of eighths of joint space
  double gain = 0;                ///< m², of the mean square by blocks in time, against `none`
  double gain_stddev = 0;         ///< m², of that mean, from its scatter over the blocks
  std::string verdict;            ///< why it was not taken, or `taken`
  bool skipped = false;           ///< not fitted: no figures, the verdict says why
};

struct BiasChoice {
  std::string kernel;                     ///< that was taken
  std::vector<BiasCandidate> candidates;  ///< those asked, the simplest first
  std::string sentence;                   ///< for people: what was taken and what it is worth, mm
};

struct ChosenBias {
  BiasChoice choice;
  std::optional<BiasModel> model;  ///< empty for `none`
};

/// The word for it in place of a kernel.
inline constexpr std::string_view kAutoBias = "auto";

/// N x 3, m: the residuals of all observations under a physics identified without these; empty where that cannot be.
/// Observations that helped to identify it fit it too well: a bias could seem to predict what is only the imprint of
/// those left out.
using ResidualWithout = std::function<std::optional<Eigen::MatrixXd>(const std::vector<Eigen::Index>&)>;

/// Whether `model`, fitted to `problem`, is clearly likelier leave-one-out than none: by more than a nat for each
/// hyperparameter that it has more and twice the standard error.
[[nodiscard]] bool is_worth_it(const BiasProblem& problem, const BiasModel& model);

/// Takes the simplest of `none`, `se`, `matern52`, `se + parameters` and, where even the best of these leaves clearly
/// more than metrology's noise, `matern52 + joint_map + parameters` and `se + joint_map` that no other beats. One
/// beats another by its leave-one-out log density, summed over the observations, by more than a nat for each
/// hyperparameter that it has more and twice the standard error; and a bias
/// counts only where leaving out blocks of neighbouring observations (`problem` in the order of measuring), with the
/// hyperparameters as found and the physics as `residual_without` says (empty: as in `problem`), confirms it: in time
/// the mean square error falls by more than twice its standard error over the blocks, in joint space it does not rise
/// by as much. Kernels with blocks are asked only where `problem` has features, and skipped beyond `most_coupled`
/// observations. A block that the physics cannot spare does not judge, and the sentence says so; where fewer than half
/// are left, nothing is taken. At most five fits; same problem and seed, same choice. Of `options` the kernel is not
/// used. Refuses what BiasModel::fit() refuses; with fewer than 30 observations nothing is taken.
[[nodiscard]] Result<ChosenBias> choose_bias(const BiasProblem& problem, const BiasOptions& options,
                                             const ResidualWithout& residual_without = {},
                                             Eigen::Index most_coupled = kMostCoupled);

}  // namespace trammel
