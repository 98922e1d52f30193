#include "server/dds/dds_service.h"

#include <pthread.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <functional>
#include <map>
#include <optional>
#include <stop_token>
#include <thread>
#include <utility>
#include <vector>

#include "idl/transport/places.h"
#include "idl/transport/ros2.h"
#include "idl/transport/transport.h"
#include "server/base/mutex.h"
#include "server/dds/codec.h"
#include "server/dds/gateway/local_calls.h"
#include "server/dds/handlers.h"
#include "server/dds/packet_report.h"
#include "server/dds/port_lock.h"
#include "server/dds/reply_channels.h"
#include "server/dds/request_endpoint.h"
#include "server/dds/ros2/ros2_endpoint.h"
#include "server/dds/service_events.h"
#include "server/dds/state_topics.h"
#include "server/dds/status_echo.h"
#include "server/dds/watchdog.h"

namespace trammel {
namespace {

using Clock = std::chrono::steady_clock;

Status check_names(const DdsOptions& options, const Trainer& trainer) {
  if (!wire::valid_partition(options.server_id)) {
    return failure(ErrorCode::kUsage,
                   "server id `{}`: must be 1 to {} letters, digits, `.`, `_`, `-`",
                   options.server_id, wire::MAX_NAME)
        .of("server")
        .with_text(options.server_id);
  }
  if (trainer.cells().size() > wire::MAX_CELLS) {
    return failure(ErrorCode::kTooLarge, "{} cells, limit {}", trainer.cells().size(),
                   wire::MAX_CELLS)
        .of("cells")
        .beyond(trainer.cells().size(), wire::MAX_CELLS);
  }
  for (const auto& [name, cell] : trainer.cells()) {
    if (name.empty() || name.size() > wire::MAX_NAME) {
      return failure(ErrorCode::kUsage, "cell `{}`: its name must have 1 to {} characters", name,
                     wire::MAX_NAME)
          .of("cell")
          .with_text(name);
    }
  }
  return {};
}

/// Added to the priority value of workers that do not compute.
constexpr int kBehindComputing = 5;

RoomLimits room_limits(const DdsOptions& options) {
  const auto bytes = [](int mb) { return static_cast<std::size_t>(mb) << 20; };
  return {bytes(options.queued_mb), bytes(options.client_mb), options.cell_share};
}

TurnLimits compute_limits(const DdsOptions& options) {
  TurnLimits limits;
  limits.workers = static_cast<std::size_t>(options.compute_workers);
  limits.express_workers = 1;
  limits.client_requests = static_cast<std::size_t>(options.client_requests);
  limits.requests = static_cast<std::size_t>(options.queued_requests);
  limits.cell_share = options.cell_share;
  return limits;
}

/// The limits for reading requests. These cannot be interrupted, so no client may occupy all
/// workers.
TurnLimits limits_of_reads(const DdsOptions& options) {
  TurnLimits limits = compute_limits(options);
  limits.workers = 4;
  limits.express_workers = 0;
  limits.client_workers = 2;
  return limits;
}

/// The changes of one cell come one after the other.
TurnLimits limits_of_changes(const DdsOptions& options) {
  TurnLimits limits = compute_limits(options);
  limits.workers = 8;
  limits.express_workers = 0;
  limits.client_workers = 4;
  limits.cell_workers = 1;
  return limits;
}

/// Threads that start while this lives get its name. The library does not name its threads, and
/// `top` and debuggers show names.
class ThreadName {
 public:
  explicit ThreadName(const char* name) {
    ::pthread_getname_np(::pthread_self(), before_.data(), before_.size());
    ::pthread_setname_np(::pthread_self(), name);
  }
  ~ThreadName() { ::pthread_setname_np(::pthread_self(), before_.data()); }
  ThreadName(const ThreadName&) = delete;
  ThreadName& operator=(const ThreadName&) = delete;

