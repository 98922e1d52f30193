// Batches that another server sends: what a follower's trainer makes of them, and what it trains with once it writes.
#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <optional>

#include "server/base/hash.h"
#include "server/base/unix_time.h"
#include "server/trainer/job_sources.h"
#include "server/trainer/trainer.h"
#include "tests/support/demand.h"
#include "tests/support/faulty_disk.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

using test::demand;

constexpr std::int64_t kDay = 86400;

class CopiedBatch : public testing::Test {
 protected:
  CopiedBatch() : disk_(std::in_place), store_(demand(Store::open(folder_.file("trammel.db")))) {
    trainer_ = std::make_unique<Trainer>(cells_, *store_, registry_, TrainerOptions{});
    trainer_->set_decides(false);
  }
  /// As the server that writes tells it first.
  [[nodiscard]] StoredBatch there(const std::string& id, std::int64_t accepted_at, std::uint64_t seed = 1) const {
    StoredBatch batch;
    batch.cell = "cell-7";
    batch.id = id;
    batch.csv = test::small_batch_csv(*cells_.at("cell-7"), {.seed = seed});
    batch.hash = sha256_hex(batch.csv);
    batch.accepted_at = accepted_at;
    return batch;
  }
  /// A batch that the server that writes has learned from.
  void learned(const std::string& id, std::int64_t accepted_at, std::uint64_t seed) {
    StoredBatch batch = there(id, accepted_at, seed);
    batch.learned = true;
    ASSERT_TRUE(trainer_->adopt_batch(batch, "writer"));
  }
  [[nodiscard]] StoredBatch here(const std::string& id) const { return demand(store_->batch_record("cell-7", id)); }
  [[nodiscard]] std::vector<std::string> earlier_than(const std::string& id, const SessionRule& rule) const {
    StoredJob job;
    job.cell = "cell-7";
    job.batch_ids = {id};
    return demand(earlier_sessions(*store_, job, rule, 100'000));
  }

  test::TemporaryFolder folder_;
  std::optional<test::FaultyDisk> disk_;
  ServedCells cells_ = {{"cell-7", test::small_cell("cell-7")}};
  std::unique_ptr<Store> store_;
  ModelRegistry registry_;
  std::unique_ptr<Trainer> trainer_;
};

TEST_F(CopiedBatch, WasAcceptedWhenTheFirstServerAcceptedItAndNeverLaterThanNow) {
  const std::int64_t now = unix_now();
  ASSERT_TRUE(trainer_->adopt_batch(there("old", now - 400 * kDay), "writer"));
  EXPECT_EQ(here("old").accepted_at, now - 400 * kDay);
  for (const std::int64_t nonsense : {now + 10 * kDay, std::int64_t{0}, std::int64_t{-5}}) {
    const std::string id = fmt::format("b{}", nonsense);
    ASSERT_TRUE(trainer_->adopt_batch(there(id, nonsense), "writer"));
    EXPECT_GE(here(id).accepted_at, now);
    EXPECT_LE(here(id).accepted_at, unix_now());
  }
}

TEST_F(CopiedBatch, IsInTheWindowOfDaysByItsOwnTimeInWhateverOrderCopiesCame) {
  const std::int64_t now = unix_now();
  learned("yesterday", now - kDay, 1);
  learned("last-year", now - 365 * kDay, 2);
  learned("today", now, 3);
  EXPECT_EQ(earlier_than("today", {SessionRule::Kind::kDays, 30}), std::vector<std::string>{"yesterday"});
}

TEST_F(CopiedBatch, IsNoEarlierSessionOnceItsTextIsPruned) {
  const std::int64_t now = unix_now();
  learned("a", now - 3, 1);
  learned("b", now - 2, 2);
  learned("c", now - 1, 3);
  SQLite::Database(folder_.file("trammel.db"), SQLite::OPEN_READWRITE)
      .exec("INSERT INTO pruned (kind, cell, id) VALUES ('batch', 'cell-7', 'b')");
  EXPECT_EQ(earlier_than("c", {SessionRule::Kind::kLast, 10}), std::vector<std::string>{"a"});
}

TEST_F(CopiedBatch, AJobThatIsOverElsewhereWaitsUntilTheDiskTakesThatAndIsOverThen) {
  StoredBatch batch = there("lt-1", unix_now());
  ASSERT_TRUE(trainer_->adopt_batch(batch, "writer"));
  ASSERT_EQ(trainer_->queued_jobs(), 1);
  batch.csv = "";
  batch.outcome = "in force";
  disk_->refuse_writing(SQLITE_FULL);
  const Status refused = trainer_->adopt_batch(batch, "writer");
  ASSERT_FALSE(refused) << "the writer would not tell it again";
  EXPECT_EQ(refused.error().code, ErrorCode::kBusy);
  EXPECT_EQ(trainer_->queued_jobs(), 1);
  disk_->work_again();
  ASSERT_TRUE(store_->wait_until_writable({}));
  ASSERT_TRUE(trainer_->adopt_batch(batch, "writer"));
  EXPECT_EQ(trainer_->queued_jobs(), 0);
  EXPECT_EQ(demand(store_->job(here("lt-1").job)).message, "writer: in force");
}

}  // namespace
}  // namespace trammel
