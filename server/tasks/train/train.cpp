#include "server/tasks/train/train.h"

#include <algorithm>
#include <cmath>

#include "server/calibrate/agreement.h"
#include "server/calibrate/batch_check.h"
#include "server/calibrate/calibrate_with_maps.h"
#include "server/calibrate/causes/choose_causes.h"
#include "server/calibrate/frames/frames.h"
#include "server/calibrate/identify_sessions.h"
#include "server/calibrate/orientation_check.h"
#include "server/compensate/budget/error_budget.h"
#include "server/compensate/hidden_error.h"
#include "server/compensate/world.h"
#include "server/measurement/gauges.h"
#include "server/measurement/repeats.h"
#include "server/measurement/sessions.h"
#include "server/measurement/split.h"
#include "server/tasks/train/among_twins.h"
#include "server/tasks/train/bias_learning.h"
#include "server/tasks/train/drawing_doubted.h"
#include "server/tasks/train/extrapolation.h"
#include "server/tasks/train/given_up.h"
#include "server/tasks/train/left_out.h"
#include "server/tasks/train/refitted.h"
#include "server/tasks/train/train_sessions.h"

namespace trammel {

namespace {

constexpr const char* kProgramVersion = "0.1.0";
constexpr const char* kNoBias = "none";
constexpr const char* kNoBiasOfGauges =
    "no bias: one is learned from positions, and the batch has distances or touches";

/// The rows to learn from, repeats merged, and those to validate by, as they were measured.
BatchSplit prepared(const CheckedBatch& batch, double sigma) {
  return {merge_repeats(batch.training(), sigma).batch, batch.held_out()};
}

/// The request: the sources to identify, or those to keep while the data choose the others.
struct Asked {
  std::vector<std::string> sources;
  bool chosen_by_data = false;
};

Result<Asked> asked_of(const Cell& cell, const TrainOptions& options) {
  Asked asked;
  if (options.level) {
    asked.sources = TRY(parse_level(*options.level));
    asked.chosen_by_data = std::erase(asked.sources, kAutoSources) > 0;
  } else {
    asked = {cell.model.beside_auto.value_or(cell.model.error_sources),
             cell.model.beside_auto.has_value()};
  }
  return asked;
}

/// Reports the current step. Returns false to give up.
using Report = std::function<bool(const std::string& stage, double share)>;

/// The share of a training after which each of its parts is done, by their times.
struct PartsDone {
  double choice, physics, bias;
};
constexpr PartsDone kPhysicsKnown = {0, 0.3, 0.9}, kPhysicsChosen = {0.1, 0.75, 0.9};

/// The sources to identify from these rows; what was chosen goes into `choice`. Distances and
/// touches do not choose: with them the usual sources are identified.
Result<std::vector<std::string>> sources_of(const std::shared_ptr<const Cell>& cell,
                                            const MeasurementBatch& rows,
                                            const TrainOptions& options, const Report& report,
                                            std::optional<CauseChoice>& choice) {
  Asked asked = TRY(asked_of(*cell, options));
  if (!asked.chosen_by_data) return with_unknown_tool(std::move(asked.sources), *cell);
  if (has_gauges(rows)) return with_unknown_tool(cell->model.error_sources, *cell);
  if (!report("choosing causes", 0)) return given_up();
  ChosenCauses chosen = TRY(choose_causes(cell, asked.sources, rows, [&](double share) -> Status {
    if (!report("choosing causes", kPhysicsChosen.choice * share)) return given_up();
    return {};
  }));
  choice = std::move(chosen.choice);
  return std::move(chosen.sources);
}

/// The shares of a training that starts from the measurements alone.
PartsDone parts_done(const Cell& cell, const TrainOptions& options) {
  const Result<Asked> asked = asked_of(cell, options);
  return asked && asked->chosen_by_data ? kPhysicsChosen : kPhysicsKnown;
}

/// Records what to take the arm's temperature for where a request does not say it.
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

/// Records where the model was trained: the ranges of the joints, and the other limits of its
/// stated accuracy.
void record_domain(CompensatedModel::Parts& parts, const MeasurementBatch& trained) {
  parts.measured = what_was_measured(parts.physics, trained);
  parts.q_min = parts.q_max = trained.measurements.front().context.q;
  for (const Measurement& m : trained.measurements) {
    parts.q_min = parts.q_min.cwiseMin(m.context.q);
    parts.q_max = parts.q_max.cwiseMax(m.context.q);
  }
}

/// Records when the model was trained, and the age of its newest measurement, including those of
/// the model that it started from.
void record_stamp(CompensatedModel::Parts& parts, const CheckedBatch& batch,
                  const TrainOptions& options) {
  parts.provenance.trained_at = options.trained_at;
  parts.provenance.measured_at = std::max(parts.provenance.measured_at, batch.rows().measured_at);
  parts.provenance.program_version = kProgramVersion;
}

/// Records the place and the data of the training: `trained` are the rows of `batch` that were not
/// held out.
void record_training(CompensatedModel::Parts& parts, const CheckedBatch& batch,
                     const MeasurementBatch& trained, const TrainOptions& options) {
  record_domain(parts, trained);
  add_what_is_stated(parts.physics, batch.rows(), *parts.measured);
  parts.measured->off_drawing = drawing_doubted(parts.physics, trained);
  for (const Measurement& m : trained.measurements)
    parts.trained_with.emplace(m.context.tool, m.context.payload);
  record_temperature(parts, trained);
  parts.provenance.level.clear();
  for (const ErrorSourcePtr& source : parts.physics.sources) {
    parts.provenance.level += (parts.provenance.level.empty() ? "" : ",") + source->name();
  }
  parts.provenance.batch_id = batch.id();
  parts.provenance.batch_hash = batch.hash();
  parts.provenance.training_poses = static_cast<int>(trained.measurements.size());
  parts.provenance.seed = options.seed;
  record_stamp(parts, batch, options);
}

/// Adds the model's figures on the poses that it was trained on.
Status add_training_figures(CompensatedModel::Parts& parts, const MeasurementBatch& train) {
  const CompensatedModel bare = TRY(CompensatedModel::make(parts));
  parts.training = bare.evaluate(train);
  return {};
}

/// The model with its figures on the poses it was trained on and on those held out.
Result<CompensatedModel> validated(CompensatedModel::Parts parts, const BatchSplit& split,
                                   const Report& report) {
  const auto go_on = [&](double share) -> Status {
    if (!report("validating", std::lerp(kPhysicsKnown.bias, 1.0, share))) return given_up();
    return {};
  };
  TRY(go_on(0));
  TRY(add_training_figures(parts, split.train));
  TRY(go_on(0.4));
  Result<CompensatedModel> bare = CompensatedModel::make(parts);
  if (!bare) return bare;
  if (const double hidden = hidden_by_sigma(*bare); hidden > parts.discrepancy) {
    parts.discrepancy = hidden;
    TRY(add_training_figures(parts, split.train));
    bare = CompensatedModel::make(parts);
    if (!bare) return bare;
  }
  TRY(go_on(0.6));
  parts.budget.reset();
  if (tells_a_budget(split.train)) parts.budget = error_budget(*bare, split.train);
  TRY(go_on(0.8));
  parts.validation.reset();
  if (!split.validation.measurements.empty()) parts.validation = bare->evaluate(split.validation);
  return CompensatedModel::make(std::move(parts));
}

/// A bias learned anew for a model whose named sources were, too: its poses become the domain.
/// Where there is none to take, the domain of the physics stays.
Status add_bias_anew(Refitted& refitted, const std::string& kernel, const TrainOptions& options,
                     const Report& report) {
  CompensatedModel::Parts& parts = refitted.parts;
  const LeftOut left_out(refitted.found, refitted.poses);
  const JointVector slope = extrapolation_slope(left_out, parts.physics.cell->robot);
  const JointVector slope_before = parts.extrapolation_slope;
  parts.extrapolation_slope = slope;
  const Status learned =
      add_bias(parts, refitted.poses, kernel, left_out, options.seed, [&](double share) {
        const auto [choice, physics, bias] = kPhysicsKnown;
        return report("learning the bias", std::lerp(physics, bias, share));
      });
  if (!learned) return learned;
  if (parts.bias) {
    record_domain(parts, refitted.poses);
  } else if (slope_before.size() > 0) {
    parts.extrapolation_slope = slope.cwiseMax(slope_before);
  }
  return {};
}

/// train() from another model.
Result<CompensatedModel> train_from(const CompensatedModel& from,
                                    const std::shared_ptr<const Cell>& cell,
                                    const CheckedBatch& batch, BatchSplit split,
                                    const TrainOptions& options, const Report& report) {
  std::vector<LeftOutSession> unplaced = leave_out_unplaced(split);
  for (MeasurementBatch* rows : {&split.train, &split.validation}) {
    if (!has_sessions(*rows)) continue;
    InWorld placed = TRY(in_world_of(from, *rows));
    *rows = std::move(placed.batch);
  }
  Refitted refit = TRY(refitted(from, cell, batch, split.train, options.refit));
  if (options.bias) {
    TRY(add_bias_anew(refit, *options.bias, options, report));
  }
  refit.parts.sessions_left_out = std::move(unplaced);
  record_stamp(refit.parts, batch, options);
  return validated(std::move(refit.parts), split, report);
}

/// Parts of a calibrated model; the slope is that of its physics.
CompensatedModel::Parts calibrated_parts(CalibrationResult calibration, const LeftOut& left_out) {
  CompensatedModel::Parts parts;
  parts.extrapolation_slope = extrapolation_slope(left_out, calibration.model.cell->robot);
  parts.physics = std::move(calibration.model);
  parts.parameters = std::move(calibration.parameters);
  parts.unidentifiable = std::move(calibration.unidentifiable);
  parts.covariance = std::move(calibration.covariance);
  parts.rank = calibration.rank;
  parts.condition_number = calibration.condition_number;
  parts.observability_index = calibration.observability_index;
  parts.suspects = std::move(calibration.suspects);
  parts.sessions = std::move(calibration.sessions);
  parts.cost_record = std::move(calibration.cost_record);
  parts.discrepancy = calibration.discrepancy;
  return parts;
}

/// The physics by all rows of `batch`, and the changes between its sessions.
Result<IdentifiedSessions> identified_on(const MeasurementBatch& batch,
                                         const std::shared_ptr<const Cell>& cell,
                                         const std::vector<std::string>& sources,
                                         const TrainOptions& options, const Report& report) {
  const Identify identify = [&](const std::vector<std::string>& names) {
    return options.fleet
               ? calibrate_among_twins(cell, names, batch, *options.fleet)
               : calibrate_with_maps(cell, names, batch, {.held = {}, .weigh_links = true});
  };
  return identify_sessions(identify, sources, batch, [&](double share) -> Status {
    const PartsDone done = parts_done(*cell, options);
    const double now = std::lerp(done.choice, done.physics, share);
    if (!report("asking what changed between the sessions", now)) return given_up();
    return {};
  });
}

/// `plain` identified anew without the rows that fit no arm on which the others agree. They leave
/// `batch` and become suspects.
Result<IdentifiedSessions> identified_by_most(Result<IdentifiedSessions> plain,
                                              MeasurementBatch& batch,
                                              const std::shared_ptr<const Cell>& cell,
                                              const std::vector<std::string>& sources,
                                              const TrainOptions& options, const Report& report) {
  const auto calibration = plain.map([](const IdentifiedSessions& all) { return all.calibration; });
  std::optional<Agreement> agreement = agreement_of(cell, sources, batch, calibration);
  if (!agreement) return plain;
  Result<IdentifiedSessions> found =
      identified_on(agreement->agreeing, cell, sources, options, report);
  if (!found) return plain;
  add_suspects(agreement->others, found->calibration);
  batch = std::move(agreement->agreeing);
  return found;
}

/// The physics, identified anew; `split` comes into its world.
Result<IdentifiedSessions> identified(const std::shared_ptr<const Cell>& cell, BatchSplit& split,
                                      const TrainOptions& options, const Report& report,
                                      std::optional<CauseChoice>& choice) {
  const std::vector<std::string> sources =
      TRY(sources_of(cell, split.train, options, report, choice));
  if (!report("calibrating", parts_done(*cell, options).choice)) return given_up();
  auto found = identified_by_most(identified_on(split.train, cell, sources, options, report),
                                  split.train, cell, sources, options, report);
  if (!found) return found;
  split.train = aligned(std::move(split.train), found->calibration.sessions, cell->tracker);
  split.validation =
      aligned(std::move(split.validation), found->calibration.sessions, cell->tracker);
  return found;
}

/// train() from the measurements alone.
Result<CompensatedModel> train_anew(const std::shared_ptr<const Cell>& cell,
                                    const CheckedBatch& batch, BatchSplit split,
                                    const TrainOptions& options, const Report& report) {
  std::vector<LeftOutSession> unplaced = leave_out_unplaced(split);
  std::optional<CauseChoice> choice;
  IdentifiedSessions found = TRY(identified(cell, split, options, report, choice));
  const LeftOut left_out(found.calibration, split.train);
  CompensatedModel::Parts parts = calibrated_parts(std::move(found.calibration), left_out);
  parts.changes = std::move(found.changes);
  parts.cause_choice = std::move(choice);
  parts.sessions_as_given = !parts.sessions.empty() && !batch.rows().clock;
  parts.sessions_left_out = std::move(unplaced);
  const std::string asked = options.bias.value_or(cell->model.bias);
  const bool no_choice = asked == kAutoBias && has_gauges(batch.rows());
  TRY(add_bias(parts, split.train, no_choice ? kNoBias : asked, left_out, options.seed,
               [&, done = parts_done(*cell, options)](double share) {
                 return report("learning the bias", std::lerp(done.physics, done.bias, share));
               }));
  if (no_choice) parts.bias_choice = BiasChoice{kNoBias, {}, kNoBiasOfGauges};
  record_training(parts, batch, split.train, options);
  return validated(std::move(parts), split, report);
}

/// Refuses features that do not work with gauges: a bias, since a kernel learns position errors of
/// three numbers per pose; several set-ups; and the prior from twins.
Status check_gauges(const MeasurementBatch& batch, const Cell& cell, const TrainOptions& options) {
  if (!has_gauges(batch)) return {};
  if (has_sessions(batch))
    return require_positions(batch, "a training from several set-ups of the instrument");
  if (options.fleet) return require_positions(batch, "a training with prior: fleet");
  const std::string& bias = options.bias ? *options.bias : cell.model.bias;
  if (bias == kNoBias || bias == kAutoBias) return {};
  return refused("a bias ({}) is learned from positions, and the batch has distances or touches",
                 bias)
      .in("batch " + batch.id)
      .of("distance_mm")
      .with_text(bias)
      .next(
          "train with --bias none (model: {bias: none} in the cell file): the physics is "
          "identified from all rows");
}

/// Refuses a batch that was read wrongly. A model to start from may have another tool than the cell
/// file.
Status check_read(const MeasurementBatch& batch, const Cell& cell, const TrainOptions& options) {
  const Cell known = options.from ? with_known_tools(cell, *options.from, options.refit) : cell;
  if (options.looked_at) return check_orientations(batch, known);
  if (!options.from) return check_batch(batch, known);
  auto doubt = reading_doubt(batch, known);
  if (!doubt) return {};
  return Failure(std::move(*doubt)).in("batch " + batch.id);
}

}  // namespace

Result<CompensatedModel> train(std::shared_ptr<const Cell> cell, const CheckedBatch& batch,
                               const TrainOptions& options) {
  const Report report = [&](const std::string& stage, double share) {
    return !options.progress || options.progress(stage, share);
  };
  if (options.from) {
    TRY(check_may_start_from(*options.from, *cell, batch.rows(), options.refit));
  }
  TRY(check_gauges(batch.rows(), *cell, options));
  TRY(check_read(batch.rows(), *cell, options));
  const BatchSplit split = prepared(batch, cell->tracker.sigma);
  if (split.train.measurements.empty())
    return refused("no rows to train on").in("batch " + batch.id()).beyond(0, 1);

  if (!report("calibrating", 0.0)) return given_up();
  Result<CompensatedModel> model =
      options.from ? train_from(*options.from, cell, batch, split, options, report)
                   : train_anew(cell, batch, split, options, report);
  if (model && !report("done", 1.0)) return given_up();
  return model;
}

Result<CompensatedModel> learn_bias(const CompensatedModel& calibrated, const CheckedBatch& batch,
                                    const TrainOptions& options) {
  const Cell& cell = calibrated.cell();
  TRY(require_positions(batch.rows(), "a bias"));
  TRY(check_orientations(batch.rows(), cell));
  const InWorld here = TRY(in_world_of(calibrated, batch.rows()));
  const MeasurementBatch& rows = here.batch;
  CompensatedModel::Parts parts = calibrated.parts();
  // Suspects of other poses
  if (calibrated.provenance().batch_hash != batch.hash()) parts.suspects.clear();
  CalibrationResult as_it_is;
  as_it_is.model = parts.physics;
  as_it_is.covariance = Eigen::MatrixXd::Zero(parts.covariance.rows(), parts.covariance.cols());
  as_it_is.suspects = parts.suspects;
  const LeftOut left_out(as_it_is, rows);
  parts.extrapolation_slope = extrapolation_slope(left_out, cell.robot);
  TRY(add_bias(parts, rows, options.bias.value_or(cell.model.bias), left_out, options.seed,
               [&](double share) {
                 return !options.progress ||
                        options.progress("learning the bias", kPhysicsKnown.bias * share);
               }));
  record_training(parts, batch, rows, options);
  return validated(std::move(parts), {rows, {}}, [&](const std::string& stage, double share) {
    return !options.progress || options.progress(stage, share);
  });
}

}  // namespace trammel