 private:
  std::array<char, 16> before_{};
};

Result<std::optional<wire::Security>> security_of(const std::string& folder) {
  if (folder.empty()) return std::nullopt;
  auto security = TRY(wire::read_security(folder));
  TRY(wire::check_serves(security));
  return std::optional(std::move(security));
}

}  // namespace

class DdsService::Running {
 public:
  [[nodiscard]] static Result<std::unique_ptr<Running>> start(const DdsOptions& options,
                                                              Trainer& trainer, Store& store,
                                                              const ModelRegistry& registry,
                                                              const PacketListener& packet_listener,
                                                              const CallListener& call_listener) {
    TRY(check_names(options, trainer));
    auto library = std::make_optional<ThreadName>("dds");
    auto port = TRY(PortLock::take(options.address, options.port));
    auto events = std::make_unique<ServiceEvents>();
    const auto heard = std::make_shared<wire::HeardOfItself>();
    const auto dropped = std::make_shared<wire::DropCounts>();
    const auto security = TRY(security_of(options.security));
    auto participant = TRY(wire::make_participant({"trammel server " + options.server_id,
                                                   options.domain,
                                                   options.address,
                                                   options.port,
                                                   {},
                                                   heard,
                                                   dropped,
                                                   {},
                                                   security},
                                                  events.get()));
    wire::dds::Subscriber* subscriber = participant->create_subscriber(wire::subscriber_qos({}));
    if (subscriber == nullptr)
      return failure(ErrorCode::kInternal, "cannot create the subscriber of requests");
    auto topics = TRY(StateTopics::open(*participant));
    auto echo = TRY(StatusEcho::open(*participant, *subscriber, topics.status_writer(), *heard));
    library.reset();

    std::unique_ptr<Running> running(new Running(options, trainer, store, registry, std::move(port),
                                                 std::move(events), std::move(participant),
                                                 *subscriber, topics, std::move(echo)));
    running->core_.listener = call_listener;
    auto recorder = TRY(RequestRecorder::open(options.record));
    running->recorder_ = std::move(recorder);
    running->core_.recorder = running->recorder_.get();
    running->handlers_.set_names(&running->events_->names());
    TRY(running->open_endpoints());
    if (options.local_calls)
      running->local_calls_ =
          std::make_unique<LocalCalls>(running->core_, running->events_->names(),
                                       AllLanes{running->predictions_, running->corrections_,
                                                running->reads_, running->changes_});
    for (Lane* lane : running->lanes()) lane->start();
    running->replies_thread_ = std::jthread(
        [r = running.get()](const std::stop_token& stop) { r->channels_.deliver(stop); });
    running->packets_.emplace(dropped);
    running->dropped_ = dropped;
    running->packet_listener_ = packet_listener;
    running->status_thread_ =
        std::jthread([r = running.get()](const std::stop_token& stop) { r->tell_status(stop); });
    running->watchdog_ = std::make_unique<Watchdog>(running->moving_parts(heard));
    TRY(running->tell_place());
    return running;
  }

  ~Running() {
    beacon_.reset();
    watchdog_.reset();
    status_thread_ = {};
    tell_refused(Clock::now() +
                 PacketReport::kAtMostEvery);  // includes reports that were still due
    publish_status(wire::SERVICE_STOPPING);
    for (const auto& endpoint : endpoints_) endpoint->close();
    for (Lane* lane : lanes()) lane->stop();
    replies_thread_ = {};
    endpoints_.clear();
  }

  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

  void publish_progress(const JobProgress& progress) {
    wire::TrainingProgress sample;
    sample.server(options_.server_id);
    sample.number(progress.job);
    sample.job(to_wire(progress));
    topics_.publish(std::move(sample));
    if (progress.stage != JobStage::kTraining) events_->status_changed();
  }

  void publish_model(const std::string& cell) {
    {
      const MutexLock lock(
          publishing_of(cell));  // the last model published must be the one in force
      if (const auto model = registry_.in_force(cell)) topics_.publish(*model, options_.server_id);
    }
    events_->status_changed();
  }

  void cells_added() { events_->status_changed(); }

  void set_limits(const DdsOptions& options) {
    room_.set_limits(room_limits(options));
    for (Lane* lane : lanes()) lane->set_limits(compute_limits(options));
  }

