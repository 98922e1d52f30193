#include "clients/library/trammel/service.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "clients/library/convert.h"
#include "clients/session/session.h"
#include "server/base/host_port.h"
#include "server/base/mutex.h"
#include "server/base/units.h"
#include "server/compensate/model_file.h"

namespace trammel::api {

using library::passed_on;

struct Session::Inside {
  std::unique_ptr<client::Session> session;
  mutable Mutex mutex;
  mutable std::map<std::string, Chain> robots TRAMMEL_GUARDED_BY(mutex);

  /// The robot of a cell, which its model says and no training changes: which joints are rails.
  [[nodiscard]] trammel::Result<Chain> robot_of(const std::string& cell) const {
    {
      const MutexLock lock(mutex);
      if (const auto known = robots.find(cell); known != robots.end()) return known->second;
    }
    const auto model = TRY(session->export_model(cell, 0).and_then([&](const std::string& text) {
      return deserialize(text, "model of cell " + cell, ModelTexts::kAsTheyAre);
    }));
    const MutexLock lock(mutex);
    return robots.try_emplace(cell, model.cell().robot).first->second;
  }
};

namespace {

constexpr std::chrono::milliseconds kLongestTimeout = std::chrono::hours(24);

client::CallContext context_of(const Asked& asked) {
  return {asked.cell, asked.context.tool, asked.context.payload, asked.controller_compensates, {}};
}

client::Approach approach_of(const Context& context) {
  return {context.directions, context.temperature_c, {}};
}

/// rad, of a rail mm.
std::vector<double> to_wire(const JointVector& q, const Chain& robot) {
  std::vector<double> joints;
  for (int j = 0; j < robot.size(); ++j) {
    const bool rail = robot.joint(j).type == JointType::kPrismatic;
    joints.push_back(rail ? to_mm(q(j)) : q(j));
  }
  return joints;
}

std::vector<double> from_wire(const std::vector<double>& joints, const Chain& robot) {
  std::vector<double> joints_deg = joints;
  for (std::size_t j = 0; j < joints.size() && j < static_cast<std::size_t>(robot.size()); ++j) {
    if (robot.joint(static_cast<int>(j)).type == JointType::kRevolute)
      joints_deg[j] = to_deg(joints[j]);
  }
  return joints_deg;
}

client::PoseMm to_wire(const trammel::Pose& X_BT) {
  const api::Pose pose = library::to_api(X_BT);
  const auto& [p, q] = pose;
  return {p[0], p[1], p[2], q[0], q[1], q[2], q[3]};
}

Pose from_wire(const client::PoseMm& p) {
  return {{p.x_mm, p.y_mm, p.z_mm}, {p.qw, p.qx, p.qy, p.qz}};
}

Prediction from_wire(const client::PredictedError& p) {
  const auto square = [](double s) { return s * s; };
  Prediction out;
  out.nominal = from_wire(p.nominal);
  out.predicted = from_wire(p.predicted);
  out.error_mm = {p.dx_mm, p.dy_mm, p.dz_mm};
  out.stddev_mm = {p.sx_mm, p.sy_mm, p.sz_mm};
  out.true_stddev_mm = {p.slx_mm, p.sly_mm, p.slz_mm};
  out.covariance_mm2 = {square(p.sx_mm), p.cxy_mm2, p.cxz_mm2, p.cxy_mm2,      square(p.sy_mm),
                        p.cyz_mm2,       p.cxz_mm2, p.cyz_mm2, square(p.sz_mm)};
  out.rotation_deg = {to_deg(p.rx_rad), to_deg(p.ry_rad), to_deg(p.rz_rad)};
  if (!std::isnan(p.srx_rad))
    out.rotation_stddev_deg = {to_deg(p.srx_rad), to_deg(p.sry_rad), to_deg(p.srz_rad)};
  out.in_domain = p.in_domain;
  out.bias_share = p.bias_share;
  return out;
}

CorrectedTarget from_wire(const client::CorrectedTarget& t, const Chain& robot) {
  return {t.status,
          from_wire(t.commanded),
          from_wire(t.q_rad, robot),
          t.error_before_mm,
          t.error_after_mm,
          t.sigma_mm,
          to_deg(t.turn_before_rad),
          to_deg(t.turn_after_rad),
          t.iterations,
          t.message};
}

trammel::Result<client::TargetMm> to_wire(const Target& target, const Context& context,
                                          const Chain& robot) {
  client::TargetMm wire;
  wire.joint_target = !target.pose;
  wire.conf = target.conf;
  wire.approach = approach_of(context);
  if (target.pose) {
    const trammel::Result<trammel::Pose> X_BT = library::from_api(*target.pose);
    if (!X_BT) return tl::make_unexpected(X_BT.error());
    wire.pose = to_wire(*X_BT);
  }
  if (target.joints_deg.empty() && target.pose) return wire;
  const trammel::Result<JointVector> seed = library::joints_from_api(target.joints_deg, robot);
  if (!seed) return tl::make_unexpected(seed.error());
  wire.seed_rad = to_wire(*seed, robot);
  return wire;
}

ModelFacts facts_of(const client::ModelInfo& model) {
  return {model.id,      model.hash,     model.cell,
          model.level,   model.batch_id, model.training_poses,
          model.version, model.in_force, library::to_api(model.notes),
          model.budget};
}

Job job_of(const client::JobStatus& job) {
  return {job.job,           job.cell,     job.stage, job.what, job.share,    job.verdict,
          job.model_version, job.in_force, job.why,   job.next, job.held_back};
}

/// `asked`, with each element made by `make`.
template <typename Made, typename Asked, typename Make>
std::vector<Made> each(const std::vector<Asked>& asked, const Make& make) {
  std::vector<Made> made;
  made.reserve(asked.size());
  for (const Asked& one : asked) made.push_back(make(one));
  return made;
}

}  // namespace

Session::Session(std::unique_ptr<Inside> inside) : inside_(std::move(inside)) {}
Session::Session(Session&&) noexcept = default;
Session& Session::operator=(Session&&) noexcept = default;
Session::~Session() = default;

Result<Session> Session::open(const SessionOptions& options) {
  client::SessionOptions how;
  how.domain = options.domain;
  how.server_ports = options.ports;
  how.timeout = std::min(options.timeout, kLongestTimeout);
  how.security = options.security;
  auto places = parse_hosts(options.hosts, options.ports);
  if (!places)
    return tl::make_unexpected(library::to_api(Failure(places.error()).of("hosts").value()));
  how.servers = *std::move(places);
  auto session = client::Session::open(how);
  if (!session) return passed_on(session);
  auto inside = std::make_unique<Inside>();
  inside->session = std::move(*session);
  return Session(std::move(inside));
}

Result<std::vector<Server>> Session::servers() const {
  const auto servers = inside_->session->servers();
  if (!servers) return passed_on(servers);
  return each<Server>(*servers, [](const client::ServerStatus& s) {
    return Server{s.server_id, s.version, s.state, s.cells, s.trouble, s.uptime_s, s.queued_jobs};
  });
}

Result<std::vector<ModelFacts>> Session::models(const std::string& cell) const {
  const auto models =
      cell.empty() ? inside_->session->model_status() : inside_->session->models(cell);
  if (!models) return passed_on(models);
  return each<ModelFacts>(*models, facts_of);
}

Result<std::string> Session::export_model(const std::string& cell, int version) const {
  auto text = inside_->session->export_model(cell, version);
  if (!text) return passed_on(text);
  return std::move(*text);
}

Result<Answer<Prediction>> Session::predict(const Asked& asked,
                                            std::span<const double> joints_deg) const {
  const auto robot = inside_->robot_of(asked.cell);
  if (!robot) return passed_on(robot);
  if (const auto fits = library::check_context(asked.context, *robot); !fits)
    return passed_on(fits);
  const auto all = library::all_joints_from_api(joints_deg, *robot);
  if (!all) return passed_on(all);
  std::vector<client::CommandedJoints> poses;
  for (const JointVector& q : *all)
    poses.push_back({to_wire(q, *robot), approach_of(asked.context)});
  const auto answer = inside_->session->predict_error_at(context_of(asked), poses);
  if (!answer) return passed_on(answer);
  return Answer<Prediction>{facts_of(answer->model),
                            each<Prediction>(answer->items, [](const client::PredictedError& p) {
                              return from_wire(p);
                            })};
}

Result<Answer<CorrectedTarget>> Session::correct(const Asked& asked,
                                                 std::span<const Target> targets) const {
  const auto robot = inside_->robot_of(asked.cell);
  if (!robot) return passed_on(robot);
  if (const auto fits = library::check_context(asked.context, *robot); !fits)
    return passed_on(fits);
  std::vector<client::TargetMm> wanted;
  for (const Target& target : targets) {
    auto wire = to_wire(target, asked.context, *robot);
    if (!wire)
      return tl::make_unexpected(
          library::to_api(Failure(wire.error()).at_row(static_cast<long>(wanted.size())).value()));
    wanted.push_back(std::move(*wire));
  }
  const auto answer = inside_->session->correct_targets(context_of(asked), wanted);
  if (!answer) return passed_on(answer);
  return Answer<CorrectedTarget>{
      facts_of(answer->model),
      each<CorrectedTarget>(
          answer->items, [&](const client::CorrectedTarget& t) { return from_wire(t, *robot); })};
}

Result<std::int64_t> Session::submit(const std::string& cell, const std::string& batch_id,
                                     const std::string& csv) const {
  const auto job = inside_->session->submit_measurements(cell, batch_id, csv);
  if (!job) return passed_on(job);
  return *job;
}

Result<std::int64_t> Session::retrain(const std::string& cell,
                                      const std::vector<std::string>& batch_ids,
                                      const std::string& level, const std::string& bias) const {
  const auto job = inside_->session->train(cell, batch_ids, level, bias);
  if (!job) return passed_on(job);
  return *job;
}

Result<std::int64_t> Session::diagnose(const std::string& cell, const std::string& batch_id,
                                       const std::string& csv, bool apply) const {
  const auto job = inside_->session->diagnose(cell, batch_id, csv, apply);
  if (!job) return passed_on(job);
  return *job;
}

Result<std::int64_t> Session::check(const std::string& cell, const std::string& batch_id,
                                    const std::string& csv,
                                    std::optional<double> tolerance_mm) const {
  const double as_the_cell_says = std::numeric_limits<double>::quiet_NaN();
  const auto job =
      inside_->session->check_health(cell, batch_id, csv, tolerance_mm.value_or(as_the_cell_says));
  if (!job) return passed_on(job);
  return *job;
}

Result<std::string> Session::findings(const std::string& cell, std::int64_t job) const {
  auto answer = inside_->session->diagnosis(cell, job, false);
  if (!answer) return passed_on(answer);
  return std::move(answer->findings_json);
}

Result<Job> Session::wait_for(std::int64_t job, std::chrono::milliseconds limit,
                              const std::function<void(const Job&)>& listener) const {
  const auto last =
      inside_->session->wait_for_job(job, limit, [&](const client::JobStatus& status) {
        if (listener) listener(job_of(status));
      });
  if (!last) return passed_on(last);
  return job_of(*last);
}

Result<std::vector<Job>> Session::jobs(const std::string& cell) const {
  const auto jobs = inside_->session->jobs(cell);
  if (!jobs) return passed_on(jobs);
  return each<Job>(*jobs, [](const client::DatedJob& job) { return job_of(job.status); });
}

namespace {

client::ChangeOptions decided_against(std::optional<int> expected_version,
                                      const std::string& reason) {
  client::ChangeOptions change;
  change.expected_version = expected_version;
  change.reason = reason;
  return change;
}

}  // namespace

Result<int> Session::activate(const std::string& cell, int version, const std::string& reason,
                              std::optional<int> expected_version, bool force) const {
  client::ChangeOptions change = decided_against(expected_version, reason);
  change.force = force;
  const auto now = inside_->session->activate(cell, version, change);
  if (!now) return passed_on(now);
  return *now;
}

Result<int> Session::import_model(const std::string& cell, const std::string& text) const {
  const auto version = inside_->session->import_model(cell, text);
  if (!version) return passed_on(version);
  return *version;
}

Result<int> Session::roll_back(const std::string& cell, const std::string& reason,
                               std::optional<int> expected_version) const {
  const auto now = inside_->session->rollback(cell, decided_against(expected_version, reason));
  if (!now) return passed_on(now);
  return *now;
}

Status Session::release(const std::string& cell, const std::string& batch_id,
                        const std::string& reason, std::optional<int> expected_version) const {
  const auto done =
      inside_->session->release(cell, batch_id, decided_against(expected_version, reason));
  if (!done) return passed_on(done);
  return {};
}

Status Session::discard(const std::string& cell, const std::string& batch_id,
                        const std::string& reason, std::optional<int> expected_version) const {
  const auto done =
      inside_->session->discard(cell, batch_id, decided_against(expected_version, reason));
  if (!done) return passed_on(done);
  return {};
}

}  // namespace trammel::api
