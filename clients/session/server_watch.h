#pragma once

#include <chrono>
#include <cstdint>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "idl/transport.h"
#include "server/base/mutex.h"

namespace trammel::client {

using Clock = std::chrono::steady_clock;

/// Reads a state topic; the function is called from DDS' threads and must neither block nor call DDS.
template <typename State>
class StateReader final : private wire::dds::DataReaderListener {
 public:
  using Sample = typename State::Type::type;
  /// The sample, the participant that wrote it and when (Unix time, s); no sample: the participant has left.
  using Listener = std::function<void(const Sample*, const std::string& participant, double written_unix_s)>;

  [[nodiscard]] static Result<std::unique_ptr<StateReader>> open(wire::dds::DomainParticipant& participant,
                                                                 wire::dds::Subscriber& subscriber,
                                                                 const wire::dds::DataReaderQos& qos,
                                                                 Listener listener) {
    const auto topic = wire::make_state_topic<State>(participant);
    if (!topic) return tl::make_unexpected(topic.error());
    std::unique_ptr<StateReader> result(new StateReader(subscriber, std::move(listener)));
    const auto mask = wire::dds::StatusMask::data_available() << wire::dds::StatusMask::subscription_matched();
    result->reader_ = subscriber.create_datareader(*topic, qos, result.get(), mask);
    if (result->reader_ == nullptr)
      return failure(ErrorCode::kInternal, "cannot create the reader of {}", State::kName);
    return result;
  }

  ~StateReader() override {
    if (reader_ != nullptr) subscriber_.delete_datareader(reader_);
  }

 private:
  StateReader(wire::dds::Subscriber& subscriber, Listener listener)
      : subscriber_(subscriber), listener_(std::move(listener)) {}

  void on_data_available(wire::dds::DataReader* reader) override {
    Sample sample;
    wire::dds::SampleInfo info;
    while (reader->take_next_sample(&sample, &info) == eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      const double written = 1e-9 * static_cast<double>(info.source_timestamp.to_ns());
      listener_(&sample, wire::participant_of(info.sample_identity.writer_guid()), written);
    }
  }

  void on_subscription_matched(wire::dds::DataReader*, const wire::dds::SubscriptionMatchedStatus& status) override {
    if (status.current_count_change >= 0) return;
    listener_(nullptr, wire::participant_of(eprosima::fastrtps::rtps::iHandle2GUID(status.last_publication_handle)), 0);
  }

  wire::dds::Subscriber& subscriber_;
  const Listener listener_;
  wire::dds::DataReader* reader_ = nullptr;
};

/// A server as its status describes it.
struct KnownServer {
  std::string participant;
  wire::ServiceStatus status;
  Clock::time_point heard;

  [[nodiscard]] std::string id() const { return status.server().to_string(); }
};

/// A model in force as it was described at a time.
struct KnownModel {
  wire::ModelInfo model;
  double written_unix_s = 0;
};

/// What servers say without being asked, and which of them are there. Thread-safe.
class ServerWatch {
 public:
  [[nodiscard]] static Result<std::unique_ptr<ServerWatch>> open(wire::dds::DomainParticipant& participant,
                                                                 wire::dds::Subscriber& subscriber);

  /// Of the servers that `reachable` lets through: one that serves `cell` if there is one, rather not
  /// `avoid`, rather one heard of lately. Waits for the first until `deadline`.
  [[nodiscard]] std::optional<KnownServer> wait_for_server(const std::string& cell, const std::string& avoid,
                                                           Clock::time_point deadline,
                                                           const std::function<bool(const KnownServer&)>& reachable);
  /// What is reachable may have changed.
  void wake();

  /// Waits until `count` servers are known, or until `deadline`; after the first one only as long as a status takes.
  [[nodiscard]] std::vector<KnownServer> wait_for_servers(std::size_t count, Clock::time_point deadline);
  /// Waits for as many models as the servers say they have in force, one status period at most. Their data's age is
  /// that of now, not that of when they were put in force.
  [[nodiscard]] std::vector<wire::ModelInfo> models_in_force();

  /// Waits for a progress of the job that is later than the `seen`-th (which it updates); empty at `deadline`. An empty
  /// server means any.
  [[nodiscard]] std::optional<wire::Job> wait_for_progress(const std::string& server, std::int64_t job,
                                                           std::uint64_t& seen, Clock::time_point deadline);

 private:
  ServerWatch() = default;
  void on_status(const wire::ServiceStatus* status, const std::string& participant);
  void on_model(const wire::ModelStatus* status, const std::string& participant, double written_unix_s);
  void on_progress(const wire::TrainingProgress* progress);
  [[nodiscard]] const KnownServer* choose(const std::string& cell, const std::string& avoid,
                                          const std::function<bool(const KnownServer&)>& reachable) const
      TRAMMEL_REQUIRES(mutex_);
  /// As many of each server as it says it has.
  [[nodiscard]] bool knows_all_models() const TRAMMEL_REQUIRES(mutex_);

  Mutex mutex_;
  Condition changed_;
  std::map<std::string, KnownServer> servers_ TRAMMEL_GUARDED_BY(mutex_);  // by id
  std::map<std::pair<std::string, std::string>, KnownModel> models_
      TRAMMEL_GUARDED_BY(mutex_);  // by participant and cell
  std::map<std::int64_t, std::map<std::string, std::pair<std::uint64_t, wire::Job>>> jobs_
      TRAMMEL_GUARDED_BY(mutex_);  // by number, then by server
  std::uint64_t progress_count_ TRAMMEL_GUARDED_BY(mutex_) = 0;
  std::unique_ptr<StateReader<wire::ServiceStatusTopic>> status_reader_;
  std::unique_ptr<StateReader<wire::ModelStatusTopic>> model_reader_;
  std::unique_ptr<StateReader<wire::TrainingProgressTopic>> progress_reader_;
};

}  // namespace trammel::client