  [[nodiscard]] ServiceFigures figures() const {
    ServiceFigures now;
    for (const auto& endpoint : endpoints_) now.operations.push_back(endpoint->figures());
    if (local_calls_) {
      for (const RequestEndpointBase* endpoint : local_calls_->endpoints())
        now.operations.push_back(endpoint->figures());
    }
    now.queues = {{"predictions", predictions_.requests()},
                  {"corrections", corrections_.requests()},
                  {"reads", reads_.requests()},
                  {"changes", changes_.requests()}};
    now.waiting_bytes = room_.bytes();
    now.clients = channels_.clients();
    now.unheard = channels_.unheard();
    now.misdirected = core_.counts.misdirected;
    now.unreadable = *core_.unreadable;
    now.lost = core_.counts.lost;
    now.work = handlers_.work().all();
    if (recorder_) now.not_recorded = recorder_->dropped();
    now.strangers = events_->refusals();
    for (std::size_t i = 0; i < wire::kDroppedReasons; ++i) {
      const auto reason = static_cast<wire::Dropped>(i);
      now.dropped_packets[wire::name_of(reason)] = dropped_->of(reason);
    }
    return now;
  }

  [[nodiscard]] ServiceCalls* local_calls() { return local_calls_.get(); }
  void end_local_calls() {
    if (local_calls_) local_calls_->close();
  }

  [[nodiscard]] Movement movement() const { return {true, watchdog_->still()}; }

 private:
  Running(const DdsOptions& options, Trainer& trainer, Store& store, const ModelRegistry& registry,
          PortLock port, std::unique_ptr<ServiceEvents> events, wire::ParticipantPtr participant,
          wire::dds::Subscriber& subscriber, const StateTopics& topics,
          std::unique_ptr<StatusEcho> echo)
      : options_(options),
        trainer_(trainer),
        store_(store),
        registry_(registry),
        handlers_(trainer, store, registry),
        port_(std::move(port)),
        events_(std::move(events)),
        participant_(std::move(participant)),
        topics_(topics),
        echo_(std::move(echo)),
        channels_(
            *participant_, static_cast<std::size_t>(options.max_clients),
            [events = events_.get()] { events->wake(); }, replying_),
        room_(room_limits(options)),
        predictions_(compute_limits(options), room_),
        corrections_(compute_limits(options), room_),
        reads_(limits_of_reads(options), room_, kBehindComputing),
        changes_(limits_of_changes(options), room_, kBehindComputing),
        core_{options.server_id, *participant_, subscriber, trainer, handlers_, channels_} {}

  /// Comes last, because clients may ask as soon as they know the place.
  Status tell_place() {
    if (options_.discovery_servers.empty()) return {};
    const wire::Place place{{options_.address, options_.port}, options_.domain, options_.server_id};
    auto beacon = TRY(wire::announce_place(place, options_.discovery_servers));
    beacon_ = std::move(beacon);
    return {};
  }

  Status open_endpoints() {
    const auto open = [this]<typename Operation>(Operation, Lanes lanes) -> Status {
      auto endpoint = TRY(RequestEndpoint<Operation>::open(core_, lanes));
      endpoints_.push_back(std::move(endpoint));
      return {};
    };
    const Lanes others{changes_, reads_};
    Status opened = open(wire::PredictError(), {predictions_, predictions_});
    if (opened) opened = open(wire::CorrectTarget(), {corrections_, corrections_});
    if (opened) opened = open(wire::SubmitMeasurements(), others);
    if (opened) opened = open(wire::Train(), others);
    if (opened) opened = open(wire::Diagnose(), others);
    if (opened) opened = open(wire::CheckHealth(), others);
    if (opened) opened = open(wire::ReadModels(), others);
    if (opened) opened = open(wire::ManageModels(), others);
    if (opened) opened = open(wire::ReleaseBatches(), others);
    if (opened && options_.ros2) opened = open_ros2<wire::Ros2PredictErrors>(predictions_);
    if (opened && options_.ros2) opened = open_ros2<wire::Ros2CorrectTargets>(corrections_);
    if (!opened) return opened;
    return {};
  }

  template <typename Ros>
  Status open_ros2(Lane& lane) {
    auto endpoint = TRY(open_ros2_endpoint<Ros>(core_, lane, replying_));
    endpoints_.push_back(std::move(endpoint));
    return {};
  }

