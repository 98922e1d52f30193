#include "server/tasks/train/bias_learning.h"

#include <algorithm>
#include <cmath>

#include "server/bias/choose_bias.h"
#include "server/bias/kernels/kernel_spelling.h"
#include "server/tasks/train/bias_spread.h"
#include "server/tasks/train/extrapolation.h"
#include "server/tasks/train/given_up.h"
#include "server/tasks/train/leftover.h"

namespace trammel {

namespace {

constexpr double kDomainQuantile = 0.995;  // quantile over the left-out training poses, which count
                                           // as known
constexpr int kLeastBiasPoses = 10;

/// A pose counts as known if its posterior-to-prior share is within that of left-out training
/// poses.
double domain_limit(const BiasModel& bias) {
  Eigen::VectorXd share = bias.leave_one_out_prior_share();
  std::sort(share.begin(), share.end());
  const auto place =
      static_cast<Eigen::Index>(kDomainQuantile * static_cast<double>(share.size() - 1));
  return share(place);
}

/// The training data of a bias: the residuals of the physics of `parts` on `batch`, with the
/// features that `kernel` needs.
BiasProblem problem_of(const CompensatedModel::Parts& parts, const MeasurementBatch& batch,
                       bool described) {
  BiasProblem problem = leftover(parts.physics, batch);
  if (!described) return problem;
  const BiasPhysics physics(parts.physics);
  for (const Measurement& m : batch.measurements) problem.features.push_back(physics.at(m.context));
  return problem;
}

/// The problem of the orientations of `batch`, if all were measured: residual rotation vectors in B
/// and sigma in rad, at the poses of `problem`.
std::optional<BiasProblem> rotation_problem(const PhysicalModel& physics,
                                            const MeasurementBatch& batch,
                                            const BiasProblem& problem) {
  BiasProblem rotation = problem;
  rotation.sigma.setConstant(physics.cell->tracker.sigma_rotation);
  const Matrix3 R_BW = physics.X_WB.linear().transpose();
  for (std::size_t i = 0; i < batch.measurements.size(); ++i) {
    const Measurement& m = batch.measurements[i];
    if (!m.R_WT) return std::nullopt;
    if (m.sigma_rotation) rotation.sigma(static_cast<Eigen::Index>(i)) = *m.sigma_rotation;
    const Vector3 turn_W = rotation_log(*m.R_WT * physics.pose_W(m.context).linear().transpose());
    rotation.residual_B.row(static_cast<Eigen::Index>(i)) = (R_BW * turn_W).transpose();
  }
  for (BiasFeatures& features : rotation.features) features = turned(features);
  return rotation;
}

/// Chooses the bias, with the physics identified anew wherever observations are left out. Beside
/// causes chosen by the measurements, kernels with blocks are skipped, since they would only choose
/// the same again.
Result<std::optional<BiasModel>> chosen_bias(CompensatedModel::Parts& parts,
                                             const BiasProblem& problem, const BiasOptions& options,
                                             const LeftOut& left_out) {
  const auto residual_without = [&](const std::vector<Eigen::Index>& observations) {
    const auto without = left_out.without(observations);
    return without ? std::optional(without->residual_B) : std::nullopt;
  };
  ChosenBias chosen =
      TRY(choose_bias(problem, options, residual_without, parts.cause_choice ? 0 : kMostCoupled));
  parts.bias_choice = std::move(chosen.choice);
  return std::move(chosen.model);
}

/// Learns the orientation by a separate process with the same kernel, so that the learned positions
/// stay unchanged. A kernel that was chosen for the positions must gain here, too.
Status add_rotation_bias(CompensatedModel::Parts& parts, const MeasurementBatch& batch,
                         const BiasProblem& problem, const BiasOptions& options) {
  const std::optional<BiasProblem> rotation = rotation_problem(parts.physics, batch, problem);
  if (!rotation) {
    parts.oriented_poses =
        static_cast<int>(std::count_if(batch.measurements.begin(), batch.measurements.end(),
                                       [](const Measurement& m) { return m.R_WT.has_value(); }));
    return {};
  }
  const BiasModel learned = TRY(BiasModel::fit(*rotation, options));
  if (parts.bias_choice && !is_worth_it(*rotation, learned)) {
    parts.bias_choice->sentence +=
        "; of the orientations it explains nothing beyond chance and corrects none";
    return {};
  }
  parts.rotation_bias = learned.state();
  parts.rotation_bias->features.clear();
  return {};
}

void forget_bias(CompensatedModel::Parts& parts) {
  parts.bias.reset();
  parts.rotation_bias.reset();
  parts.oriented_poses = 0;
  parts.bias_choice.reset();
  parts.bias_origin.reset();
  parts.bias_contexts.clear();
  parts.prior_share_limit = 0;
  parts.bias_spread = 1;
}

/// The batch without suspects. A smooth function would spread the error of such rows over their
/// neighbours.
MeasurementBatch without_suspects(const CompensatedModel::Parts& parts, MeasurementBatch batch) {
  std::erase_if(batch.measurements, [&](const Measurement& m) {
    return std::any_of(parts.suspects.begin(), parts.suspects.end(), [&](const SuspectPose& pose) {
      return pose.pose_id == m.pose_id && pose.row == m.row;
    });
  });
  return batch;
}

struct Learned {
  BiasProblem problem;
  std::optional<BiasModel> bias;  ///< empty: none is worth it
};

/// The bias of the kernel in `options`.
Result<Learned> learned_bias(CompensatedModel::Parts& parts, const MeasurementBatch& batch,
                             const LeftOut& left_out, const BiasOptions& options) {
  if (options.kernel == kAutoBias) {
    BiasProblem problem = problem_of(parts, batch, true);
    std::optional<BiasModel> chosen = TRY(chosen_bias(parts, problem, options, left_out));
    return Learned{std::move(problem), std::move(chosen)};
  }
  const SpelledBias spelled = TRY(spelled_bias(options.kernel));
  BiasProblem problem = problem_of(parts, batch, spelled.needs_features());
  BiasModel fitted = TRY(BiasModel::fit(problem, options));
  return Learned{std::move(problem), std::move(fitted)};
}

/// The context without the history before the pose, unless a source needs it: it is long, and few
/// sources do.
PoseContext without_what_nobody_asks(PoseContext context, const PhysicalModel& physics) {
  const auto asked = [&](bool ContextNeeds::*need) {
    return std::any_of(physics.sources.begin(), physics.sources.end(),
                       [need](const ErrorSourcePtr& source) { return source->needs().*need; });
  };
  if (!asked(&ContextNeeds::before)) context.before.reset();
  if (!asked(&ContextNeeds::history)) context.lagged.clear();
  return context;
}

/// The bias of the positions, and the domain in which it is known.
void take_over(CompensatedModel::Parts& parts, const BiasModel& bias, const MeasurementBatch& batch,
               const LeftOut& left_out) {
  parts.bias = bias.state();
  parts.bias->features.clear();
  if (bias.has_blocks())
    parts.extrapolation_slope = extrapolation_slope(left_out, parts.physics.cell->robot, bias);
  if (bias.needs_features()) {
    for (const Measurement& m : batch.measurements)
      parts.bias_contexts.push_back(without_what_nobody_asks(m.context, parts.physics));
  }
  parts.prior_share_limit = domain_limit(bias);
}

}  // namespace

Status add_bias(CompensatedModel::Parts& parts, const MeasurementBatch& all,
                const std::string& kernel, const LeftOut& left_out, std::uint64_t seed,
                const std::function<bool(double)>& progress) {
  forget_bias(parts);
  if (kernel == "none") return {};
  const MeasurementBatch batch = without_suspects(parts, all);
  if (batch.measurements.size() < kLeastBiasPoses && kernel == kAutoBias) {
    const std::string why =
        fmt::format("no bias: {} poses are too few to learn one from", batch.measurements.size());
    parts.bias_choice = BiasChoice{"none", {}, why};
    return {};
  }
  if (batch.measurements.size() < kLeastBiasPoses) {
    return refused("{} poses to learn a bias from, at least {} are needed",
                   batch.measurements.size(), kLeastBiasPoses)
        .in("batch " + batch.id)
        .beyond(batch.measurements.size(), kLeastBiasPoses)
        .next("measure more, or say bias: none");
  }
  if (!progress(0)) return given_up();
  BiasOptions options;
  options.kernel = kernel;
  options.seed = seed;
  // Shares by their times: the orientations, if there are any, take as long as the positions.
  const bool oriented = std::all_of(batch.measurements.begin(), batch.measurements.end(),
                                    [](const Measurement& m) { return m.R_WT.has_value(); });
  const double positions = oriented ? 0.5 : 0.95, with_spread = oriented ? 0.55 : 1;
  options.progress = [&](double share) { return progress(positions * share); };
  const Learned learned = TRY(learned_bias(parts, batch, left_out, options));
  if (!learned.bias) return {};
  take_over(parts, *learned.bias, batch, left_out);
  parts.bias_spread =
      bias_spread(learned.problem, *learned.bias, left_out, seed,
                  [&](double share) { return progress(std::lerp(positions, with_spread, share)); });
  options.kernel = without_flange(learned.bias->state().kernel);
  options.progress = [&](double share) { return progress(std::lerp(with_spread, 1.0, share)); };
  return add_rotation_bias(parts, batch, learned.problem, options);
}

}  // namespace trammel
