#include "clients/library/trammel/service.h"

#include <algorithm>
#include <limits>
#include <map>

#include "clients/library/convert.h"
#include "clients/session/session.h"
#include "server/base/host_port.h"
#include "server/base/mutex.h"
#include "server/compensate/model_file.h"
#include "server/exchange/si.h"

namespace trammel::api {

using library::passed_on;

struct Session::Inside {
  std::unique_ptr<client::Session> session;
  mutable Mutex mutex;
  mutable std::map<std::string, Chain> robots TRAMMEL_GUARDED_BY(mutex);

  /// The robot of a cell: which joints are rails. The model says so, and no training changes it.
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

client::CallContext context_of(const Asked& asked, const Chain& robot) {
  return {asked.cell, asked.context.tool,       asked.context.payload, asked.controller_compensates,
          {},         exchange::rails_of(robot)};
}

exchange::Approach approach_of(const Context& context) {
  return {context.directions, context.temperature_c, {}};
}

trammel::Result<exchange::AskedTarget> asked_of(const Target& target, const Context& context,
                                                const Chain& robot) {
  exchange::AskedTarget asked;
  asked.joint_target = !target.pose;
  asked.conf = target.conf;
  asked.approach = approach_of(context);
  if (target.pose) {
    const trammel::Result<trammel::Pose> X_BT = library::from_api(*target.pose);
    if (!X_BT) return tl::make_unexpected(X_BT.error());
    asked.pose = exchange::from_si(*X_BT);
  }
  if (target.joints_deg.empty() && target.pose) return asked;
  const trammel::Result<JointVector> seed = library::joints_from_api(target.joints_deg, robot);
  if (!seed) return tl::make_unexpected(seed.error());
  asked.seed_rad = exchange::asked_from_si(*seed, exchange::rails_of(robot));
  return asked;
}

ModelFacts facts_of(const exchange::ModelInfo& model) {
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
  for (const std::string& one : options.discovery_servers) {
    auto place = parse_host_port(one, kDiscoveryPort);
    if (!place)
      return tl::make_unexpected(
          library::to_api(Failure(place.error()).of("discovery_servers").value()));
    how.discovery_servers.push_back(*std::move(place));
  }
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
  const client::CallContext context = context_of(asked, *robot);
  std::vector<exchange::AskedJoints> poses;
  for (const JointVector& q : *all)
    poses.push_back({exchange::asked_from_si(q, context.rails), approach_of(asked.context)});
  auto answer = inside_->session->predict_error_at(context, poses);
  if (!answer) return passed_on(answer);
  return Answer<Prediction>{facts_of(answer->model), std::move(answer->items)};
}

Result<Answer<CorrectedTarget>> Session::correct(const Asked& asked,
                                                 std::span<const Target> targets) const {
  const auto robot = inside_->robot_of(asked.cell);
  if (!robot) return passed_on(robot);
  if (const auto fits = library::check_context(asked.context, *robot); !fits)
    return passed_on(fits);
  std::vector<exchange::AskedTarget> wanted;
  for (const Target& target : targets) {
    auto one = asked_of(target, asked.context, *robot);
    if (!one)
      return tl::make_unexpected(
          library::to_api(Failure(one.error()).at_row(static_cast<long>(wanted.size())).value()));
    wanted.push_back(std::move(*one));
  }
  auto answer = inside_->session->correct_targets(context_of(asked, *robot), wanted);
  if (!answer) return passed_on(answer);
  return Answer<CorrectedTarget>{facts_of(answer->model), std::move(answer->items)};
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

Status Session::cancel(std::int64_t job) const {
  const auto done = inside_->session->cancel(job);
  if (!done) return passed_on(done);
  return {};
}

Result<std::vector<StoredBatch>> Session::batches(const std::string& cell) const {
  const auto all = inside_->session->batches(cell);
  if (!all) return passed_on(all);
  return each<StoredBatch>(*all, [](const client::BatchOfService& one) {
    return StoredBatch{one.cell,   one.batch, one.reason,          one.hash,
                       one.server, one.poses, one.accepted_unix_s, one.learned};
  });
}

Result<std::string> Session::export_batch(const std::string& cell,
                                          const std::string& batch_id) const {
  const auto text = inside_->session->export_batch(cell, batch_id);
  if (!text) return passed_on(text);
  return *text;
}

Result<std::vector<std::string>> Session::audit(const std::string& cell, std::int64_t since_unix_s,
                                                std::size_t most) const {
  const auto all = inside_->session->audit(cell, since_unix_s, most);
  if (!all) return passed_on(all);
  return each<std::string>(*all, [](const client::AuditText& one) { return one.json; });
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