  [[nodiscard]] Mutex& publishing_of(const std::string& cell) {
    const MutexLock lock(publishing_mutex_);
    return publishing_[cell];
  }

  [[nodiscard]] std::array<Lane*, 4> lanes() {
    return {&predictions_, &corrections_, &reads_, &changes_};
  }

  void tell_status(const std::stop_token& stop) {
    ::pthread_setname_np(::pthread_self(), "status");
    ServiceEvents::News news{true, {}};
    Clock::time_point told;
    while (!stop.stop_requested()) {
      if (news.status_changed || Clock::now() - told >= wire::kStatusPeriod) {
        publish_status(wire::SERVICE_SERVING);
        told = Clock::now();
      }
      ++status_steps_;
      tell_refused(Clock::now());
      const bool clients_wait = channels_.tend();
      ++status_steps_;
      const auto left =
          std::chrono::ceil<std::chrono::milliseconds>(told + wire::kStatusPeriod - Clock::now());
      news = events_->wait(stop, clients_wait ? std::min(left, wire::kAnnouncement) : left);
      channels_.heard(news.readers);
    }
  }

  /// Reports the packets and participants that did not reach the service, as far as a report is
  /// due.
  void tell_refused(Clock::time_point now) {
    if (!packets_) return;  // the start has failed
    if (const auto dropped = packets_->due(now)) packet_listener_("packets_dropped", *dropped);
    for (const std::string& refused : events_->strangers_due(now))
      packet_listener_("participant_refused", refused);
  }

  /// The threads of this service and of the library for the watchdog. Each thread counts its own
  /// work.
  [[nodiscard]] std::vector<MovingPart> moving_parts(
      const std::shared_ptr<wire::HeardOfItself>& heard) const {
    using Mark = std::optional<std::uint64_t>;
    std::vector<MovingPart> parts = {
        {"discovery", [heard]() -> Mark { return heard->announcements.load(); }},
        {"receiving", [this]() -> Mark { return echo_->heard(); }},
        {"taking requests", [this] { return core_.taking.oldest(); }},
        {"replying", [this] { return replying_.oldest(); }},
        {"replies", [this]() -> Mark { return channels_.looks(); }},
        {"status", [this]() -> Mark { return status_steps_.load(); }}};
    parts.push_back({"predictions", [this] { return predictions_.unseen(); }});
    parts.push_back({"corrections", [this] { return corrections_.unseen(); }});
    parts.push_back({"reading requests", [this] { return reads_.unseen(); }});
    parts.push_back({"changing requests", [this] { return changes_.unseen(); }});
    // A portion of these takes milliseconds. Waiting clients get status reports, and ending the
    // process would lose the computations of others.
    parts.push_back(
        {"computing predictions", [this] { return predictions_.oldest_portion(); }, false});
    parts.push_back(
        {"computing corrections", [this] { return corrections_.oldest_portion(); }, false});
    return parts;
  }

  void publish_status(wire::ServiceState state) {
    wire::ServiceStatus status;
    status.server(options_.server_id);
    status.contract_version(wire::CONTRACT_VERSION);
    status.program_version(options_.program_version);
    status.state(state);
    for (const auto& [name, cell] : trainer_.cells()) {
      if (!trainer_.why_apart(name)) status.cells().push_back(name);
    }
    status.models_in_force(static_cast<std::int32_t>(registry_.cells_served()));
    status.requests(core_.counts.requests + core_.counts.shed);
    status.refused(core_.counts.refused + core_.counts.shed);
    status.shed(core_.counts.shed);
    status.unheard(channels_.unheard());
    status.misdirected(core_.counts.misdirected);
    status.unreadable(*core_.unreadable);
    status.lost(core_.counts.lost);
    status.trouble(
        cut(fmt::format("{}", fmt::join(trainer_.troubles(), "; ")), wire::MAX_SENTENCE));
    status.record(store_.shared_identity());
    status.uptime_s(std::chrono::duration<double>(Clock::now() - started_).count());
    status.queued_jobs(trainer_.queued_jobs());
    topics_.publish(std::move(status));
  }

