#include <gtest/gtest.h>

#include "tests/store/store_under_test.h"
#include "tests/support/postgres.h"

namespace trammel {
namespace {

using test::demand;

/// On each kind of database.
class ChangesTest : public testing::TestWithParam<std::string>, protected test::StoreUnderTest {
 protected:
  ChangesTest()
      : StoreUnderTest(GetParam() == "file" ? "" : test::Postgres::of_program().new_store()) {}
  static void SetUpTestSuite() { test::Postgres::of_program(); }
  void SetUp() override {
    open();
    for (int version = 1; version <= 3; ++version) add_model(version, true);
  }
  static StoredJob job() { return test::job_of("lt-07"); }

  const ChangeId id_{"robot-3:17", "what is asked for"};
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
  const std::int64_t brought = submit(test::batch_of("lt-07"));
  const auto first = demand(store_->add_job(job(), false, id_));
  EXPECT_NE(first.id, brought);
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
