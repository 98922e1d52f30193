#include "server/store/audit.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>

#include "server/store/audit_json.h"
#include "tests/store/store_under_test.h"

namespace trammel {
namespace {

using test::demand;

class AuditTest : public testing::Test, protected test::StoreUnderTest {
 protected:
  void SetUp() override { open(); }
  std::int64_t submit(const std::string& id) {
    StoredBatch batch = test::batch_of(id);
    batch.who = "robot-3";
    return StoreUnderTest::submit(batch);
  }
  int train(const std::string& id, bool put_in_force) {
    return demand(store_->add_model("cell-7", test::nominal_model(cell_, ++trained_), submit(id),
                                    put_in_force, "judged"));
  }
  std::vector<std::string> told(const AuditTrail& trail) {
    std::vector<std::string> lines;
    for (const AuditRow& row : trail.rows)
      lines.push_back(fmt::format("{} {}: {} -> {} by {}", row.what, row.subject, row.before,
                                  row.after, row.who));
    return lines;
  }
  void alter(const std::string& sql) {
    store_.reset();
    SQLite::Database(path_, SQLite::OPEN_READWRITE).exec(sql);
  }

  int trained_ = 0;
};

TEST_F(AuditTest, EveryChangeIsToldOnceWithWhoAskedForItAndWhatItChanged) {
  train("lt-07", true);
  train("lt-08", false);
  ASSERT_TRUE(store_->activate("cell-7", 2, {"c:1", "activate 2", "anna", "the old one drifts"}));
  ASSERT_TRUE(store_->activate("cell-7", 2, {"c:1", "activate 2", "anna"}))
      << "the repeat changes nothing";
  ASSERT_TRUE(store_->activate("cell-7", 2)) << "nor does what is so already";
  ASSERT_TRUE(store_->rollback("cell-7", 1, {"c:2", "back", "bert"}));
  ASSERT_TRUE(store_->set_quarantine("cell-7", "lt-08", "strange"));
  ASSERT_TRUE(store_->set_quarantine("cell-7", "lt-08", "", {"c:3", "release", "anna"}));
  ASSERT_FALSE(store_->activate("cell-7", 9, {"c:4", "activate 9", "anna"}))
      << "what is refused changes nothing";
  const AuditTrail trail = demand(store_->audit());
  EXPECT_FALSE(trail.broken);
  EXPECT_EQ(trail.verified, static_cast<std::int64_t>(trail.rows.size()));
  const std::vector<std::string> lines = told(trail);
  ASSERT_EQ(lines.size(), 10u) << fmt::format("{}", fmt::join(lines, "\n"));
  EXPECT_EQ(lines[0], "store store:  -> schema 2 by service");
  EXPECT_TRUE(lines[1].starts_with("batch batch lt-07:  -> 1 poses, sha256 ")) << lines[1];
  EXPECT_TRUE(lines[1].ends_with("job 1 by robot-3")) << lines[1];
  EXPECT_TRUE(lines[2].starts_with("model version 1:  -> sha256 ")) << lines[2];
  EXPECT_EQ(lines[3], "put in force in force: none -> version 1 by service");
  EXPECT_EQ(lines[6], "activate in force: version 1 -> version 2 by anna");
  EXPECT_EQ(trail.rows[6].why, "the old one drifts");
  EXPECT_EQ(trail.rows[6].request, "c:1");
  EXPECT_EQ(lines[7], "rollback in force: version 2 -> version 1 by bert");
  EXPECT_EQ(lines[8], "quarantine batch lt-08: free -> in quarantine: strange by service");
  EXPECT_EQ(lines[9], "release batch lt-08: in quarantine: strange -> free by anna");
}

TEST_F(AuditTest, WhateverIsChangedAfterwardsTheFirstBrokenRowIsNamed) {
  for (int i = 0; i < 6; ++i) train("lt-" + std::to_string(i), true);
  store_.reset();
  const std::string good = test::read_file(path_);
  const std::int64_t rows = demand(read_audit(path_, {})).verified;
  ASSERT_EQ(rows, 19);
  const std::pair<std::string, long> kinds[] = {
      {"UPDATE audit SET who = 'nobody' WHERE number = 5", 5},
      {"UPDATE audit SET after = 'version 9' WHERE number = 7", 7},
      {"UPDATE audit SET at = at - 60 WHERE number = 9", 9},
      {"DELETE FROM audit WHERE number = 8", 8},
      {"DELETE FROM audit WHERE number > 16", 17},
      {"UPDATE audit SET number = 100 WHERE number = 19", 19},
      {"UPDATE audit SET hash_before = hash WHERE number = 4", 4},
      {"UPDATE audit SET what = 'rollback', hash = 'forged' WHERE number = 12", 12},
  };
  for (const auto& [sql, row] : kinds) {
    std::ofstream(path_, std::ios::binary) << good;
    alter(sql);
    const auto trail = demand(read_audit(path_, {}));
    ASSERT_TRUE(trail.broken) << sql;
    EXPECT_EQ(trail.broken->row, row) << sql << ": " << sentence(*trail.broken);
    EXPECT_EQ(trail.verified, row - 1) << sql;
  }
}

TEST_F(AuditTest, ARowThatWasForgedWithItsHashIsFoundByTheNextOne) {
  for (int i = 0; i < 3; ++i) train("lt-" + std::to_string(i), true);
  AuditRow forged = demand(store_->audit()).rows[4];
  forged.who = "nobody";
  alter(fmt::format("UPDATE audit SET who = 'nobody', hash = '{}' WHERE number = 5",
                    hash_of(forged)));
  EXPECT_EQ(demand(read_audit(path_, {})).broken->row, 6);
}

TEST_F(AuditTest, IsReadBesideARunningServiceByCellByTimeAndTheNewest) {
  train("lt-07", true);
  const auto other = test::small_cell("cell-8");
  ASSERT_TRUE(store_->add_model("cell-8", test::nominal_model(other, 1), 0, true, ""));
  EXPECT_EQ(demand(read_audit(path_, {})).rows.size(), demand(store_->audit()).rows.size());
  const AuditTrail of_one = demand(read_audit(path_, {"cell-8"}));
  ASSERT_EQ(of_one.rows.size(), 2u);
  EXPECT_EQ(of_one.rows.front().what, "import");
  EXPECT_EQ(of_one.verified, 6) << "it is verified as a whole";
  const AuditTrail newest = demand(store_->audit({"", 0, 2}));
  ASSERT_EQ(newest.rows.size(), 2u);
  EXPECT_EQ(newest.rows.back().number, 6);
  EXPECT_TRUE(demand(store_->audit({"", 4'000'000'000, 0})).rows.empty());
  EXPECT_FALSE(read_audit(folder_.write("no.db", "nothing"), {}));
}

TEST_F(AuditTest, AsJsonItIsTheSame) {
  train("lt-07", true);
  const AuditTrail trail = demand(store_->audit());
  const AuditTrail again = demand(audit_of_json(audit_json(trail).dump()));
  ASSERT_EQ(again.rows.size(), trail.rows.size());
  for (std::size_t i = 0; i < trail.rows.size(); ++i)
    EXPECT_EQ(hash_of(again.rows[i]), trail.rows[i].hash);
  EXPECT_FALSE(audit_of_json("{}"));
}

TEST_F(AuditTest, WhereAnotherVersionIsInForceThanExpectedNothingChangesAndNothingIsTold) {
  train("lt-07", true);
  const auto before = demand(store_->audit()).rows.size();
  ChangeId id{"c:1", "train", "anna"};
  id.expected_version = 3;
  const auto refused = store_->add_job(test::job_of("lt-07"), false, id);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kConflict);
  EXPECT_NE(refused.error().message.find("service put it in force"), std::string::npos)
      << refused.error().message;
  EXPECT_EQ(store_->set_quarantine("cell-7", "lt-07", "strange", id).error().code,
            ErrorCode::kConflict);
  EXPECT_EQ(demand(store_->audit()).rows.size(), before);
  id.expected_version = 1;
  const auto queued = demand(store_->add_job(test::job_of("lt-07"), false, id));
  train("lt-08", true);
  EXPECT_EQ(demand(store_->add_job(test::job_of("lt-07"), false, id)).id, queued.id)
      << "the repeat of what was done is none";
}

TEST_F(AuditTest, WhatIsDiscardedIsTakenByNothingAnyMore) {
  submit("lt-07");
  ChangeId id{"c:1", "discard", "anna", "the tracker was warm"};
  ASSERT_TRUE(store_->discard("cell-7", "lt-07", id));
  ASSERT_TRUE(store_->discard("cell-7", "lt-07", id));
  EXPECT_EQ(store_->set_quarantine("cell-7", "lt-07", "").error().code, ErrorCode::kConflict);
  EXPECT_EQ(store_->add_job(test::job_of("lt-07"), true).error().code, ErrorCode::kConflict);
  const AuditTrail trail = demand(store_->audit());
  ASSERT_EQ(trail.rows.size(), 3u);
  EXPECT_EQ(told(trail).back(),
            "discard batch lt-07: free -> discarded: the tracker was warm by anna");
}

TEST_F(AuditTest, PruningTakesTheOldestTextsButNeverWhatIsNeeded) {
  for (int i = 1; i <= 8; ++i) train("lt-" + std::to_string(i), i == 2 || i == 5);
  ASSERT_TRUE(store_->rollback("cell-7")) << "2 is in force";
  ASSERT_TRUE(store_->activate("cell-7", 5));
  const KeepRule rule{2, 1, 0};
  int pruned = 0;
  while (demand(store_->prune_one("cell-7", rule))) ++pruned;
  std::vector<int> there;
  for (int version = 1; version <= 8; ++version) {
    if (store_->model_text("cell-7", version)) there.push_back(version);
  }
  EXPECT_EQ(there, (std::vector{2, 5, 7, 8}))
      << "in force, what a rollback returns to, the newest two";
  std::vector<std::string> batches;
  for (const StoredBatch& batch : demand(store_->batches("cell-7"))) {
    if (store_->batch("cell-7", batch.id)) batches.push_back(batch.id);
  }
  EXPECT_EQ(batches, (std::vector<std::string>{"lt-2", "lt-5", "lt-8"}))
      << "trained on, and the newest";
  EXPECT_EQ(pruned, 4 + 5);
  EXPECT_EQ(demand(store_->models("cell-7")).size(), 8u) << "records stay";
  EXPECT_EQ(store_->activate("cell-7", 1).error().code, ErrorCode::kNotFound);
  const AuditTrail trail = demand(store_->audit());
  EXPECT_FALSE(trail.broken);
  EXPECT_EQ(std::count_if(trail.rows.begin(), trail.rows.end(),
                          [](const AuditRow& row) { return row.what == "prune"; }),
            pruned);
  EXPECT_EQ(demand(store_->rollback("cell-7")), 2);
}

}  // namespace
}  // namespace trammel
