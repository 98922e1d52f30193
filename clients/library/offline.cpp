#include "clients/library/trammel/offline.h"

#include <algorithm>
#include <map>
#include <tuple>

#include "clients/library/convert.h"
#include "clients/library/inside.h"
#include "server/base/coverage.h"
#include "server/base/shown_value.h"
#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/base/unix_time.h"
#include "server/compensate/budget/budget_words.h"
#include "server/compensate/exchanged.h"
#include "server/compensate/known_rows.h"
#include "server/compensate/model_file.h"
#include "server/compensate/model_notes.h"
#include "server/compensate/model_spec.h"
#include "server/compensate/world.h"
#include "server/diagnose/diagnose.h"
#include "server/measurement/checked_batch.h"
#include "server/measurement/files/batch_file.h"
#include "server/measurement/gauges.h"
#include "server/measurement/pose_check.h"
#include "server/measurement/pose_columns.h"
#include "server/plan/plan.h"
#include "server/report/budget_json.h"
#include "server/report/diagnosis_json.h"
#include "server/report/health_json.h"
#include "server/report/history.h"
#include "server/report/model_page.h"
#include "server/robot/inverse_kinematics.h"
#include "server/simulate/simulate.h"
#include "server/tasks/check/check.h"
#include "server/tasks/train/extend.h"
#include "server/tasks/train/first_batch.h"
#include "server/tasks/train/told_by_training.h"
#include "server/tasks/train/train.h"

