// What the server that writes sends to its followers, without DDS.
#include "server/dds/replicas/batch_sender.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <future>

#include "server/base/hash.h"
#include "tests/dds/backend.h"
#include "tests/support/demand.h"

namespace trammel {
namespace {

using test::demand;

constexpr std::chrono::seconds kLimit{60};

/// Followers as the writer sees them: they answer each copy at once, as they are told to.
class BatchSenderTest : public testing::Test {
 protected:
  using Answer = std::function<wire::ResultCode(const wire::BatchCopy& copy)>;

  BatchSenderTest() {
    ReplicaOptions options;
    options.batches_to_followers = true;
    options.copy_timeout_s = 60;
    sender_ = std::make_unique<BatchSender>(
        "writer", options, *backend_.trainer, *backend_.store,
        [](const std::string& cell) {
          return cell == "cell-7" ? std::map<std::string, std::string>{{"follower", "participant"}}
                                  : std::map<std::string, std::string>();
        },
        [this](const std::string& trouble) { note([&] { trouble_ = trouble; }); },
        [this](const ReplicaNews& news) { note([&] { news_.push_back(news.what); }); });
  }
  ~BatchSenderTest() override { sender_->stop(); }

  void begin() {
    sender_->set_writes(true);
    sender_->start([this](wire::BatchCopy& copy) { send(copy); });
  }
  void send(const wire::BatchCopy& copy) {
    std::optional<wire::ResultCode> result;
    {
      const std::lock_guard lock(mutex_);
      if (answer_) result = answer_(copy);
      sent_.push_back(copy);
    }
    changed_.notify_all();
    if (!result) return;
    wire::BatchCopied answer;
    answer.number(copy.number());
    answer.result(*result);
    answer.why("for a reason");
    sender_->answered("participant", answer);
  }
  /// Null: it does not answer.
  void answers(Answer answer) {
    const std::lock_guard lock(mutex_);
    answer_ = std::move(answer);
  }
  template <typename Note>
  void note(const Note& change) {
    {
      const std::lock_guard lock(mutex_);
      change();
    }
    changed_.notify_all();
  }
  template <typename Ready>
  [[nodiscard]] bool wait_until(const Ready& ready) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, kLimit, ready);
  }
  /// The copies so far, once there are so many and none is awaited.
  std::vector<wire::BatchCopy> sent(std::size_t count) {
    EXPECT_TRUE(wait_until([&] { return sent_.size() >= count; }));
    const std::lock_guard lock(mutex_);
    return sent_;
  }
  [[nodiscard]] bool says(const std::string& part) {
    return wait_until([&] { return trouble_ && trouble_->find(part) != std::string::npos; });
  }
  [[nodiscard]] bool says_nothing() {
    return wait_until([&] { return trouble_ && trouble_->empty(); });
  }

