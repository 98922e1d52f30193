#pragma once

#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "idl/transport/transport.h"

namespace trammel::wire {

/// Reads a state topic. The listener is called in threads of DDS and must neither block nor call
/// DDS.
template <typename State>
class StateReader final : private dds::DataReaderListener {
 public:
  using Sample = typename State::Type::type;
  /// The sample, the participant that wrote it and when (s, by the writer's clock for what it
  /// sends: library_clock.h); no sample: the participant has left.
  using Listener =
      std::function<void(const Sample*, const std::string& participant, double written_s)>;

  [[nodiscard]] static Result<std::unique_ptr<StateReader>> open(
      dds::DomainParticipant& participant, dds::Subscriber& subscriber,
      const dds::DataReaderQos& qos, Listener listener) {
    return open(make_state_topic<State>(participant), subscriber, qos, std::move(listener));
  }
  [[nodiscard]] static Result<std::unique_ptr<StateReader>> open(const Result<dds::Topic*>& topic,
                                                                 dds::Subscriber& subscriber,
                                                                 const dds::DataReaderQos& qos,
                                                                 Listener listener) {
    if (!topic) return tl::make_unexpected(topic.error());
    std::unique_ptr<StateReader> result(new StateReader(subscriber, std::move(listener)));
    const auto mask = dds::StatusMask::data_available() << dds::StatusMask::subscription_matched();
    result->reader_ = subscriber.create_datareader(*topic, qos, result.get(), mask);
    if (result->reader_ == nullptr)
      return failure(ErrorCode::kInternal, "cannot create the reader of {}", State::kName);
    return result;
  }

  ~StateReader() override {
    if (reader_ != nullptr) subscriber_.delete_datareader(reader_);
  }

 private:
  StateReader(dds::Subscriber& subscriber, Listener listener)
      : subscriber_(subscriber), listener_(std::move(listener)) {}

  void on_data_available(dds::DataReader* reader) override {
    Sample sample;
    dds::SampleInfo info;
    while (reader->take_next_sample(&sample, &info) ==
           eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      const double written = 1e-9 * static_cast<double>(info.source_timestamp.to_ns());
      listener_(&sample, participant_of(info.sample_identity.writer_guid()), written);
    }
  }

  void on_subscription_matched(dds::DataReader*,
                               const dds::SubscriptionMatchedStatus& status) override {
    if (status.current_count_change >= 0) return;
    listener_(
        nullptr,
        participant_of(eprosima::fastrtps::rtps::iHandle2GUID(status.last_publication_handle)), 0);
  }

  dds::Subscriber& subscriber_;
  const Listener listener_;
  dds::DataReader* reader_ = nullptr;
};

}  // namespace trammel::wire
