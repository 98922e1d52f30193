// Which batches of before a training takes beside its own.
#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include "server/base/hash.h"
#include "server/base/unix_time.h"
#include "server/trainer/job_sources.h"
#include "tests/support/demand.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

using test::demand;

constexpr std::int64_t kDay = 86400;

class EarlierSessions : public testing::Test {
 protected:
  /// A batch that a model was made of.
  void learned(const std::string& id, std::int64_t accepted_at) {
    StoredJob job;
    job.cell = "cell-7";
    job.batch_ids = {id};
    const std::string csv = "q1_deg\n" + id + "\n";
    const auto added = demand(
        store_->add_batch({"cell-7", id, csv, sha256_hex(csv), "client:1", accepted_at, 12}, job));
    const int poses = 40 + static_cast<int>(added.id);
    ASSERT_TRUE(
        store_->add_model("cell-7", test::nominal_model(cell_, poses), added.id, true, "made"));
  }
  [[nodiscard]] std::vector<std::string> earlier_than(const std::string& id,
                                                      const SessionRule& rule) const {
    StoredJob job;
    job.cell = "cell-7";
    job.batch_ids = {id};
    return demand(earlier_sessions(*store_, job, rule, 100'000));
  }

  test::TemporaryFolder folder_;
  const std::shared_ptr<const Cell> cell_ = test::small_cell("cell-7");
  const std::unique_ptr<Store> store_ = demand(Store::open(folder_.file("trammel.db")));
  const std::int64_t now_ = unix_now();
};

TEST_F(EarlierSessions,
       AreInTheWindowOfDaysByTheirOwnTimeInWhateverOrderServersWithOtherClocksTookThem) {
  learned("yesterday", now_ - kDay);
  learned("last-year", now_ - 365 * kDay);
  learned("today", now_);
  EXPECT_EQ(earlier_than("today", {SessionRule::Kind::kDays, 30}),
            std::vector<std::string>{"yesterday"});
}

TEST_F(EarlierSessions, HaveNoneWhoseTextIsPruned) {
  learned("a", now_ - 3);
  learned("b", now_ - 2);
  learned("c", now_ - 1);
  SQLite::Database(folder_.file("trammel.db"), SQLite::OPEN_READWRITE)
      .exec("INSERT INTO pruned (kind, cell, id) VALUES ('batch', 'cell-7', 'b')");
  EXPECT_EQ(earlier_than("c", {SessionRule::Kind::kLast, 10}), std::vector<std::string>{"a"});
}

}  // namespace
}  // namespace trammel
