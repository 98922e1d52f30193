#include "clients/session/server_watch.h"

#include <algorithm>
#include <tuple>

namespace trammel::client {
namespace {

constexpr std::size_t kJobsRemembered = 1000;

}  // namespace

Result<std::unique_ptr<ServerWatch>> ServerWatch::open(wire::dds::DomainParticipant& participant,
                                                       wire::dds::Subscriber& subscriber,
                                                       std::size_t named) {
  std::unique_ptr<ServerWatch> watch(new ServerWatch(named));
  ServerWatch* self = watch.get();
  auto status = TRY(wire::StateReader<wire::ServiceStatusTopic>::open(
      participant, subscriber, wire::state_reader_qos(),
      [self](const wire::ServiceStatus* sample, const std::string& writer, double written) {
        self->on_status(sample, writer, written);
      }));
  watch->status_reader_ = std::move(status);
  auto contract = TRY(wire::StateReader<wire::SpokenContractTopic>::open(
      wire::make_contract_topic(participant), subscriber, wire::state_reader_qos(),
      [self](const wire::SpokenContract* sample, const std::string& writer, double) {
        self->on_contract(sample, writer);
      }));
  watch->contract_reader_ = std::move(contract);
  auto model = TRY(wire::StateReader<wire::ModelStatusTopic>::open(
      participant, subscriber, wire::state_reader_qos(),
      [self](const wire::ModelStatus* sample, const std::string& writer, double written) {
        self->on_model(sample, writer, written);
      }));
  watch->model_reader_ = std::move(model);
  auto progress = TRY(wire::StateReader<wire::TrainingProgressTopic>::open(
      participant, subscriber, wire::progress_reader_qos(),
      [self](const wire::TrainingProgress* sample, const std::string&, double) {
        self->on_progress(sample);
      }));
  watch->progress_reader_ = std::move(progress);
  return watch;
}

std::optional<Error> ServerWatch::other_contract() const {
  const MutexLock lock(mutex_);
  if (others_.empty() || !servers_.empty()) return std::nullopt;
  const OtherServer& other = others_.begin()->second;
  return refused("server {} ({}) speaks contract {} of the wire, this program speaks contract {}",
                 other.id, other.program_version, other.contract, wire::CONTRACT_VERSION)
      .of("contract_version")
      .beyond(other.contract, wire::CONTRACT_VERSION)
      .next(other.contract < wire::CONTRACT_VERSION ? "update the server" : "update this program")
      .value();
}

bool ServerWatch::in_vain() const {
  return servers_.empty() && !others_.empty() &&
         Clock::now() - *others_since_ > wire::kStatusPeriod;
}

template <typename Found>
void ServerWatch::wait_for_first(MutexLock& lock, Clock::time_point deadline, const Found& found) {
  // The others' status comes every period and wakes this up.
  changed_.wait_until(lock, deadline,
                      [&]() TRAMMEL_REQUIRES(mutex_) { return found() || in_vain(); });
}

bool serves(const KnownServer& server, const std::string& cell) {
  const auto& cells = server.status.cells();
  return std::find(cells.begin(), cells.end(), cell) != cells.end();
}

bool ServerWatch::is_settled(const KnownServer& chosen, const std::string& cell) const {
  if (cell.empty() || serves(chosen, cell)) return true;
  return servers_.size() >= named_ &&
         std::none_of(servers_.begin(), servers_.end(),
                      [&](const auto& entry) { return serves(entry.second, cell); });
}

std::optional<KnownServer> ServerWatch::wait_for_server(
    const std::string& cell, const std::string& avoid, Clock::time_point deadline,
    const std::function<bool(const KnownServer&)>& reachable) {
  MutexLock lock(mutex_);
  const KnownServer* chosen = nullptr;
  const auto look = [&]() TRAMMEL_REQUIRES(mutex_) {
    chosen = choose(cell, avoid, reachable);
    return chosen != nullptr;
  };
  wait_for_first(lock, std::min(deadline, Clock::now() + wire::kStatusLost),
                 [&]() TRAMMEL_REQUIRES(mutex_) { return look() && is_settled(*chosen, cell); });
  if (chosen == nullptr) wait_for_first(lock, deadline, look);
  if (chosen == nullptr) return std::nullopt;
  return *chosen;
}

std::optional<KnownServer> ServerWatch::another_server(
    const std::string& cell, const std::string& avoid,
    const std::function<bool(const KnownServer&)>& reachable) {
  const MutexLock lock(mutex_);
  const KnownServer* chosen = choose(cell, avoid, [&](const KnownServer& server) {
    return server.id() != avoid && serves(server, cell) && reachable(server);
  });
  if (chosen == nullptr) return std::nullopt;
  return *chosen;
}

void ServerWatch::was_slow(const std::string& server) {
  const MutexLock lock(mutex_);
  slow_[server] = Clock::now();
}

const KnownServer* ServerWatch::choose(
    const std::string& cell, const std::string& avoid,
    const std::function<bool(const KnownServer&)>& reachable) const {
  const auto merit = [&](const KnownServer& server) TRAMMEL_REQUIRES(mutex_) {
    const auto slow = slow_.find(server.id());
    const bool is_quick = slow == slow_.end() || slow->second < server.heard;
    return std::tuple(serves(server, cell), Clock::now() - server.heard < wire::kStatusLost,
                      server.id() != avoid, is_quick);
  };
  const KnownServer* best = nullptr;
  for (const auto& [id, server] : servers_) {
    if (server.status.state() != wire::SERVICE_SERVING || !reachable(server)) continue;
    if (best == nullptr || merit(server) > merit(*best)) best = &server;
  }
  return best;
}

std::string ServerWatch::record_of(const std::string& server) const {
  const MutexLock lock(mutex_);
  const auto found = records_.find(server);
  return found == records_.end() ? std::string() : found->second;
}

void ServerWatch::wait_until(Clock::time_point time) {
  MutexLock lock(mutex_);
  changed_.wait_until(lock, time, [] { return false; });
}

void ServerWatch::wake() {
  { const MutexLock lock(mutex_); }
  changed_.notify_all();
}

std::vector<KnownServer> ServerWatch::wait_for_servers(std::size_t count,
                                                       Clock::time_point deadline) {
  MutexLock lock(mutex_);
  wait_for_first(lock, deadline, [&]() TRAMMEL_REQUIRES(mutex_) { return !servers_.empty(); });
  changed_.wait_until(lock, std::min(deadline, others_expected_until_),
                      [&]() TRAMMEL_REQUIRES(mutex_) { return servers_.size() >= count; });
  std::vector<KnownServer> servers;
  for (const auto& [id, server] : servers_) servers.push_back(server);
  return servers;
}

bool ServerWatch::knows_all_models() const {
  for (const auto& [id, server] : servers_) {
    int known = 0;
    for (const auto& [key, model] : models_) known += key.first == server.participant ? 1 : 0;
    if (known < server.status.models_in_force()) return false;
  }
  return true;
}

double ServerWatch::age_s(const std::string& participant, const KnownModel& known) const {
  for (const auto& [id, server] : servers_) {
    if (server.participant != participant) continue;
    const std::chrono::duration<double> since_status = Clock::now() - server.heard;
    return std::max(0.0, server.written_s + since_status.count() - known.written_s);
  }
  return 0;
}

std::vector<wire::ModelInfo> ServerWatch::models_in_force() {
  MutexLock lock(mutex_);
  changed_.wait_until(lock, Clock::now() + wire::kStatusPeriod,
                      [this]() TRAMMEL_REQUIRES(mutex_) { return knows_all_models(); });
  // If servers differ for a moment, the newest information counts, since all servers of one record
  // converge to it.
  std::map<std::string, std::pair<double, wire::ModelInfo>> last;  // by cell, with its age, s
  for (const auto& [key, known] : models_) {
    wire::ModelInfo model = known.model;
    const double since_s = age_s(key.first, known);
    model.data_age_s(model.data_age_s() + since_s);
    model.training_age_s(model.training_age_s() + since_s);
    const auto [entry, added] = last.emplace(key.second, std::pair(since_s, model));
    if (!added && since_s < entry->second.first) entry->second = {since_s, model};
  }
  std::vector<wire::ModelInfo> models;
  for (const auto& [cell, told] : last) models.push_back(told.second);
  return models;
}

std::optional<wire::Job> ServerWatch::wait_for_progress(const std::string& server, std::int64_t job,
                                                        std::uint64_t& seen,
                                                        Clock::time_point deadline) {
  MutexLock lock(mutex_);
  std::optional<wire::Job> news;
  changed_.wait_until(lock, deadline, [&]() TRAMMEL_REQUIRES(mutex_) {
    for (const auto& [from, progress] : jobs_[job]) {
      if ((!server.empty() && from != server) || progress.first <= seen) continue;
      seen = progress.first;
      news = progress.second;
    }
    return news.has_value();
  });
  return news;
}

void ServerWatch::on_contract(const wire::SpokenContract* spoken, const std::string& participant) {
  {
    const MutexLock lock(mutex_);
    if (spoken == nullptr) {
      others_.erase(participant);
    } else if (spoken->contract_version() != wire::CONTRACT_VERSION) {
      others_[participant] = {spoken->server().to_string(), spoken->program_version(),
                              spoken->contract_version()};
      if (!others_since_) others_since_ = Clock::now();
    }
    if (others_.empty()) others_since_.reset();
  }
  changed_.notify_all();
}

void ServerWatch::on_status(const wire::ServiceStatus* status, const std::string& participant,
                            double written_s) {
  {
    const MutexLock lock(mutex_);
    if (status != nullptr) {
      if (servers_.empty()) others_expected_until_ = Clock::now() + wire::kStatusPeriod / 2;
      servers_[status->server().to_string()] = {participant, *status, Clock::now(), written_s};
      records_[status->server().to_string()] = status->record().to_string();
    } else {
      std::erase_if(servers_,
                    [&](const auto& entry) { return entry.second.participant == participant; });
    }
  }
  changed_.notify_all();
}

void ServerWatch::on_model(const wire::ModelStatus* status, const std::string& participant,
                           double written_s) {
  {
    const MutexLock lock(mutex_);
    if (status != nullptr) {
      models_[{participant, status->cell().to_string()}] = {status->model(), written_s};
    } else {
      std::erase_if(models_, [&](const auto& entry) { return entry.first.first == participant; });
    }
  }
  changed_.notify_all();
}

void ServerWatch::on_progress(const wire::TrainingProgress* progress) {
  if (progress == nullptr) return;
  {
    const MutexLock lock(mutex_);
    jobs_[progress->number()][progress->server().to_string()] = {++progress_count_,
                                                                 progress->job()};
    if (jobs_.size() > kJobsRemembered) jobs_.erase(jobs_.begin());
  }
  changed_.notify_all();
}

}  // namespace trammel::client
