// The history of a cell in a record that several servers share, where others are in the way.
#include <gtest/gtest.h>

#include "server/trainer/trainer.h"
#include "tests/support/demand.h"
#include "tests/support/postgres.h"
#include "tests/support/small_cell.h"

namespace trammel {
namespace {

using test::demand;

class SharedHistory : public testing::Test {
 protected:
  static void SetUpTestSuite() { test::Postgres::of_program(); }
  SharedHistory() {
    for (int poses = 1; poses <= 3; ++poses)
      EXPECT_TRUE(store_->add_model("cell-7", test::nominal_model(cells_.at("cell-7"), poses), 0,
                                    true, "made"));
    EXPECT_TRUE(demand(trainer_.take_up()).empty());
  }
  int served() {
    const auto model = registry_.in_force("cell-7");
    return model ? model->version : 0;
  }

  const std::string url_ = test::Postgres::of_program().new_store();
  const std::unique_ptr<Store> store_ = demand(Store::open(url_));
  const ServedCells cells_ = {{"cell-7", test::small_cell("cell-7")}};
  ModelRegistry registry_;
  Trainer trainer_{cells_, *store_, registry_, TrainerOptions{}};
};

TEST_F(SharedHistory, ARollbackStepsPastNoVersionThatOnlyCannotBeReadNow) {
  ASSERT_TRUE(registry_.version("cell-7", 1));  // in memory, as version 2 is not
  {
    const test::LockedTable somebody(url_, "models", "ACCESS EXCLUSIVE");
    const auto refused = trainer_.rollback("cell-7", {"r", "roll back cell-7"});
    ASSERT_FALSE(refused) << "version " << *refused;
    EXPECT_EQ(refused.error().code, ErrorCode::kBusy);
  }
  ASSERT_TRUE(store_->wait_until_writable({}));
  EXPECT_EQ(demand(trainer_.rollback("cell-7", {"r", "roll back cell-7"})), 2);
  EXPECT_EQ(served(), 2);
}

TEST_F(SharedHistory, AModelThatIsJudgedWhileOthersDecideAllTheTimeIsTriedAgainAndHasNotFailed) {
  const auto other = demand(Store::open(url_));
  const CompensatedModel made = test::nominal_model(cells_.at("cell-7"), 4);
  StoredJob asked;
  asked.cell = "cell-7";
  asked.batch_ids = {"b1"};
  asked = demand(
      store_->add_batch({"cell-7", "b1", "q1_deg\n", "hash", "client:1", 1700000000, 1}, asked));
  ASSERT_TRUE(store_->set_job_running(asked.id));
  const CellBook cells(cells_);
  ModelRegistry registry;
  ModelHistory history(cells, *store_, registry);
  bool changes = true;
  const Judging judging = [&](const Opponents&) -> Result<GateVerdict> {
    const int now = demand(other->version_in_force("cell-7")).value_or(0);
    if (changes) {
      EXPECT_TRUE(other->activate("cell-7", now == 2 ? 3 : 2));
    }
    return GateVerdict{true, "better"};
  };
  const auto refused = history.keep({made, asked}, judging);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kBusy) << sentence(refused.error());
  changes = false;
  EXPECT_EQ(demand(history.keep({made, asked}, judging)).version, 4);
}

TEST_F(SharedHistory, WhatIsInForceOfEachCellIsAnnouncedFromOneLook) {
  EXPECT_EQ(registry_.version_in_force("cell-7"), 3);
  EXPECT_EQ(served(), 3);
}

}  // namespace
}  // namespace trammel