namespace trammel::api {

using exchange::mm_from_si;
using library::from_api;
using library::passed_on;
using library::to_api;

namespace {

constexpr std::size_t kPosesTogether = 256;  // poses that a model predicts at once
constexpr double kLargestShare = 0.9;        // largest share of rows to hold out

trammel::Status check_share(double share) {
  if (share >= 0 && share <= kLargestShare) return {};
  return failure(trammel::ErrorCode::kUsage, "validation_share is {}, limits 0 and {}", share,
                 kLargestShare)
      .of("validation_share")
      .beyond(share, kLargestShare);
}

/// Batches made ready for a cell. Each is a session of its own, or has the sessions of its column.
/// Two with one name get numbers.
trammel::Result<CheckedBatch> checked(std::span<const Batch> batches, const trammel::Cell& cell,
                                      const HoldOut& hold_out) {
  if (batches.empty())
    return failure(trammel::ErrorCode::kUsage, "no batch, at least 1 is needed").of("batches");
  std::map<std::string, int> met;
  std::vector<CheckedBatch> all;
  for (const Batch& batch : batches) {
    MeasurementBatch rows = batch.inside().rows;
    if (const int count = ++met[rows.id]; count > 1) rows.id += fmt::format("-{}", count);
    trammel::Result<CheckedBatch> one = check_against_cell(std::move(rows), cell, hold_out);
    if (!one) return one;
    all.push_back(std::move(*one));
  }
  return joined(std::move(all));
}

/// The cell, unless its own model could not be trained.
trammel::Status trainable(const Cell& cell, SpecUse use) {
  std::vector<trammel::Error> problems =
      check_model_spec(*cell.inside().cell, cell.inside().where, use);
  if (!problems.empty()) return tl::make_unexpected(together(std::move(problems)));
  return {};
}

Figures figures_from(const ErrorFigures& f) {
  return {to_mm(f.rms), to_mm(f.mean),           to_mm(f.p997),
          to_mm(f.max), mm_from_si(f.axis_mean), mm_from_si(f.axis_stddev)};
}

Evaluation evaluation_of(const trammel::Evaluation& e) {
  Evaluation out{e.poses,
                 e.in_domain,
                 e.coverage_95,
                 figures_from(e.nominal),
                 figures_from(e.calibrated),
                 figures_from(e.compensated),
                 {},
                 {},
                 doubt_of_bias(e).value_or(""),
                 0,
                 e.coverage_95_stated};
  if (e.nlpd) out.nlpd = nlpd_in_mm(*e.nlpd);
  if (const auto& o = e.orientation) {
    out.orientation = OrientationErrors{o->poses, to_deg(o->nominal), to_deg(o->calibrated),
                                        to_deg(o->compensated), o->coverage_95};
  }
  return out;
}

/// A target in the model's form. Refuses the same as a file of targets.
trammel::Result<trammel::Target> target_from(const Target& asked, const Context& context,
                                             const Chain& robot) {
  trammel::Target target;
  target.direction = context.directions;
  target.temperature = context.temperature_c;
  target.joint_target = !asked.pose;
  if (!asked.joints_deg.empty() || target.joint_target) {
    trammel::Result<JointVector> seed = library::joints_from_api(asked.joints_deg, robot);
    if (!seed) return tl::make_unexpected(seed.error());
    target.seed = std::move(*seed);
  }
  if (target.joint_target) return target;
  const trammel::Result<trammel::Pose> X_BT = from_api(*asked.pose);
  if (!X_BT) return tl::make_unexpected(X_BT.error());
  target.X_BT = *X_BT;
  if (!asked.conf && !target.seed)
    return refused("neither conf nor joints near the wanted branch").of("conf");
  if (!asked.conf) return target;
  if (*asked.conf < 0 || *asked.conf > 7)
    return refused("conf is {}, limits 0 and 7", *asked.conf).of("conf").beyond(*asked.conf, 7);
  if (!has_spherical_wrist(robot)) {
    return refused("conf is {}, but robot {} has no spherical wrist to number branches by",
                   *asked.conf, robot.name())
        .of("conf")
        .with_value(*asked.conf)
        .next("give joints_deg");
  }
  target.conf = asked.conf;
  return target;
}

/// From a parameter's own number to the unit that people read: mm and deg.
double scale_for_people(const trammel::Parameter& parameter) {
  return parameter.scale * reading_of(parameter.unit).scale;
}

/// The ids that a model is asked with.
trammel::Result<Context> known_context(const CompensatedModel& model, Context context) {
  TRY(library::check_context(context, model.cell().robot));
  auto tool = TRY(resolve_tool(model.cell(), context.tool));
  auto payload = TRY(resolve_payload(model.cell(), context.payload));
  TRY(model.check_trained_with(tool, payload));
  context.tool = std::move(tool);
  context.payload = std::move(payload);
  return context;
}

trammel::Result<std::vector<PoseContext>> contexts(std::span<const double> joints_deg,
                                                   const Context& context,
                                                   const trammel::Cell& cell) {
  auto all = TRY(library::all_joints_from_api(joints_deg, cell.robot));
  std::vector<PoseContext> poses(all.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    PoseContext& pose = poses[i];
    pose.q = std::move(all[i]);
    pose.direction = context.directions;
    pose.temperature = context.temperature_c;
    pose.tool = context.tool;
    pose.payload = context.payload;
    pose.served = true;
    if (const auto fits = check_pose(pose, cell); !fits)
      return Failure(fits.error()).at_row(static_cast<long>(i)).of("joints_deg");
  }
  return poses;
}

bool goes_on(const Progress& progress, const std::string& stage, double share) {
  return !progress || progress(stage, share);
}

}  // namespace

Result<Cell> Cell::load(const std::string& path) {
  auto cell = read_cell(path);
  if (!cell) return passed_on(cell);
  return Cell(std::make_shared<const Inside>(
      Inside{std::make_shared<const trammel::Cell>(std::move(*cell)), path}));
}
std::string Cell::name() const { return inside_->cell->name; }
std::string Cell::robot() const { return inside_->cell->robot.name(); }
std::size_t Cell::joints() const { return static_cast<std::size_t>(inside_->cell->robot.size()); }
std::vector<std::string> Cell::joint_columns() const {
  std::vector<std::string> names;
  for (const JointType type : joint_types(inside_->cell->robot))
    names.push_back(joint_column(static_cast<int>(names.size()), type));
  return names;
}
std::vector<std::string> Cell::tools() const {
  std::vector<std::string> ids;
  for (const auto& [id, tool] : inside_->cell->tools) ids.push_back(id);
  return ids;
}
Result<std::vector<Pose>> Cell::tool_poses(std::span<const double> joints_deg,
                                           const std::string& tool) const {
  const trammel::Cell& cell = *inside_->cell;
  trammel::Pose X_FT = trammel::Pose::Identity();
  if (tool != "flange") {
    const auto known = resolve_tool(cell, tool);
    if (!known) return passed_on(known);
    const std::optional<trammel::Pose>& place = cell.tools.at(*known);
    if (!place)
      return tl::make_unexpected(
          to_api(refused("where tool {} sits is not in the cell file", *known)
                     .of("tool")
                     .next("ask for tool flange, or give its pose")
                     .value()));
    X_FT = *place;
  }
  const auto all = library::all_joints_from_api(joints_deg, cell.robot);
  if (!all) return passed_on(all);
  std::vector<Pose> poses;
  for (const JointVector& q : *all)
    poses.push_back(exchange::from_si(cell.robot.flange_pose(q) * X_FT));
  return poses;
}

std::vector<std::string> Cell::payloads() const {
  std::vector<std::string> ids;
  for (const auto& [id, payload] : inside_->cell->payloads) ids.push_back(id);
  return ids;
}

Result<Batch> Batch::load(const std::string& path) {
  auto rows = read_batch(path);
  if (!rows) return passed_on(rows);
  return Batch(std::make_shared<const Inside>(Inside{std::move(*rows)}));
}
Result<Batch> Batch::parse(const std::string& csv, const std::string& name) {
  auto rows = parse_batch(csv, name);
  if (!rows) return passed_on(rows);
  rows->id = name;
  return Batch(std::make_shared<const Inside>(Inside{std::move(*rows)}));
}
std::string Batch::name() const { return inside_->rows.id; }
std::size_t Batch::size() const { return inside_->rows.measurements.size(); }
std::string Batch::table() const { return to_csv(inside_->rows); }
std::string Batch::csv() const {
  const MeasurementBatch& rows = inside_->rows;
  return rows.source_text.empty() ? to_csv(rows) : rows.source_text;
}

Result<Model> Model::load(const std::string& path) {
  auto model = load_model(path);
  if (!model) return passed_on(model);
  return Model(std::make_shared<const Inside>(Inside{std::move(*model)}));
}
Result<Model> Model::parse(const std::string& text, const std::string& where) {
  auto model = deserialize(text, where);
  if (!model) return passed_on(model);
  return Model(std::make_shared<const Inside>(Inside{std::move(*model)}));
}
Status Model::save(const std::string& path) const {
  const auto written = write_text_file(path, serialize(inside_->model));
  if (!written) return passed_on(written);
  return {};
}

std::string Model::text() const { return serialize(inside_->model); }

ModelFacts Model::facts() const {
  const ModelProvenance& from = inside_->model.provenance();
  const auto& budget = inside_->model.parts().budget;
  return {from.id,
          from.hash,
          inside_->model.cell().name,
          from.level,
          from.batch_id,
          from.training_poses,
          0,
          false,
          notes(),
          budget ? in_words(*budget) : std::vector<std::string>()};
}
Cell Model::cell() const {
  const auto& cell = inside_->model.parts().physics.cell;
  return Cell(std::make_shared<const Cell::Inside>(
      Cell::Inside{cell, "model " + inside_->model.provenance().id}));
}
std::string Model::bias() const {
  const auto& bias = inside_->model.parts().bias;
  return bias ? bias->kernel : "none";
}

std::vector<Parameter> Model::parameters() const {
  std::vector<Parameter> all;
  for (const IdentifiedParameter& p : inside_->model.parts().parameters) {
    const double scale = scale_for_people(p.parameter);
    all.push_back({p.parameter.name, reading_of(p.parameter.unit).unit, scale * p.value,
                   kExpanded * scale * p.stddev, p.identified});
  }
  return all;
}

std::vector<double> Model::parameter_covariance() const {
  const auto& parts = inside_->model.parts();
  std::vector<double> all;
  for (Eigen::Index i = 0; i < parts.covariance.rows(); ++i) {
    for (Eigen::Index j = 0; j < parts.covariance.cols(); ++j) {
      const auto scale = [&](Eigen::Index k) {
        return scale_for_people(parts.parameters[static_cast<std::size_t>(k)].parameter);
      };
      all.push_back(scale(i) * scale(j) * parts.covariance(i, j));
    }
  }
  return all;
}

Evaluation Model::figures() const {
  const auto& parts = inside_->model.parts();
  return evaluation_of(parts.validation.value_or(parts.training));
}

Measured Model::measured() const {
  const std::optional<WhatWasMeasured>& known = inside_->model.parts().measured;
  const trammel::Cell& cell = inside_->model.cell();
  Measured out;
  out.sentence = in_words(known, cell);
  out.instrument = words_of(known, cell).instrument;
  if (!known) return out;
  out.poses = known->poses;
  for (const auto& joint : known->approaches) {
    out.from_above.push_back(joint.falling);
    out.from_below.push_back(joint.rising);
  }
  if (known->temperature)
    std::tie(out.temperature_min_c, out.temperature_max_c) = *known->temperature;
  out.lower_mm = mm_from_si(known->lower);
  out.upper_mm = mm_from_si(known->upper);
  out.volume_m3 = known->volume;
  if (known->reach) out.reach_mm = to_mm(*known->reach);
  return out;
}

std::string Model::budget_json() const {
  const std::optional<ErrorBudget>& budget = inside_->model.parts().budget;
  return budget ? trammel::budget_json(*budget).dump() : "null";
}

std::vector<Note> Model::notes() const {
  return library::to_api(inside_->told.beside(notes_of(inside_->model)));
}

Result<std::vector<Prediction>> Model::predict(std::span<const double> joints_deg,
                                               const Context& context) const {
  const CompensatedModel& model = inside_->model;
  const auto known = known_context(model, context);
  if (!known) return passed_on(known);
  const auto poses = contexts(joints_deg, *known, model.cell());
  if (!poses) return passed_on(poses);
  std::vector<Prediction> all;
  all.reserve(poses->size());
  for (std::size_t first = 0; first < poses->size(); first += kPosesTogether) {
    const auto from = poses->begin() + static_cast<std::ptrdiff_t>(first);
    const auto count = static_cast<std::ptrdiff_t>(std::min(kPosesTogether, poses->size() - first));
    for (const ErrorPrediction& p : model.predict_all({from, from + count}))
      all.push_back(exchanged(p));
  }
  return all;
}

Result<std::vector<CorrectedTarget>> Model::correct(std::span<const Target> targets,
                                                    const Context& context) const {
  const CompensatedModel& model = inside_->model;
  const Chain& robot = model.cell().robot;
  const auto known = known_context(model, context);
  if (!known) return passed_on(known);
  std::vector<trammel::Target> wanted;
  for (const Target& target : targets) {
    auto one = target_from(target, *known, robot);
    if (!one)
      return tl::make_unexpected(
          to_api(Failure(one.error()).at_row(static_cast<long>(wanted.size())).value()));
    wanted.push_back(std::move(*one));
  }
  std::vector<CorrectedTarget> all;
  all.reserve(wanted.size());
  const exchange::Rails rails = exchange::rails_of(robot);
  for (const trammel::Target& target : wanted)
    all.push_back(exchanged(model.correct(target, known->tool, known->payload), rails));
  return all;
}

Result<Evaluation> Model::evaluate(std::span<const Batch> batches) const {
  const auto batch = checked(batches, inside_->model.cell(), drawn(0, 0));
  if (!batch) return passed_on(batch);
  const auto positions = require_positions(batch->rows(), "the library's evaluate");
  if (!positions) return passed_on(positions);
  const auto world = in_world_of(inside_->model, batch->rows());
  if (!world) return passed_on(world);
  Evaluation told = evaluation_of(inside_->model.evaluate(world->batch));
  const LearnedFrom learned(inside_->model, batch->hash());
  const auto& rows = world->batch.measurements;
  told.trained_on = static_cast<int>(std::count_if(rows.begin(), rows.end(), learned));
  return told;
}

Result<std::vector<Residual>> Model::residuals(std::span<const Batch> batches) const {
  const auto batch = checked(batches, inside_->model.cell(), drawn(0, 0));
  if (!batch) return passed_on(batch);
  const auto positions = require_positions(batch->rows(), "the library's residuals");
  if (!positions) return passed_on(positions);
  const auto world = in_world_of(inside_->model, batch->rows());
  if (!world) return passed_on(world);
  const MeasurementBatch rows = positions_of(world->batch);
  const CompensatedModel::LevelErrors errors = inside_->model.errors_B(rows);
  std::vector<Residual> all;
  for (std::size_t i = 0; i < rows.measurements.size(); ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    all.push_back({rows.measurements[i].pose_id, mm_from_si(errors.nominal.col(column)),
                   mm_from_si(errors.calibrated.col(column)),
                   mm_from_si(errors.compensated.col(column)),
                   mm_from_si(errors.stddev.col(column)), errors.in_domain[i]});
  }
  return all;
}

Result<std::string> Model::check(const Batch& batch, const CheckOptions& options) const {
  const CompensatedModel& model = inside_->model;
  const auto rows = check_against_cell(batch.inside().rows, model.cell());
  if (!rows) return passed_on(rows);
  CheckAsked asked;
  if (options.tolerance_mm) asked.tolerance = *options.tolerance_mm * from_mm(1);
  asked.new_tool = options.new_tool;
  for (const std::string& earlier : options.earlier)
    if (auto drift = drift_of(earlier)) asked.earlier.push_back(std::move(*drift));
  const auto health = check_robot(model, model.cell(), *rows, std::move(asked));
  if (!health) return passed_on(health);
  return check_json(*health, *rows, model).dump();
}

Result<std::string> Model::report(std::span<const Batch> batches) const {
  if (batches.empty()) return model_page(inside_->model, std::nullopt);
  const auto batch = checked(batches, inside_->model.cell(), drawn(0, 0));
  if (!batch) return passed_on(batch);
  const auto positions = require_positions(batch->rows(), "the library's report");
  if (!positions) return passed_on(positions);
  auto world = in_world_of(inside_->model, batch->rows());
  if (!world) return passed_on(world);
  std::erase_if(world->batch.measurements, LearnedFrom(inside_->model, batch->hash()));
  std::optional<MeasurementBatch> fresh;
  if (!world->batch.measurements.empty()) fresh = std::move(world->batch);
  return model_page(inside_->model, fresh);
}

Result<std::string> history(std::span<const Model> models) {
  CellHistory all;
  all.of_files = true;
  for (const Model& one : models) {
    const CompensatedModel& model = one.inside().model;
    if (all.cell.empty()) all.cell = model.cell().name;
    if (model.cell().name != all.cell)
      return tl::make_unexpected(
          to_api(failure(trammel::ErrorCode::kRefused,
                         "the model is of cell {}, the ones before it are of {}", model.cell().name,
                         all.cell)
                     .of("models")
                     .value()));
    all.versions.push_back(on_record(model, static_cast<int>(all.versions.size()) + 1));
  }
  return history_json(all).dump();
}

Result<Model> train(const Cell& cell, std::span<const Batch> batches, const TrainOptions& options) {
  const auto fits = trainable(cell, {.error_sources = !options.level, .bias = !options.bias});
  if (!fits) return passed_on(fits);
  if (const auto fits_too = check_share(options.validation_share); !fits_too)
    return passed_on(fits_too);
  const auto batch =
      checked(batches, *cell.inside().cell, drawn(options.validation_share, options.seed));
  if (!batch) return passed_on(batch);
  if (!options.as_read) {
    const auto first = check_first_batch(cell.inside().cell, *batch, options.level);
    if (!first) return passed_on(first);
  }
  std::vector<FleetMember> twins;
  for (const Model& twin : options.fleet)
    twins.push_back({twin.inside().model.cell().name, twin.inside().model});
  auto fleet = prior_of_twins(*cell.inside().cell, twins);
  if (!fleet) return passed_on(fleet);
  trammel::TrainOptions how;
  how.fleet = std::move(*fleet);
  how.looked_at = options.as_read;
  how.level = options.level;
  how.bias = options.bias;
  how.seed = options.seed;
  how.trained_at = unix_now();
  how.progress = [&](const std::string& stage, double share) {
    return goes_on(options.progress, stage, share);
  };
  auto model = trammel::train(cell.inside().cell, *batch, how);
  if (!model) return passed_on(model);
  ToldByTraining told = told_by_training(*model, *batch, how);
  return Model(
      std::make_shared<const Model::Inside>(Model::Inside{std::move(*model), std::move(told)}));
}

Result<std::string> diagnose(const Cell& cell, std::span<const Batch> batches,
                             const DiagnoseOptions& options) {
  const auto fits = trainable(cell, {});
  if (!fits) return passed_on(fits);
  const auto batch = checked(batches, *cell.inside().cell, drawn(0, options.seed));
  if (!batch) return passed_on(batch);
  trammel::DiagnoseOptions how;
  how.seed = options.seed;
  how.progress = [&](const std::string& stage, double share) {
    return goes_on(options.progress, stage, share);
  };
  const auto found = trammel::diagnose(cell.inside().cell, *batch, how);
  if (!found) return tl::make_unexpected(to_api(with_rows_set_aside(found.error(), *batch)));
  return diagnosis_json(*found, notes_of(*cell.inside().cell)).dump(2);
}

Result<Extension> extend(const Cell& cell, std::span<const Batch> batches,
                         const DiagnoseOptions& options) {
  const auto fits = trainable(cell, {});
  if (!fits) return passed_on(fits);
  const std::shared_ptr<const trammel::Cell>& of = cell.inside().cell;
  const auto batch = checked(batches, *of, held_out_to_extend(options.seed));
  if (!batch) return passed_on(batch);
  trammel::DiagnoseOptions how;
  how.seed = options.seed;
  how.progress = [&](const std::string& stage, double share) {
    return goes_on(options.progress, stage, kDiagnosisShare * share);
  };
  const auto found = trammel::diagnose(of, *batch, how);
  if (!found) return tl::make_unexpected(to_api(with_rows_set_aside(found.error(), *batch)));
  trammel::TrainOptions training;
  training.seed = options.seed;
  training.trained_at = unix_now();
  training.progress = [&](const std::string& stage, double share) {
    return goes_on(options.progress, stage, kDiagnosisShare + (1 - kDiagnosisShare) * share);
  };
  auto extended = applied(of, *batch, *found, training);
  if (!extended) return passed_on(extended);
  Extension told{diagnosis_json(*found, notes_of(*of)).dump(2), {}, {}, extended->why_not};
  if (!told.why_not.empty()) return told;
  told.error_sources = std::move(extended->extension->lasting);
  told.model = Model(
      std::make_shared<const Model::Inside>(Model::Inside{std::move(extended->extension->after)}));
  return told;
}

namespace {

trammel::Result<trammel::PlanOptions> plan_options(const PlanOptions& asked) {
  constexpr std::size_t kMost = 1'000'000;
  const std::string separate = "separate:";
  trammel::PlanOptions options;
  if (asked.count < 1 || asked.count > kMost) {
    return failure(trammel::ErrorCode::kUsage, "count is {}, limits 1 and {}", asked.count, kMost)
        .of("count")
        .beyond(asked.count, kMost);
  }
  options.count = static_cast<int>(asked.count);
  options.seed = asked.seed;
  options.orientation = !asked.positions_only;
  const std::size_t comma = asked.criterion.find(',');
  if (asked.criterion == "lhs") return options;
  if (asked.criterion == "observability") {
    options.criterion = PlanCriterion::kObservability;
  } else if (asked.criterion == "check") {
    options.criterion = PlanCriterion::kCheck;
  } else if (asked.criterion.starts_with(separate) && comma != std::string::npos) {
    options.criterion = PlanCriterion::kSeparation;
    options.cause = asked.criterion.substr(separate.size(), comma - separate.size());
    options.other = asked.criterion.substr(comma + 1);
  } else {
    return failure(trammel::ErrorCode::kUsage,
                   "criterion '{}': expected lhs, observability, check or separate:CAUSE,CAUSE",
                   asked.criterion)
        .of("criterion")
        .with_text(asked.criterion);
  }
  return options;
}

}  // namespace

Result<Plan> plan(const Cell& cell, const PlanOptions& options) {
  const auto how = plan_options(options);
  if (!how) return passed_on(how);
  const auto fits = trainable(cell, {.bias = false});
  if (!fits) return passed_on(fits);
  const trammel::Cell& of = *cell.inside().cell;
  const auto planned = make_plan(cell.inside().cell, *how);
  if (!planned) return passed_on(planned);
  JointList list{cell.name(), joint_types(of.robot), {}};
  Plan out;
  for (const PlannedPose& pose : planned->poses) {
    CommandedPose& commanded = list.poses.emplace_back(CommandedPose{pose.id, pose.context});
    if (of.tools.size() == 1) commanded.context.tool.clear();
    if (of.payloads.size() == 1) commanded.context.payload.clear();
    out.pose_ids.push_back(pose.id);
    for (const double joint :
         exchange::degrees_from_si(pose.context.q, exchange::rails_of(of.robot)))
      out.joints_deg.push_back(joint);
  }
  out.csv = to_csv(list);
  return out;
}

Result<Batch> simulate(const Cell& cell, const std::string& truth, const std::string& plan_csv,
                       const SimulateOptions& options) {
  const auto robot = read_virtual_robot(truth, cell.inside().cell);
  if (!robot) return passed_on(robot);
  const auto list = parse_joint_csv(plan_csv, "plan");
  if (!list) return passed_on(list);
  std::vector<PoseContext> poses;
  for (const CommandedPose& pose : list->poses) poses.push_back(pose.context);
  trammel::SimulateOptions how;
  how.seed = options.seed;
  how.orientation = !options.positions_only;
  how.noise = !options.noise_free;
  auto batch = trammel::simulate(*robot, poses, how);
  if (!batch) return passed_on(batch);
  batch->joint_types = list->joint_types;
  for (std::size_t i = 0; i < poses.size(); ++i)
    batch->measurements[i].pose_id = list->poses[i].pose_id;
  return Batch::parse(to_csv(*batch), "simulated");
}

}  // namespace trammel::api
