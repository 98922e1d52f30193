// The requests of a session, and how it follows a job.
#include <algorithm>
#include <functional>
#include <optional>
#include <utility>

#include "clients/session/participant.h"

namespace trammel::client {
namespace {

constexpr std::chrono::milliseconds kJobPoll{2000};
constexpr std::chrono::milliseconds kLook{50};  // between two looks at the servers' states

bool is_over(const JobStatus& job) {
  return job.stage == "done" || job.stage == "failed" || job.stage == "cancelled";
}

}  // namespace

Result<std::string> check_security(const std::string& folder) {
  return wire::read_security(folder).map(
      [](const wire::Security& security) { return security.subject; });
}

Result<std::unique_ptr<Session>> Session::open(const SessionOptions& asked) {
  auto inside = std::make_unique<Participant>();
  auto options = completed(asked);
  if (!options) return tl::make_unexpected(options.error());
  inside->options = *std::move(options);
  auto participant = TRY(participant_of(inside->options));
  inside->participant = std::move(participant);

  inside->partition = make_name("client");
  inside->request_publisher = inside->participant->create_publisher(wire::publisher_qos({}));
  inside->reply_subscriber =
      inside->participant->create_subscriber(wire::subscriber_qos(inside->partition));
  wire::dds::Subscriber* states = inside->participant->create_subscriber(wire::subscriber_qos({}));
  if (inside->request_publisher == nullptr || inside->reply_subscriber == nullptr ||
      states == nullptr) {
    return failure(ErrorCode::kInternal,
                   "cannot create the publisher and the subscribers of a session");
  }
  auto watch =
      TRY(ServerWatch::open(*inside->participant, *states, inside->options.servers.size()));
  inside->watch = std::move(watch);
  return std::unique_ptr<Session>(new Session(std::move(inside)));
}

Session::Session(std::unique_ptr<Participant> participant) : participant_(std::move(participant)) {}

Session::~Session() = default;

Result<exchange::Answer<exchange::Prediction>> Session::predict_error(
    const CallContext& context, const std::vector<std::vector<double>>& joints_rad,
    const ShareListener& progress) {
  std::vector<exchange::AskedJoints> poses;
  poses.reserve(joints_rad.size());
  for (const auto& q_rad : joints_rad) poses.push_back({q_rad});
  return predict_error_at(context, poses, progress);
}

Result<exchange::Answer<exchange::Prediction>> Session::predict_error_at(
    const CallContext& context, const std::vector<exchange::AskedJoints>& poses,
    const ShareListener& progress) {
  return participant_->call_in_parts<wire::PredictError, exchange::Prediction>(
      context, poses, progress,
      [](wire::PredictErrorRequest & request) -> auto& { return request.poses(); },
      [](const wire::PredictErrorReply& reply) -> const auto& { return reply.predictions(); },
      [](const wire::PredictedError& item) { return wire::from_wire(item); });
}

Result<exchange::Answer<exchange::CorrectedTarget>> Session::correct_targets(
    const CallContext& context, const std::vector<exchange::AskedTarget>& targets,
    const ShareListener& progress) {
  return participant_->call_in_parts<wire::CorrectTarget, exchange::CorrectedTarget>(
      context, targets, progress,
      [](wire::CorrectTargetRequest & request) -> auto& { return request.targets(); },
      [](const wire::CorrectTargetReply& reply) -> const auto& { return reply.corrections(); },
      [&](const wire::CorrectedTarget& item) { return wire::from_wire(item, context.rails); });
}

Result<std::vector<ServerStatus>> Session::servers() {
  const auto& options = participant_->options;
  const auto known =
      participant_->watch->wait_for_servers(options.servers.size(), participant_->deadline());
  if (known.empty()) return tl::make_unexpected(participant_->no_server());
  std::vector<ServerStatus> servers;
  for (const KnownServer& server : known) servers.push_back(from_wire(server.status));
  return servers;
}

Result<std::vector<ServerStatus>> Session::servers_when(
    const std::function<bool(const std::vector<ServerStatus>&)>& holds,
    std::chrono::milliseconds limit) {
  const auto until = Clock::now() + limit;
  while (true) {
    auto known = servers();
    if (!known || holds(*known) || Clock::now() >= until) return known;
    participant_->watch->wait_until(std::min(until, Clock::now() + kLook));
  }
}

Result<std::vector<exchange::ModelInfo>> Session::model_status() {
  TRY(servers());
  std::vector<exchange::ModelInfo> models;
  for (const wire::ModelInfo& model : participant_->watch->models_in_force())
    models.push_back(from_wire(model));
  return models;
}

Result<JobStatus> Session::wait_for_job(std::int64_t job, std::chrono::milliseconds limit,
                                        const std::function<void(const JobStatus&)>& listener) {
  const auto deadline = Clock::now() + limit;
  const auto found = TRY(participant_->find_job(job));
  const std::string& server = found.first;
  JobStatus status = status_of(found.second);
  std::uint64_t seen = 0;
  while (true) {
    if (listener) listener(status);
    if (is_over(status)) {
      participant_->told(job, server);
      return status;
    }
    std::optional<wire::Job> news;
    while (!news) {
      if (Clock::now() >= deadline) {
        return failure(ErrorCode::kUnreachable, "job {} is not over after {} ms: {}", job,
                       limit.count(), status.what);
      }
      news = participant_->watch->wait_for_progress(server, job, seen,
                                                    std::min(deadline, Clock::now() + kJobPoll));
      if (news) continue;
      const auto asked = participant_->job(server, job);
      const bool may_come =
          !asked && (asked.error().code == ErrorCode::kUnreachable ||
                     asked.error().code == ErrorCode::kBusy);  // a record that is away
      if (!asked && !may_come) return tl::make_unexpected(asked.error());
      if (asked) news = *asked;
    }
    status = status_of(*news);
  }
}

}  // namespace trammel::client
