#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/bias/bias_checks.h"
#include "server/bias/bias_model.h"

namespace trammel {

/// The worth of a bias: the errors of observations that were left out.
struct BiasCandidate {
  std::string kernel;  ///< as spelled; `none` first
  double leave_one_out_rms =
      0;  ///< m, Euclidean, with the physics identified from all poses; of `none` the residual
  double leave_one_out_nlpd =
      0;  ///< nat, mean of -log density over the coordinates; positions in m
  double time_block_rms =
      0;  ///< m, Euclidean; eighths of the observations, in their order, left out
  double joint_block_rms = 0;  ///< m, Euclidean; eighths of joint space left out
  double gain =
      0;  ///< m²: reduction of the mean square error against `none`, with blocks in time left out
  double gain_stddev = 0;  ///< m²: standard error of the gain, from its scatter over the blocks
  std::string verdict;     ///< why it was not taken, or `taken`
  bool skipped = false;  ///< true: not fitted; it has no figures, and the verdict gives the reason
};

struct BiasChoice {
  std::string kernel;                     ///< the one taken
  std::vector<BiasCandidate> candidates;  ///< the tried ones, the simplest first
  std::string sentence;                   ///< for people: the chosen bias, and its gain in mm
};

struct ChosenBias {
  BiasChoice choice;
  std::optional<BiasModel> model;  ///< empty for `none`
};

/// Written in place of a kernel: choose_bias() decides.
inline constexpr std::string_view kAutoBias = "auto";

/// N x 3, m: the residuals of all observations with the physics identified without these; empty if
/// the others do not identify it. Observations that helped to identify the physics fit it too well,
/// and a bias could seem to predict their imprint.
using ResidualWithout =
    std::function<std::optional<Eigen::MatrixXd>(const std::vector<Eigen::Index>&)>;

/// True if `model`, fitted to `problem`, is clearly likelier than `none`: its leave-one-out log
/// density exceeds that of `none` by more than one nat for each additional hyperparameter and twice
/// the standard error.
[[nodiscard]] bool is_worth_it(const BiasProblem& problem, const BiasModel& model);

/// Takes the simplest bias that no other beats. The cheap ones are tried first: `none`, `se`,
/// `matern52`, `se + parameters`; with several levers also `se + flange` and `matern52 + flange`.
/// If the best of them leaves clearly more than the instrument's noise, `matern52 + joint_map +
/// parameters` and `se + joint_map` are tried, too.
///
/// One bias beats another if
/// - its leave-one-out log density, summed over the observations, is higher by more than one nat
///   for each additional hyperparameter and twice the standard error;
/// - with blocks in time left out, its mean square error is below that of `none` by more than twice
///   the standard error over the blocks;
/// - with blocks in joint space left out, its mean square error is not above that of `none` by more
///   than twice the standard error. A block is an eighth of the observations, all neighbours;
///   `problem` is in the order of measuring. The hyperparameters stay; `residual_without` gives the
///   physics (empty: as in `problem`). A block is not judged if the physics cannot be identified
///   without it, and the sentence says so. If fewer than half of the blocks are judged, no bias is
///   taken.
///
/// Beyond 1200 observations, about 900 of them choose: whole poses, evenly in the order of
/// measuring; the sentence says so. The chosen bias is then fitted to all observations, and its
/// search continues from its end.
///
/// Kernels with blocks are tried only where `problem` has features and at most `most_coupled`
/// observations; 0: they are not tried. Makes at most seven fits. The same problem and seed give
/// the same choice. The kernel in `options` is ignored. With fewer than 30 observations it chooses
/// `none`. Refuses the same as BiasModel::fit().
[[nodiscard]] Result<ChosenBias> choose_bias(const BiasProblem& problem, const BiasOptions& options,
                                             const ResidualWithout& residual_without = {},
                                             Eigen::Index most_coupled = kMostCoupled);

}  // namespace trammel
