#include <gtest/gtest.h>

#include <algorithm>
#include <condition_variable>
#include <map>
#include <mutex>
#include <set>

#include "idl/transport/ros2.h"
#include "server/dds/dds_service.h"
#include "tests/dds/backend.h"

// ROS 2 nodes beside the limits and repeats that hold for all clients.

namespace trammel {
namespace {

using wire::ros2::CorrectedTargets_;
using wire::ros2::CorrectTargets_;

/// A publisher of questions and a subscription to answers.
class Node final : private wire::dds::DataWriterListener, private wire::dds::DataReaderListener {
 public:
  explicit Node(const DdsOptions& options, bool listens = true) {
    using Ros = wire::Ros2CorrectTargets;
    participant_ =
        wire::make_participant({"node", options.domain, "127.0.0.1", 0, {options.port}}).value();
    auto* questions = wire::make_topic(*participant_, Ros::kRequestTopic,
                                       new wire::SafeType<Ros::Request>(wire::kMaxComputeSample))
                          .value();
    if (listens) listen();
    writer_ = participant_->create_publisher(wire::publisher_qos({}))
                  ->create_datawriter(questions, wire::call_writer_qos(1000), this,
                                      wire::dds::StatusMask::publication_matched());
  }
  ~Node() override { participant_.reset(); }
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;

  void listen() {
    using Ros = wire::Ros2CorrectTargets;
    auto* answers = wire::make_topic(*participant_, Ros::kReplyTopic,
                                     new wire::SafeType<Ros::Reply>(wire::kMaxComputeSample))
                        .value();
    participant_->create_subscriber(wire::subscriber_qos({}))
        ->create_datareader(answers, wire::call_reader_qos(1000), this,
                            wire::dds::StatusMask::data_available()
                                << wire::dds::StatusMask::subscription_matched());
  }
  [[nodiscard]] bool wait_until_matched() {
    return wait([this] { return readers_ > 0 && writers_ > 0; });
  }
  [[nodiscard]] bool wait_until_heard() {
    return wait([this] { return readers_ > 0; });
  }
  void ask(CorrectTargets_ question) { writer_->write(&question); }
  /// Until at least `count` have come.
  [[nodiscard]] std::vector<CorrectedTargets_> wait_for_answers(std::size_t count) {
    EXPECT_TRUE(wait([&] { return answers_.size() >= count; })) << answers_.size() << " answers";
    const std::lock_guard lock(mutex_);
    return answers_;
  }

 private:
  template <typename Until>
  bool wait(const Until& until) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds(20), until);
  }
  template <typename Change>
  void change(const Change& change) {
    {
      const std::lock_guard lock(mutex_);
      change();
    }
    changed_.notify_all();
  }
  void on_publication_matched(wire::dds::DataWriter*,
                              const wire::dds::PublicationMatchedStatus& status) override {
    change([&] { readers_ = status.current_count; });
  }
  void on_subscription_matched(wire::dds::DataReader*,
                               const wire::dds::SubscriptionMatchedStatus& status) override {
    change([&] { writers_ = status.current_count; });
  }
  void on_data_available(wire::dds::DataReader* reader) override {
    CorrectedTargets_ answer;
    wire::dds::SampleInfo info;
    while (reader->take_next_sample(&answer, &info) ==
           eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
      if (info.valid_data) change([&] { answers_.push_back(answer); });
    }
  }

  wire::ParticipantPtr participant_;
  wire::dds::DataWriter* writer_ = nullptr;
  std::mutex mutex_;
  std::condition_variable changed_;
  int readers_ = 0;                         // guarded by mutex_: of our questions
  int writers_ = 0;                         // guarded by mutex_: of answers to us
  std::vector<CorrectedTargets_> answers_;  // guarded by mutex_
};

DdsOptions with_nodes() {
  DdsOptions options = test::test_dds_options();
  options.ros2 = true;
  options.compute_workers = 1;
  options.client_requests = 2;
  return options;
}

/// The nominal pose at all joints zero is wanted, so many times.
CorrectTargets_ question(const std::string& id, std::size_t targets = 1) {
  CorrectTargets_ question;
  question.id(id);
  question.cell("cell-7");
  question.joints(6);
  question.joints_rad(std::vector<double>(6 * targets, 0.0));
  return question;
}

