#include "tests/benchmarks/year/upkeep.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <thread>

#include "server/base/units.h"
#include "server/exchange/si.h"
#include "server/plan/plan.h"
#include "server/robot/rigid_fit.h"
#include "tests/support/demand.h"

namespace trammel::year {
namespace {

using nlohmann::json;
using test::demand;

constexpr std::chrono::minutes kLimit{15};
constexpr int kCheckPoses = 12;
constexpr int kReferencePoses = 200;
constexpr std::uint64_t kReferenceSeed = 424242;

Named named(const json& cause) {
  Named named{cause.value("cause", ""), 0};
  if (cause.contains("joint") && cause["joint"].is_number()) named.joint = cause["joint"];
  const std::string parameter = cause.value("parameter", "");
  if (named.joint == 0 && !parameter.empty() &&
      std::isdigit(static_cast<unsigned char>(parameter.back())) != 0)
    named.joint = parameter.back() - '0';
  return named;
}

std::vector<std::vector<Named>> names_in(const json& changes) {
  std::vector<std::vector<Named>> all;
  for (const json& change : changes) {
    all.push_back({named(change)});
    for (const json& other : change.value("could_also_be", json::array()))
      all.back().push_back(named(other));
  }
  return all;
}

/// The rigid motion that is not the model's business: the part is located by the arm itself.
Eigen::Matrix3Xd aligned(const Eigen::Matrix3Xd& real_reference, const Eigen::Matrix3Xd& reference,
                         const Eigen::Matrix3Xd& points) {
  const Pose X = demand(fit_transform(real_reference, reference));
  return X * points;
}

double rms(const Eigen::Matrix3Xd& difference) {
  return std::sqrt(difference.squaredNorm() / static_cast<double>(difference.cols()));
}

std::vector<double> joints(const Eigen::MatrixXd& q, Eigen::Index row) {
  std::vector<double> all(static_cast<std::size_t>(q.cols()));
  for (Eigen::Index j = 0; j < q.cols(); ++j) all[static_cast<std::size_t>(j)] = q(row, j);
  return all;
}

Eigen::Vector3d position(const exchange::Pose& pose) {
  return from_mm(1) * Eigen::Map<const Eigen::Vector3d>(pose.xyz_mm.data());
}

}  // namespace

Metrologist::Metrologist(const Arm& arm, client::Session& session) : arm_(arm), session_(session) {
  PlanOptions options;
  options.count = kCheckPoses;
  options.criterion = PlanCriterion::kCheck;
  const Plan plan = demand(make_plan(arm.cell(), options));
  check_poses_.resize(static_cast<Eigen::Index>(plan.poses.size()), arm.cell()->robot.size());
  for (std::size_t i = 0; i < plan.poses.size(); ++i)
    check_poses_.row(static_cast<Eigen::Index>(i)) = plan.poses[i].context.q;
}

Taken Metrologist::follow(std::int64_t job) {
  const auto ended = session_.wait_for_job(job, kLimit, [](const client::JobStatus&) {});
  if (!ended) return {.verdict = sentence(ended.error())};
  return {ended->verdict + (ended->why.empty() ? "" : ": " + ended->why), ended->model_version,
          ended->in_force, ended->verdict == "quarantined"};
}

Taken Metrologist::submit(const std::string& id, const MeasurementBatch& batch) {
  const auto job = session_.submit_measurements(arm_.cell()->name, id, to_csv(batch));
  if (!job) return {.verdict = "refused: " + sentence(job.error())};
  return follow(*job);
}

Taken Metrologist::measure(int week, int poses) {
  const auto seed = static_cast<std::uint64_t>(1000 * week + poses);
  last_ = arm_.measured(arm_.poses(poses, seed), week, seed, week % 13 == 7);
  last_id_ = fmt::format("week-{}-{}", week, poses);
  return submit(last_id_, last_);
}

Taken Metrologist::release() {
  const auto job = session_.release_and_train(arm_.cell()->name, {last_id_}, "", "");
  if (!job) return {.verdict = "refused: " + sentence(job.error())};
  return follow(*job);
}

Said Metrologist::check(int week) {
  const MeasurementBatch batch =
      arm_.measured(check_poses_, week, static_cast<std::uint64_t>(77 + week), true);
  const auto job = session_.check_health(arm_.cell()->name, "", to_csv(batch), std::nan(""));
  if (!job) return {.cannot_tell = true, .sentence = sentence(job.error())};
  const Taken ended = follow(*job);
  const auto answer = session_.diagnosis(arm_.cell()->name, *job, false);
  if (!answer) return {.cannot_tell = true, .sentence = ended.verdict};
  const json check = json::parse(answer->findings_json, nullptr, false);
  const std::string verdict = check.value("verdict", "");
  return {.changed = verdict == "changed",
          .cannot_tell = verdict == "cannot_tell",
          .seen = names_in(check.value("changed", json::array())),
          .sentence = check.value("why", "")};
}

int Metrologist::in_force() const {
  const auto models = session_.models(arm_.cell()->name);
  if (!models) return 0;
  for (const exchange::ModelInfo& model : *models)
    if (model.in_force) return model.version;
  return 0;
}

Said Metrologist::diagnose() {
  const auto job = session_.diagnose(arm_.cell()->name, last_id_, "", true);
  if (!job) return {.cannot_tell = true, .sentence = sentence(job.error())};
  const Taken ended = follow(*job);
  const auto answer = session_.diagnosis(arm_.cell()->name, *job, false);
  if (!answer) return {.cannot_tell = true, .sentence = ended.verdict};
  const json found = json::parse(answer->findings_json, nullptr, false);
  const std::string verdict = found.value("verdict", "");
  return {.changed = verdict == "named",
          .cannot_tell = verdict == "unknown" || verdict == "ambiguous",
          .in_force = ended.in_force,
          .seen = names_in(found.value("findings", json::array())),
          .sentence = verdict + "; " + ended.verdict};
}

client::CallContext Driller::context() const {
  client::CallContext context;
  context.cell = arm_.cell()->name;
  return context;
}

std::optional<Eigen::Matrix3Xd> Driller::predicted(const Eigen::MatrixXd& q, int week) const {
  std::vector<exchange::AskedJoints> asked;
  for (Eigen::Index i = 0; i < q.rows(); ++i)
    asked.push_back({joints(q, i), {.temperature_c = arm_.temperature(week)}});
  const auto answer = session_.predict_error_at(context(), asked);
  if (!answer) return std::nullopt;
  Eigen::Matrix3Xd positions(3, q.rows());
  for (Eigen::Index i = 0; i < q.rows(); ++i)
    positions.col(i) = position(answer->items[static_cast<std::size_t>(i)].predicted);
  return positions;
}

std::optional<double> Driller::error_in_force(int week) const {
  const Eigen::MatrixXd q = arm_.poses(kReferencePoses, kReferenceSeed);
  const auto said = predicted(q, week);
  if (!said) return std::nullopt;
  const Eigen::Matrix3Xd real = arm_.true_positions(q, week);
  return rms(real - aligned(real, *said, *said));
}

double Driller::error_of(const CompensatedModel& model, int week) const {
  const Eigen::MatrixXd q = arm_.poses(kReferencePoses, kReferenceSeed);
  const Eigen::Matrix3Xd real = arm_.true_positions(q, week);
  Eigen::Matrix3Xd said(3, q.rows());
  for (Eigen::Index i = 0; i < q.rows(); ++i) {
    PoseContext pose;
    pose.q = q.row(i);
    pose.temperature = arm_.temperature(week);
    pose.tool = pose.payload = "spindle";
    pose.served = true;
    said.col(i) = model.predict_all({pose}).front().X_BT_predicted.translation();
  }
  return rms(real - aligned(real, said, said));
}

std::vector<Hole> Driller::drill(int week, int count, std::uint64_t seed) const {
  const Eigen::MatrixXd q = arm_.poses(count, seed);
  std::vector<exchange::AskedTarget> targets;
  for (Eigen::Index i = 0; i < q.rows(); ++i) {
    exchange::AskedTarget target;
    target.joint_target = true;
    target.seed_rad = joints(q, i);
    target.approach.temperature_c = arm_.temperature(week);
    targets.push_back(target);
  }
  const auto answer = session_.correct_targets(context(), targets);
  const Eigen::MatrixXd reference = arm_.poses(kReferencePoses, kReferenceSeed);
  const auto said = predicted(reference, week);
  if (!answer || !said) return {};
  Eigen::MatrixXd commanded = q;
  Eigen::Matrix3Xd wanted(3, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const exchange::CorrectedTarget& item = answer->items[static_cast<std::size_t>(i)];
    if (item.joints_deg.size() == static_cast<std::size_t>(q.cols()))
      commanded.row(i) = exchange::si_from_degrees(item.joints_deg, arm_.cell()->robot).transpose();
    Pose X_FT = *arm_.cell()->tools.at("spindle");
    wanted.col(i) = (arm_.cell()->robot.flange_pose(q.row(i)) * X_FT).translation();
  }
  const Eigen::Matrix3Xd real = arm_.true_positions(commanded, week);
  const Eigen::Matrix3Xd aims = aligned(arm_.true_positions(reference, week), *said, wanted);
  std::vector<Hole> holes;
  for (Eigen::Index i = 0; i < count; ++i) {
    const exchange::CorrectedTarget& item = answer->items[static_cast<std::size_t>(i)];
    Hole hole;
    hole.error = (real.col(i) - aims.col(i)).norm();
    hole.promised = from_mm(item.error_after_mm);
    hole.warned = item.status != "ok" || 2 * hole.promised > limit_;
    holes.push_back(hole);
  }
  return holes;
}

}  // namespace trammel::year
