// Writers of requests and replies on a machine where threads are stopped in the middle of a write.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "tests/dds/raw_client.h"
#include "tests/support/own_ports.h"

namespace trammel {
namespace {

using eprosima::fastrtps::types::ReturnCode_t;

/// A write of it takes longer than the 100 ms that the library waits by default.
class SlowBytesType final : public test::AnyBytesType {
 public:
  using AnyBytesType::AnyBytesType;
  bool serialize(void* data, eprosima::fastrtps::rtps::SerializedPayload_t* payload) override {
    std::this_thread::sleep_for(std::chrono::milliseconds(110));
    return AnyBytesType::serialize(data, payload);
  }
};

/// Reliable writers of one participant, each with a reader of another participant.
class Writers final : private wire::dds::DataWriterListener {
 public:
  static constexpr std::size_t kSlow = 24, kQuick = 2;

  explicit Writers(const wire::dds::DataWriterQos& qos) {
    for (std::size_t k = 0; k < kSlow + kQuick; ++k) {
      const std::string name = "t" + std::to_string(k);
      test::AnyBytesType* const type =
          k < kSlow ? new SlowBytesType(name) : new test::AnyBytesType(name);
      auto* const topic = wire::make_topic(*from_, name, type).value();
      auto* const heard = wire::make_topic(*to_, name, new test::AnyBytesType(name)).value();
      to_->create_subscriber(wire::subscriber_qos({}))
          ->create_datareader(heard, wire::call_reader_qos(wire::kReplyDepth));
      all_.push_back(
          from_->create_publisher(wire::publisher_qos({}))
              ->create_datawriter(topic, qos, this, wire::dds::StatusMask::publication_matched()));
    }
  }

  [[nodiscard]] bool wait_until_matched() {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds(20),
                             [this] { return matched_ == kSlow + kQuick; });
  }
  /// All slow ones at once, beside quick ones that keep the library's event thread busy.
  void write() {
    std::atomic<bool> is_over{false};
    std::vector<std::jthread> quick, slow;
    for (std::size_t k = kSlow; k < all_.size(); ++k) {
      quick.emplace_back([&, k] {
        test::Bytes bytes(16);
        while (!is_over) all_[k]->write(&bytes);
      });
    }
    for (std::size_t k = 0; k < kSlow; ++k) {
      slow.emplace_back([this, k] {
        test::Bytes bytes(16);
        all_[k]->write(&bytes);
      });
    }
    slow.clear();
    is_over = true;
  }
  /// Whose reader has confirmed nothing since, because no HEARTBEAT asked it to.
  [[nodiscard]] std::size_t unconfirmed() {
    std::size_t count = 0;
    for (std::size_t k = 0; k < kSlow; ++k) {
      if (all_[k]->wait_for_acknowledgments({2, 0}) != ReturnCode_t::RETCODE_OK) ++count;
    }
    return count;
  }

 private:
  void on_publication_matched(wire::dds::DataWriter*,
                              const wire::dds::PublicationMatchedStatus& status) override {
    {
      const std::lock_guard lock(mutex_);
      matched_ += static_cast<std::size_t>(status.current_count_change);
    }
    changed_.notify_all();
  }

  const std::uint16_t port_ = test::own_ports();
  std::mutex mutex_;
  std::condition_variable changed_;
  std::size_t matched_ = 0;  // guarded by mutex_
  std::vector<wire::dds::DataWriter*> all_;
  wire::ParticipantPtr to_ =
      wire::make_participant({"to", test::own_domain(), "127.0.0.1", port_, {}}).value();
  wire::ParticipantPtr from_ =
      wire::make_participant({"from", test::own_domain(), "127.0.0.1", 0, {port_}}).value();
};

/// How many of so many rounds end with a writer that has gone quiet.
int quiet_rounds(const wire::dds::DataWriterQos& qos) {
  Writers writers(qos);
  EXPECT_TRUE(writers.wait_until_matched());
  constexpr int kRounds = 10;
  int quiet = 0;
  for (int round = 0; round < kRounds; ++round) {
    writers.write();
    quiet += writers.unconfirmed() > 0 ? 1 : 0;
  }
  return quiet;
}

TEST(CallWriter, AWriteThatTookLongIsFollowedByHeartbeatsAllTheSame) {
  EXPECT_EQ(quiet_rounds(wire::call_writer_qos(wire::kReplyDepth)), 0);
}

TEST(CallWriter, DISABLED_WithTheLibrarysOwnPatienceItGoesQuiet) {
  wire::dds::DataWriterQos qos = wire::call_writer_qos(wire::kReplyDepth);
  qos.reliability().max_blocking_time = {0, 100'000'000};
  EXPECT_EQ(quiet_rounds(qos), 0);
}

}  // namespace
}  // namespace trammel