  void accept(const std::string& id) {
    const std::string csv = "q1_deg\n" + id + "\n";
    StoredJob job;
    job.cell = "cell-7";
    ASSERT_TRUE(backend_.store->add_batch({"cell-7", id, csv, sha256_hex(csv), id, 1'650'000'000, 1}, job));
  }
  void discard(const std::string& id) {
    ChangeId because;
    because.reason = "a bump";
    ASSERT_TRUE(backend_.store->discard("cell-7", id, because));
  }

  test::Backend backend_;
  std::mutex mutex_;
  std::condition_variable changed_;
  Answer answer_ = [](const wire::BatchCopy&) { return wire::RESULT_OK; };  // guarded by mutex_
  std::vector<wire::BatchCopy> sent_;                                       // guarded by mutex_
  std::optional<std::string> trouble_;                                      // guarded by mutex_
  std::vector<std::string> news_;                                           // guarded by mutex_
  std::unique_ptr<BatchSender> sender_;
};

TEST_F(BatchSenderTest, AFollowerGetsEachBatchOnceWithItsTextAndThenWhatBecomesOfIt) {
  accept("lt-1");
  begin();
  EXPECT_EQ(sent(1).front().csv(), "q1_deg\nlt-1\n");
  EXPECT_EQ(sent(1).front().accepted_at_unix_s(), 1'650'000'000);
  discard("lt-1");
  sender_->bring("cell-7", "lt-1");
  const auto copies = sent(2);
  EXPECT_EQ(copies.size(), 2u) << "whoever was first told of it, the thread or the one that asked for it";
  EXPECT_TRUE(copies.back().csv().empty());
  EXPECT_TRUE(copies.back().discarded());
  EXPECT_EQ(copies.back().quarantine(), "discarded: a bump");
}

TEST_F(BatchSenderTest, WhatAFullDiskRefusedIsSentAgainAndTheTroubleIsOver) {
  for (const wire::ResultCode code : {wire::RESULT_BUSY, wire::RESULT_INTERNAL}) {
    answers([code](const wire::BatchCopy&) { return code; });
    accept(fmt::format("lt-{}", static_cast<int>(code)));
    if (sent(0).empty()) begin();
    ASSERT_TRUE(says("may lack"));
    answers([](const wire::BatchCopy&) { return wire::RESULT_OK; });
    sender_->look_again();
    EXPECT_TRUE(says_nothing()) << code;
  }
}

TEST_F(BatchSenderTest, WhatAFollowerRefusesForGoodIsNotSentAgainAndKeepsNoOtherOneFromIt) {
  answers(
      [](const wire::BatchCopy& copy) { return copy.batch_id() == "lt-1" ? wire::RESULT_CONFLICT : wire::RESULT_OK; });
  accept("lt-1");
  accept("lt-2");
  begin();
  ASSERT_TRUE(says("for a reason"));
  EXPECT_EQ(sent(2).back().batch_id(), "lt-2");
  accept("lt-3");
  EXPECT_EQ(sent(3).back().batch_id(), "lt-3") << "in a round of its own";
}

TEST_F(BatchSenderTest, ABatchIsSentAsItIsAndNotAsItWasWhenTheRoundBegan) {
  accept("lt-1");
  accept("lt-2");
  answers([this](const wire::BatchCopy& copy) {
    if (copy.batch_id() == "lt-1") discard("lt-2");
    return wire::RESULT_OK;
  });
  begin();
  const auto copies = sent(2);
  EXPECT_EQ(copies.at(1).batch_id(), "lt-2");
  EXPECT_TRUE(copies.at(1).discarded());
}

TEST_F(BatchSenderTest, OneThatWritesAgainTellsAllThatBecameOfItsBatchesButSendsNoTextAgain) {
  accept("lt-1");
  discard("lt-1");
  begin();
  ASSERT_EQ(sent(1).size(), 1u);
  ASSERT_TRUE(says_nothing());
  sender_->set_writes(false);
  sender_->set_writes(true);
  const auto copies = sent(2);
  EXPECT_TRUE(copies.back().discarded());
  EXPECT_TRUE(copies.back().csv().empty());
  sender_->look_again("participant");
  EXPECT_TRUE(sent(3).back().csv().empty()) << "it followed another one meanwhile";
}

TEST_F(BatchSenderTest, ABatchWhoseTextIsDamagedIsToldOfWithoutItAndSaid) {
  accept("lt-1");
  discard("lt-1");
  SQLite::Database(backend_.folder.file("trammel.db"), SQLite::OPEN_READWRITE).exec("UPDATE batches SET csv = 'x'");
  answers([](const wire::BatchCopy& copy) { return copy.csv().empty() ? wire::RESULT_NOT_FOUND : wire::RESULT_OK; });
  begin();
  EXPECT_TRUE(says("for a reason"));
  const auto copies = sent(1);
  EXPECT_TRUE(copies.front().discarded());
  EXPECT_TRUE(copies.front().csv().empty());
}

TEST_F(BatchSenderTest, WhoStopsDoesNotWaitForAFollowerThatHangs) {
  answers(nullptr);
  begin();
  accept("lt-1");
  auto asked = std::async(std::launch::async, [this] { sender_->bring("cell-7", "lt-1"); });
  ASSERT_FALSE(sent(1).empty());
  sender_->stop();
  EXPECT_EQ(asked.wait_for(kLimit / 2), std::future_status::ready) << "it would have waited for a minute";
  asked.get();
}

}  // namespace
}  // namespace trammel