  const DdsOptions options_;
  const Clock::time_point started_ = Clock::now();
  Trainer& trainer_;
  const Store& store_;
  const ModelRegistry& registry_;
  Handlers handlers_;
  PortLock port_;
  std::unique_ptr<ServiceEvents> events_;
  wire::ParticipantPtr participant_;
  StateTopics topics_;
  std::unique_ptr<StatusEcho> echo_;
  WorkUnderWay replying_;
  ReplyChannels channels_;
  Room room_;
  Lane predictions_, corrections_, reads_, changes_;
  ServiceCore core_;
  std::unique_ptr<RequestRecorder> recorder_;  // null: nothing is recorded
  Mutex publishing_mutex_;
  // By cell; nothing leaves it. A cell publishes one model at a time.
  std::map<std::string, Mutex> publishing_ TRAMMEL_GUARDED_BY(publishing_mutex_);
  std::vector<std::unique_ptr<RequestEndpointBase>> endpoints_;
  std::unique_ptr<LocalCalls> local_calls_;  // null: no gateway asks
  std::atomic<std::uint64_t> status_steps_{0};
  std::shared_ptr<const wire::DropCounts> dropped_;
  std::optional<PacketReport> packets_;  // of the status thread
  PacketListener packet_listener_;
  std::jthread replies_thread_;
  std::jthread status_thread_;
  std::unique_ptr<Watchdog> watchdog_;
  wire::ParticipantPtr beacon_;  // the announcement through discovery servers; null: none
};

Status check_security(const std::string& folder) {
  return security_of(folder).map([](const auto&) {});
}

Status check_records(const RecordOptions& options) { return RequestRecorder::check(options); }

DdsService::DdsService(DdsOptions options, Trainer& trainer, Store& store,
                       const ModelRegistry& registry)
    : options_(std::move(options)), trainer_(trainer), store_(store), registry_(registry) {}

DdsService::~DdsService() { stop(); }

void DdsService::set_call_listener(CallListener listener) { call_listener_ = std::move(listener); }

void DdsService::set_packet_listener(PacketListener listener) {
  packet_listener_ = std::move(listener);
}

Status DdsService::start() {
  {
    const MutexLock lock(mutex_);
    if (running_) return {};
  }
  // Without the lock: its workers may publish.
  auto started =
      TRY(Running::start(options_, trainer_, store_, registry_, packet_listener_, call_listener_));
  {
    const MutexLock lock(mutex_);
    running_ = std::move(started);
  }
  for (const auto& model : registry_.all()) publish_model(model->cell);
  return {};
}

void DdsService::stop() {
  std::unique_ptr<Running> last;  // destroyed without the lock: its workers may publish
  MutexLock lock(mutex_);
  last.swap(running_);
  if (last) last->end_local_calls();
  published_.wait(lock, [this]() TRAMMEL_REQUIRES(mutex_) { return publishing_ == 0; });
}

void DdsService::publish_progress(const JobProgress& progress) {
  while_running([&](Running& running) { running.publish_progress(progress); });
}

void DdsService::publish_model(const std::string& cell) {
  while_running([&](Running& running) { running.publish_model(cell); });
}

void DdsService::set_limits(const DdsOptions& options) {
  while_running([&](Running& running) { running.set_limits(options); });
}

bool DdsService::with_calls(const std::function<void(ServiceCalls&)>& work) {
  bool runs = false;
  while_running([&](Running& running) {
    ServiceCalls* calls = running.local_calls();
    runs = calls != nullptr;
    if (runs) work(*calls);
  });
  return runs;
}

void DdsService::cells_added() {
  while_running([](Running& running) { running.cells_added(); });
}

ServiceFigures DdsService::figures() {
  ServiceFigures now;
  while_running([&](const Running& running) { now = running.figures(); });
  return now;
}

Movement DdsService::movement() {
  Movement now;
  while_running([&](const Running& running) { now = running.movement(); });
  return now;
}

template <typename Work>
void DdsService::while_running(const Work& work) {
  MutexLock lock(mutex_);
  if (!running_) return;
  Running& running = *running_;  // stays alive: stop() waits until publishing_ is 0
  ++publishing_;
  lock.unlock();
  work(running);
  lock.lock();
  --publishing_;
  published_.notify_all();
}

}  // namespace trammel