class Ros2Service : public testing::Test {
 protected:
  void SetUp() override {
    backend_.serve(7);
    ASSERT_TRUE(service_.start());
    ASSERT_TRUE(node_.wait_until_matched());
  }
  test::Backend backend_;
  const DdsOptions options_ = with_nodes();
  DdsService service_{options_, *backend_.trainer, *backend_.store, backend_.registry};
  Node node_{options_};
};

TEST_F(Ros2Service, ARepeatIsAnsweredAgainAndSomethingElseUnderItsIdIsAConflict) {
  node_.ask(question("a", 3));
  static_cast<void>(node_.wait_for_answers(1));
  node_.ask(question("a", 3));
  static_cast<void>(node_.wait_for_answers(2));
  node_.ask(question("a", 4));
  const auto answers = node_.wait_for_answers(3);
  EXPECT_EQ(answers[0].result(), static_cast<std::uint32_t>(wire::RESULT_OK))
      << answers[0].message();
  EXPECT_EQ(answers[0].status().size(), 3u);
  EXPECT_EQ(answers[1].error_before_m(), answers[0].error_before_m());
  EXPECT_EQ(answers[2].result(), static_cast<std::uint32_t>(wire::RESULT_CONFLICT));
}

// The two are never matched at once: what is written before the node's reader is known, nobody
// gets.
TEST_F(Ros2Service, ANodeWhoseReaderIsMatchedAfterItsQuestionIsAnswered) {
  Node late(options_, false);
  ASSERT_TRUE(late.wait_until_heard());
  late.ask(question("early"));
  late.listen();
  EXPECT_EQ(late.wait_for_answers(1)[0].id(), "early");
}

// As two processes of a command line do it.
TEST_F(Ros2Service, WhatOneNodeAsksAnotherOneHears) {
  Node mute(options_, false);
  ASSERT_TRUE(mute.wait_until_heard());
  mute.ask(question("for/all"));
  EXPECT_EQ(node_.wait_for_answers(1)[0].id(), "for/all");
}

TEST_F(Ros2Service, EachQuestionOfAFloodIsAnsweredOnceAndWhatHasNoRoomIsToldSo) {
  constexpr int kQuestions = 60;
  for (int i = 0; i < kQuestions; ++i) node_.ask(question(fmt::format("flood/{}", i), 500));
  std::set<std::string> ids;
  std::map<std::uint32_t, int> results;
  for (const CorrectedTargets_& answer : node_.wait_for_answers(kQuestions)) {
    EXPECT_TRUE(ids.insert(answer.id()).second) << answer.id() << " twice";
    ++results[answer.result()];
    EXPECT_EQ(answer.retry_after_ms() > 0, answer.result() == wire::RESULT_BUSY);
  }
  EXPECT_EQ(ids.size(), static_cast<std::size_t>(kQuestions));
  EXPECT_GT(results[wire::RESULT_OK], 0);
  EXPECT_GT(results[wire::RESULT_BUSY], 0) << "client_requests is 2";
  EXPECT_EQ(results.size(), 2u);
}

TEST_F(Ros2Service, WhatIsAskedOfAnotherServerIsLeftToIt) {
  CorrectTargets_ other = question("other");
  other.server("server-b");
  node_.ask(other);
  CorrectTargets_ ours = question("ours");
  ours.server("server-a");
  node_.ask(ours);
  EXPECT_EQ(node_.wait_for_answers(1)[0].id(), "ours");
}

TEST_F(Ros2Service, AnUnknownCellIsToldAndWhatHasNoIdIsCounted) {
  CorrectTargets_ nameless = question("");
  node_.ask(nameless);
  CorrectTargets_ lost = question("lost");
  lost.cell("cell-99");
  node_.ask(lost);
  const auto answers = node_.wait_for_answers(1);
  EXPECT_EQ(answers[0].result(), static_cast<std::uint32_t>(wire::RESULT_NOT_FOUND));
  EXPECT_NE(answers[0].message().find("cell-99"), std::string::npos) << answers[0].message();
  EXPECT_EQ(service_.figures().unreadable, 1u);
}

}  // namespace
}  // namespace trammel
