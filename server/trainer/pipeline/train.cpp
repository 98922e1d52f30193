#include "server/trainer/pipeline/train.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/bias/kernels/kernel_spelling.h"
#include "server/calibrate/frames/frames.h"
#include "server/calibrate/orientation_check.h"
#include "server/measurement/repeats.h"
#include "server/measurement/velocity.h"
#include "server/trainer/pipeline/extrapolation.h"
#include "server/trainer/pipeline/left_out.h"
#include "server/trainer/pipeline/refitted.h"

namespace trammel {

namespace {

constexpr const char* kProgramVersion = "0.1.0";
constexpr double kDomainQuantile = 0.995;  // of the training poses, each left out, count as known
constexpr int kLeastBiasPoses = 10;

Error given_up() { return failure(ErrorCode::kBusy, "training given up on request").value(); }

/// Split, with velocities where the poses are a path and repeats merged where they are none. Held-out rows are not
/// touched.
BatchSplit prepared(MeasurementBatch batch, double sigma, const TrainOptions& options) {
  fill_velocity(batch);
  BatchSplit split = split_batch(batch, options.validation_share, options.seed);
  split.train = merge_repeats(split.train, sigma).batch;
  return split;
}

/// The sources to identify, as asked.
Result<std::vector<std::string>> sources_of(const Cell& cell, const TrainOptions& options) {
  Result<std::vector<std::string>> names =
      options.level ? parse_level(*options.level) : Result<std::vector<std::string>>(cell.model.error_sources);
  if (!names) return names;
  return with_unknown_tool(std::move(*names), cell);
}

/// The physics, identified anew.
Result<CalibrationResult> identify(const std::shared_ptr<const Cell>& cell, const MeasurementBatch& batch,
                                   const TrainOptions& options) {
  const Result<std::vector<std::string>> sources = sources_of(*cell, options);
  if (!sources) return tl::make_unexpected(sources.error());
  return calibrate(cell, *sources, batch, {});
}

/// A pose counts as known when its posterior-to-prior share is what training poses have when each is left out.
double domain_limit(const BiasModel& bias) {
  Eigen::VectorXd share = bias.leave_one_out_prior_share();
  std::sort(share.begin(), share.end());
  const auto place = static_cast<Eigen::Index>(kDomainQuantile * static_cast<double>(share.size() - 1));
  return share(place);
}

/// What a bias is learned from: what the physics of `parts` leaves over of `batch`, described as far as `kernel` asks.
BiasProblem problem_of(const CompensatedModel::Parts& parts, const MeasurementBatch& batch, bool described) {
  BiasProblem problem = leftover(parts.physics, batch);
  if (!described) return problem;
  const BiasPhysics physics(parts.physics);
  for (const Measurement& m : batch.measurements) problem.features.push_back(physics.at(m.context));
  return problem;
}

/// Of the orientations of `batch`, if all were measured: residual rotation vectors in B and sigma in rad, at the poses
/// of `problem`.
std::optional<BiasProblem> rotation_problem(const PhysicalModel& physics, const MeasurementBatch& batch,
                                            const BiasProblem& problem) {
  BiasProblem rotation = problem;
  rotation.sigma.setConstant(physics.cell->tracker.sigma_rotation);
  const Matrix3 R_BW = physics.X_WB.linear().transpose();
  for (std::size_t i = 0; i < batch.measurements.size(); ++i) {
    const Measurement& m = batch.measurements[i];
    if (!m.R_WT) return std::nullopt;
    const Vector3 turn_W = rotation_log(*m.R_WT * physics.pose_W(m.context).linear().transpose());
    rotation.residual_B.row(static_cast<Eigen::Index>(i)) = (R_BW * turn_W).transpose();
  }
  for (BiasFeatures& features : rotation.features) features = turned(features);
  return rotation;
}

/// The bias that is worth it, with the physics identified anew where observations are left out.
Result<std::optional<BiasModel>> chosen_bias(CompensatedModel::Parts& parts, const BiasProblem& problem,
                                             const BiasOptions& options, const LeftOut& left_out) {
  Result<ChosenBias> chosen = choose_bias(problem, options, [&](const std::vector<Eigen::Index>& observations) {
    const auto without = left_out.without(observations);
    return without ? std::optional(without->residual_B) : std::nullopt;
  });
  if (!chosen) return tl::make_unexpected(chosen.error());
  parts.bias_choice = std::move(chosen->choice);
  return std::move(chosen->model);
}

/// The orientation by a process of its own, of the same kernel: what is learned of the positions stays what it is.
/// Where the kernel was chosen for the positions, it must be worth it here too.
Status add_rotation_bias(CompensatedModel::Parts& parts, const MeasurementBatch& batch, const BiasProblem& problem,
                         const BiasOptions& options) {
  const std::optional<BiasProblem> rotation = rotation_problem(parts.physics, batch, problem);
  if (!rotation) {
    parts.oriented_poses = static_cast<int>(std::count_if(batch.measurements.begin(), batch.measurements.end(),
                                                          [](const Measurement& m) { return m.R_WT.has_value(); }));
    return {};
  }
  const Result<BiasModel> learned = BiasModel::fit(*rotation, options);
  if (!learned) return tl::make_unexpected(learned.error());
  if (parts.bias_choice && !is_worth_it(*rotation, *learned)) {
    parts.bias_choice->sentence += "; of the orientations it explains nothing beyond chance and corrects none";
    return {};
  }
  parts.rotation_bias = learned->state();
  parts.rotation_bias->features.clear();
  return {};
}

/// The bias of `kernel` or, for `auto`, the one that is worth it. `left_out`: of `all`, without suspects.
Status add_bias(CompensatedModel::Parts& parts, const MeasurementBatch& all, const std::string& kernel,
                const LeftOut& left_out, std::uint64_t seed, const std::function<bool(double)>& progress) {
  parts.bias.reset();
  parts.rotation_bias.reset();
  parts.oriented_poses = 0;
  parts.bias_choice.reset();
  parts.bias_origin.reset();
  parts.bias_contexts.clear();
  parts.prior_share_limit = 0;
  if (kernel == "none") return {};
  // What does not fit the others is not learned: a smooth function would spread it over its neighbours.
  MeasurementBatch batch = all;
  std::erase_if(batch.measurements, [&](const Measurement& m) {
    return std::any_of(parts.suspects.begin(), parts.suspects.end(),
                       [&](const SuspectPose& pose) { return pose.pose_id == m.pose_id && pose.row == m.row; });
  });
  if (batch.measurements.size() < kLeastBiasPoses && kernel == kAutoBias) {
    const std::string why = fmt::format("no bias: {} poses are too few to learn one from", batch.measurements.size());
    parts.bias_choice = BiasChoice{"none", {}, why};
    return {};
  }
  if (batch.measurements.size() < kLeastBiasPoses) {
    return refused("{} poses to learn a bias from, at least {} are needed", batch.measurements.size(), kLeastBiasPoses)
        .in("batch " + batch.id)
        .beyond(batch.measurements.size(), kLeastBiasPoses)
        .next("measure more, or say bias: none");
  }
  if (!progress(0)) return tl::make_unexpected(given_up());
  BiasOptions options;
  options.kernel = kernel;
  options.seed = seed;
  options.progress = [&](double share) { return progress(0.6 * share); };
  std::optional<BiasModel> bias;
  BiasProblem problem;
  if (kernel == kAutoBias) {
    problem = problem_of(parts, batch, true);
    Result<std::optional<BiasModel>> chosen = chosen_bias(parts, problem, options, left_out);
    if (!chosen) return tl::make_unexpected(chosen.error());
    bias = std::move(*chosen);
  } else {
    const Result<SpelledBias> spelled = spelled_bias(kernel);
    if (!spelled) return tl::make_unexpected(spelled.error());
    problem = problem_of(parts, batch, !spelled->blocks.empty());
    Result<BiasModel> fitted = BiasModel::fit(problem, options);
    if (!fitted) return tl::make_unexpected(fitted.error());
    bias = std::move(*fitted);
  }
  if (!bias) return {};
  parts.bias = bias->state();
  parts.bias->features.clear();
  if (bias->needs_features()) {
    parts.extrapolation_slope = extrapolation_slope(left_out, parts.physics.cell->robot, *bias);
    for (const Measurement& m : batch.measurements) parts.bias_contexts.push_back(m.context);
  }
  parts.prior_share_limit = domain_limit(*bias);
  options.kernel = bias->state().kernel;
  options.progress = [&](double share) { return progress(0.6 + 0.4 * share); };
  return add_rotation_bias(parts, batch, problem, options);
}

/// What to take the arm's temperature for where a request does not say it.
void record_temperature(CompensatedModel::Parts& parts, const MeasurementBatch& trained) {
  std::vector<double> known;
  for (const Measurement& m : trained.measurements) {
    if (m.context.temperature) known.push_back(*m.context.temperature);
  }
  parts.temperature_mean.reset();
  if (known.empty()) return;
  const Eigen::Map<const Eigen::ArrayXd> t(known.data(), static_cast<Eigen::Index>(known.size()));
  parts.temperature_mean = t.mean();
  parts.temperature_stddev = std::sqrt((t - t.mean()).square().mean());
}

/// The joints' ranges where the model was trained.
void record_domain(CompensatedModel::Parts& parts, const MeasurementBatch& trained) {
  parts.q_min = parts.q_max = trained.measurements.front().context.q;
  for (const Measurement& m : trained.measurements) {
    parts.q_min = parts.q_min.cwiseMin(m.context.q);
    parts.q_max = parts.q_max.cwiseMax(m.context.q);
  }
}

/// When it was trained, and from how new measurements: those of the model that it starts from count, too.
void record_stamp(CompensatedModel::Parts& parts, const MeasurementBatch& batch, const TrainOptions& options) {
  parts.provenance.trained_at = options.trained_at;
  parts.provenance.measured_at = std::max(parts.provenance.measured_at, batch.measured_at);
  parts.provenance.program_version = kProgramVersion;
}

/// Where the model was trained, and from what: `trained` are the rows of `batch` that were not held out.
void record_training(CompensatedModel::Parts& parts, const MeasurementBatch& batch, const MeasurementBatch& trained,
                     const TrainOptions& options) {
  record_domain(parts, trained);
  for (const Measurement& m : trained.measurements) parts.trained_with.emplace(m.context.tool, m.context.payload);
  record_temperature(parts, trained);
  parts.provenance.level.clear();
  for (const ErrorSourcePtr& source : parts.physics.sources) {
    parts.provenance.level += (parts.provenance.level.empty() ? "" : ",") + source->name();
  }
  parts.provenance.batch_id = batch.id;
  parts.provenance.batch_hash = batch_hash(batch);
  parts.provenance.training_poses = static_cast<int>(trained.measurements.size());
  parts.provenance.seed = options.seed;
  record_stamp(parts, batch, options);
}

/// The model with its figures on the poses it was trained on and on those held out.
Result<CompensatedModel> validated(CompensatedModel::Parts parts, const BatchSplit& split) {
  const Result<CompensatedModel> bare = CompensatedModel::make(parts);
  if (!bare) return bare;
  parts.training = bare->evaluate(split.train);
  parts.validation.reset();
  if (!split.validation.measurements.empty()) parts.validation = bare->evaluate(split.validation);
  return CompensatedModel::make(std::move(parts));
}

/// Says what is being done; false: give up.
using Report = std::function<bool(const std::string& stage, double share)>;

/// A bias learned anew for a model whose named sources were, too: its poses become the domain. Where there is none to
/// take, the domain of the physics stays.
Status add_bias_anew(Refitted& refitted, const std::string& kernel, const TrainOptions& options, const Report& report) {
  CompensatedModel::Parts& parts = refitted.parts;
  const LeftOut left_out(refitted.found, refitted.poses);
  const JointVector slope = extrapolation_slope(left_out, parts.physics.cell->robot);
  const JointVector slope_before = parts.extrapolation_slope;
  parts.extrapolation_slope = slope;
  const Status learned = add_bias(parts, refitted.poses, kernel, left_out, options.seed,
                                  [&](double share) { return report("learning the bias", 0.3 + 0.6 * share); });
  if (!learned) return learned;
  if (parts.bias) {
    record_domain(parts, refitted.poses);
  } else if (slope_before.size() > 0) {
    parts.extrapolation_slope = slope.cwiseMax(slope_before);
  }
  return {};
}

/// train() from another model.
Result<CompensatedModel> train_from(const CompensatedModel& from, const std::shared_ptr<const Cell>& cell,
                                    const MeasurementBatch& batch, const BatchSplit& split, const TrainOptions& options,
                                    const Report& report) {
  Result<Refitted> refit = refitted(from, cell, batch, split.train, options.refit);
  if (!refit) return tl::make_unexpected(refit.error());
  if (options.bias) {
    if (const Status learned = add_bias_anew(*refit, *options.bias, options, report); !learned)
      return tl::make_unexpected(learned.error());
  }
  if (!report("validating", 0.9)) return tl::make_unexpected(given_up());
  record_stamp(refit->parts, batch, options);
  return validated(std::move(refit->parts), split);
}

}  // namespace

BiasProblem leftover(const PhysicalModel& physics, const MeasurementBatch& batch) {
  const auto n = static_cast<Eigen::Index>(batch.measurements.size());
  BiasProblem problem{Eigen::MatrixXd(n, physics.cell->robot.size()), Eigen::MatrixXd(n, 3), Eigen::VectorXd(n)};
  const Matrix3 R_BW = physics.X_WB.linear().transpose();
  for (Eigen::Index i = 0; i < n; ++i) {
    const Measurement& m = batch.measurements[static_cast<std::size_t>(i)];
    problem.q.row(i) = m.context.q.transpose();
    problem.residual_B.row(i) = (R_BW * (m.p_W - physics.pose_W(m.context).translation())).transpose();
    problem.sigma(i) = m.sigma.value_or(physics.cell->tracker.sigma);
  }
  return problem;
}

Result<CompensatedModel> train(std::shared_ptr<const Cell> cell, const MeasurementBatch& batch,
                               const TrainOptions& options) {
  const Report report = [&](const std::string& stage, double share) {
    return !options.progress || options.progress(stage, share);
  };
  const Result<MeasurementBatch> checked = check_against_cell(batch, *cell);
  if (!checked) return tl::make_unexpected(checked.error());
  if (options.from) {
    const Status fits = check_may_start_from(*options.from, *cell, *checked, options.refit);
    if (!fits) return tl::make_unexpected(fits.error());
  }
  const Status oriented =
      check_orientations(*checked, options.from ? with_known_tools(*cell, *options.from, options.refit) : *cell);
  if (!oriented) return tl::make_unexpected(oriented.error());
  const BatchSplit split = prepared(*checked, cell->tracker.sigma, options);
  if (split.train.measurements.empty()) return refused("no rows to train on").in("batch " + batch.id).beyond(0, 1);

  if (!report("calibrating", 0.0)) return tl::make_unexpected(given_up());
  if (options.from) {
    Result<CompensatedModel> model = train_from(*options.from, cell, batch, split, options, report);
    if (model && !report("done", 1.0)) return tl::make_unexpected(given_up());
    return model;
  }
  Result<CalibrationResult> calibration = identify(cell, split.train, options);
  if (!calibration) return tl::make_unexpected(calibration.error());
  CompensatedModel::Parts parts;
  const LeftOut left_out(*calibration, split.train);
  parts.extrapolation_slope = extrapolation_slope(left_out, cell->robot);
  parts.physics = std::move(calibration->model);
  parts.parameters = std::move(calibration->parameters);
  parts.unidentifiable = std::move(calibration->unidentifiable);
  parts.covariance = std::move(calibration->covariance);
  parts.rank = calibration->rank;
  parts.condition_number = calibration->condition_number;
  parts.observability_index = calibration->observability_index;
  parts.suspects = std::move(calibration->suspects);
  parts.cost_record = std::move(calibration->cost_record);
  parts.discrepancy = calibration->discrepancy;

  const Status learned = add_bias(parts, split.train, options.bias.value_or(cell->model.bias), left_out, options.seed,
                                  [&](double share) { return report("learning the bias", 0.3 + 0.6 * share); });
  if (!learned) return tl::make_unexpected(learned.error());

  if (!report("validating", 0.9)) return tl::make_unexpected(given_up());
  record_training(parts, batch, split.train, options);
  Result<CompensatedModel> model = validated(std::move(parts), split);
  if (model && !report("done", 1.0)) return tl::make_unexpected(given_up());
  return model;
}

Result<CompensatedModel> learn_bias(const CompensatedModel& calibrated, const MeasurementBatch& batch,
                                    const TrainOptions& options) {
  const Cell& cell = calibrated.cell();
  const Result<MeasurementBatch> checked = check_against_cell(batch, cell);
  if (!checked) return tl::make_unexpected(checked.error());
  if (checked->measurements.empty()) return refused("no rows to train on").in("batch " + batch.id).beyond(0, 1);
  if (const Status oriented = check_orientations(*checked, cell); !oriented)
    return tl::make_unexpected(oriented.error());
  CompensatedModel::Parts parts = calibrated.parts();
  if (calibrated.provenance().batch_hash != batch_hash(batch)) parts.suspects.clear();  // of other poses
  CalibrationResult as_it_is;
  as_it_is.model = parts.physics;
  as_it_is.covariance = Eigen::MatrixXd::Zero(parts.covariance.rows(), parts.covariance.cols());
  as_it_is.suspects = parts.suspects;
  const LeftOut left_out(as_it_is, *checked);
  parts.extrapolation_slope = extrapolation_slope(left_out, cell.robot);
  const Status learned =
      add_bias(parts, *checked, options.bias.value_or(cell.model.bias), left_out, options.seed,
               [&](double share) { return !options.progress || options.progress("learning the bias", share); });
  if (!learned) return tl::make_unexpected(learned.error());
  record_training(parts, batch, *checked, options);
  return validated(std::move(parts), {*checked, {}});
}

}  // namespace trammel
