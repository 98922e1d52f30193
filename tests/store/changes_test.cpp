#include <gtest/gtest.h>

#include "server/base/hash.h"
#include "server/store/store.h"
#include "tests/support/demand.h"
#include "tests/support/postgres.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

using test::demand;

/// On each kind of database.
class ChangesTest : public testing::TestWithParam<std::string> {
 protected:
  static void SetUpTestSuite() { test::Postgres::of_program(); }
  void SetUp() override {
    for (int version = 1; version <= 3; ++version)
      ASSERT_TRUE(store_->add_model("cell-7", test::nominal_model(cell_, version), 0, true, ""));
  }
  void restart() {
    store_.reset();
    store_ = demand(Store::open(path_));
  }
  int in_force() { return demand(store_->version_in_force("cell-7")).value_or(0); }
  StoredJob job() {
    StoredJob job;
    job.cell = "cell-7";
    job.batch_ids = {"lt-07"};
    return job;
  }

  const ChangeId id_{"robot-3:17", "what is asked for"};
  test::TemporaryFolder folder_;
  const std::string path_ =
      GetParam() == "file" ? folder_.file("trammel.db") : test::Postgres::of_program().new_store();
  const std::shared_ptr<const Cell> cell_ = test::small_cell("cell-7");
  std::unique_ptr<Store> store_ = demand(Store::open(path_));
};

INSTANTIATE_TEST_SUITE_P(, ChangesTest, testing::Values("file", "postgresql"),
                         [](const auto& kind) { return kind.param; });

TEST_P(ChangesTest, ARollbackThatIsRepeatedAfterARestartRollsBackOnce) {
  EXPECT_EQ(demand(store_->rollback("cell-7", 1, id_)), 2);
  restart();
  EXPECT_EQ(demand(store_->rollback("cell-7", 1, id_)), 2);
  EXPECT_EQ(in_force(), 2);
  EXPECT_EQ(demand(store_->outcome_of(id_))->version, 2);
}

TEST_P(ChangesTest, ARepeatSaysWhatCameOfTheFirstThoughOthersChangedThingsSince) {
  ASSERT_TRUE(store_->activate("cell-7", 1, id_));
  ASSERT_TRUE(store_->activate("cell-7", 3));
  ASSERT_TRUE(store_->activate("cell-7", 1, id_));
  EXPECT_EQ(in_force(), 3);
}

TEST_P(ChangesTest, ATrainingOrADiagnosisThatIsAskedForAgainIsQueuedOnce) {
  const std::string csv = "q1_deg\n1\n";
  const auto brought = demand(store_->add_batch({"cell-7", "lt-07", csv, sha256_hex(csv), "client:1", 1, 1}, job()));
  const auto first = demand(store_->add_job(job(), false, id_));
  EXPECT_NE(first.id, brought.id);
  EXPECT_EQ(demand(store_->add_job(job(), false, id_)).id, first.id);
  const ChangeId other{"robot-3:18", "diagnose"};
  const auto diagnosis = demand(store_->add_diagnosis(job(), {}, other));
  restart();
  EXPECT_EQ(demand(store_->add_diagnosis(job(), {}, other)).id, diagnosis.id);
  EXPECT_EQ(demand(store_->unfinished_jobs()).size(), 3u);
}

TEST_P(ChangesTest, WhatWasRefusedLeavesNothingBehindAndMayBeAskedForAgain) {
  EXPECT_FALSE(store_->activate("cell-7", 9, id_));
  EXPECT_FALSE(demand(store_->outcome_of(id_)));
  ASSERT_TRUE(store_->add_model("cell-7", test::nominal_model(cell_, 4), 0, false, ""));
  EXPECT_TRUE(store_->activate("cell-7", 4, id_));
  EXPECT_EQ(in_force(), 4);
}

TEST_P(ChangesTest, AnIdStandsForOneChangeOnly) {
  ASSERT_TRUE(store_->activate("cell-7", 1, id_));
  const auto other = store_->rollback("cell-7", 1, {id_.id, "something else"});
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().code, ErrorCode::kConflict);
  EXPECT_EQ(store_->outcome_of({id_.id, "something else"}).error().code, ErrorCode::kConflict);
  EXPECT_EQ(in_force(), 1);
}

TEST_P(ChangesTest, WithoutAnIdEveryRequestIsAChange) {
  EXPECT_EQ(demand(store_->rollback("cell-7")), 2);
  EXPECT_EQ(demand(store_->rollback("cell-7")), 1);
}

}  // namespace
}  // namespace trammel
