#include "server/store/store_copy.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "server/compensate/model_file.h"
#include "server/store/audit.h"
#include "server/store/moved.h"
#include "server/store/reopen.h"
#include "server/store/store_check.h"
#include "server/store/store_place.h"
#include "tests/store/store_under_test.h"
#include "tests/support/postgres.h"

namespace trammel {
namespace {

using test::demand;
constexpr SourceAfter kKept = SourceAfter::kKept;

class StoreCopyTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { test::Postgres::of_program(); }
  /// A bit of everything, also bytes that no text may hold.
  void SetUp() override {
    const auto store = demand(Store::open(file_));
    const std::string csv("# \xC3\xA4 \xFF\0 end\r\n", 13);
    StoredJob job = test::job_of("lt-07");
    const auto made = demand(store->add_batch(test::batch_of("lt-07", csv, "client:1"), job));
    JobOutcome outcome;
    outcome.verdict = JobVerdict::kInForce;
    outcome.after = 0.1 + 0.2;
    outcome.held_back = HeldBack::kFewJudges;
    ASSERT_TRUE(store->add_model("cell-7", test::nominal_model(cell_, 1), made.id, true, "made",
                                 false, {}, outcome));
    ASSERT_TRUE(store->add_model("cell-7", test::nominal_model(cell_, 2), 0, true, "better"));
    ASSERT_TRUE(store->rollback("cell-7", 1, {"robot-3:17", "roll back"}));
    ASSERT_TRUE(store->set_quarantine("cell-7", "lt-07", "odd"));
    job.asked = AskedDiagnosis{true};
    ASSERT_TRUE(store->add_diagnosis(job, csv));
    job.asked = AskedCheck{0.1e-3};
    ASSERT_TRUE(store->add_diagnosis(job, csv));
  }
  static void expect_same(const StoreContent& a, const StoreContent& b) {
    EXPECT_EQ(a.identity, b.identity);
    ASSERT_EQ(a.tables.size(), b.tables.size());
    for (std::size_t i = 0; i < a.tables.size(); ++i) {
      EXPECT_EQ(a.tables[i].name, b.tables[i].name);
      EXPECT_EQ(a.tables[i].rows, b.tables[i].rows) << a.tables[i].name;
      EXPECT_EQ(a.tables[i].sha256, b.tables[i].sha256) << a.tables[i].name;
    }
    EXPECT_EQ(a.audit_hash, b.audit_hash);
  }
  /// The version that is served, and what else a client sees.
  std::string seen(const std::string& place) {
    const auto store = demand(Store::open(place));
    std::string all =
        fmt::format("in force {}", demand(store->version_in_force("cell-7")).value_or(0));
    for (const StoredModel& model : demand(store->models("cell-7")))
      all += "\n" + demand(store->model_text("cell-7", model.version));
    for (const StoredJob& job : demand(store->recent_jobs("", 10)))
      all += fmt::format("\njob {} {} {}", job.id, job.message, job.outcome.after.value_or(0));
    all += demand(store->batch("cell-7", "lt-07")).csv +
           demand(store->batch("cell-7", "lt-07")).quarantine;
    all += fmt::format("\n{}", demand(store->outcome_of({"robot-3:17", "roll back"}))->version);
    return all;
  }

  test::Postgres& postgres_ = test::Postgres::of_program();
  test::TemporaryFolder folder_;
  const std::string file_ = folder_.file("trammel.db");
  const std::string back_ = folder_.file("back.db");
  const std::string url_ = postgres_.new_database();
  const std::shared_ptr<const Cell> cell_ = test::small_cell("cell-7");
};

TEST_F(StoreCopyTest, ThereAndBackNothingIsLostAndTheAnswersAreTheSame) {
  const StoreContent before = demand(look_through_store(file_));
  const std::string was = seen(file_);
  expect_same(demand(copy_store(file_, url_, kKept)), before);
  EXPECT_EQ(seen(url_), was);
  EXPECT_FALSE(demand(read_audit(url_, {})).broken);
  EXPECT_EQ(demand(read_audit(url_, {})).rows.back().what, "copy")
      << "the trail says where it came from";
  const StoreContent there = demand(look_through_store(url_));
  expect_same(demand(copy_store(url_, back_, kKept)), there);
  EXPECT_EQ(seen(back_), was);
}

TEST_F(StoreCopyTest, ACopyGoesOnWhereTheOtherEnded) {
  static_cast<void>(demand(copy_store(file_, url_, kKept)));
  const auto store = demand(Store::open(url_));
  EXPECT_EQ(demand(store->add_model("cell-7", test::nominal_model(cell_, 3), 0, true, "made")), 3);
  const std::int64_t last = demand(store->recent_jobs("", 10)).back().id;
  const auto next = demand(store->add_batch(test::batch_of("lt-08"), test::job_of("lt-08")));
  EXPECT_EQ(next.id, last + 1);
}

TEST_F(StoreCopyTest, RefusesATargetThatIsNotEmptyAndASourceThatIsServed) {
  static_cast<void>(demand(copy_store(file_, url_, kKept)));
  EXPECT_EQ(copy_store(file_, url_, kKept).error().code, ErrorCode::kRefused);
  EXPECT_EQ(copy_store(url_, file_, kKept).error().code, ErrorCode::kRefused);
  const auto serving = demand(Store::open(file_));
  EXPECT_EQ(copy_store(file_, postgres_.new_database(), kKept).error().code, ErrorCode::kConflict);
}

TEST_F(StoreCopyTest, AStoreThatWasMovedIsServedByNobodyUntilSomebodyGivesTheOtherUp) {
  static_cast<void>(demand(copy_store(file_, url_, SourceAfter::kMoved)));
  const auto expect_moved = [](const Error& error, const std::string& to,
                               const std::string& place) {
    EXPECT_EQ(error.code, ErrorCode::kRefused);
    EXPECT_NE(error.message.find("was moved to " + spoken_place(to) + " at 20"), std::string::npos)
        << sentence(error);
    EXPECT_NE(error.next.find("trammel store reopen '" + spoken_place(place)), std::string::npos)
        << error.next;
  };
  expect_moved(Store::open(file_).error(), url_, file_);
  expect_moved(check_store(file_).error(), url_, file_);
  expect_moved(copy_store(file_, folder_.file("again.db"), SourceAfter::kMoved).error(), url_,
               file_);
  EXPECT_FALSE(demand(read_audit(file_, {})).broken);
  {
    const auto served = demand(Store::open(url_));
    static_cast<void>(demand(copy_store(url_, back_, SourceAfter::kMoved)));
    const auto refused = served->activate("cell-7", 2);
    ASSERT_FALSE(refused) << "a service that was connected changes nothing any more";
    EXPECT_EQ(refused.error().code, ErrorCode::kBusy);
    EXPECT_NE(refused.error().message.find("was moved elsewhere"), std::string::npos)
        << sentence(refused.error());
    EXPECT_FALSE(served->try_again());
  }
  expect_moved(Store::open(url_).error(), back_, url_);
  expect_moved(check_store(url_).error(), back_, url_);
  EXPECT_TRUE(Store::open(back_));
  for (const std::string& place : {file_, url_}) {
    EXPECT_TRUE(reopen_store(place)) << place;
    EXPECT_TRUE(demand(Store::open(place))->activate("cell-7", 2));
    EXPECT_EQ(reopen_store(place).error().code, ErrorCode::kRefused) << "it was not moved";
  }
}

TEST_F(StoreCopyTest, WhatAServiceChangesWhileItsDatabaseIsMovedIsInTheCopyOrRefused) {
  static_cast<void>(demand(copy_store(file_, url_, kKept)));
  const auto served = demand(Store::open(url_));
  Result<StoredJob> meanwhile = tl::make_unexpected(Error{});
  const auto moved = copy_store(url_, back_, SourceAfter::kMoved, [&](double) {
    if (meanwhile || !meanwhile.error().message.empty()) return;  // once, with the first row
    meanwhile = served->add_batch(test::batch_of("lt-08"), test::job_of("lt-08"));
  });
  ASSERT_TRUE(moved) << sentence(moved.error());
  EXPECT_FALSE(meanwhile) << "the store does not change while it is read";
  EXPECT_EQ(meanwhile.error().code, ErrorCode::kBusy);
  EXPECT_EQ(postgres_.sql(url_, "SELECT count(*) FROM batches"), "1\n");
}

TEST_F(StoreCopyTest, ACopyMayTakeAsLongAsItTakes) {
  static_cast<void>(demand(copy_store(file_, url_, kKept)));
  // A table of the source that can be read only where the server ends no transaction that is quiet
  // for long.
  postgres_.sql(
      url_,
      "ALTER TABLE discarded RENAME TO discarded_rows;CREATE FUNCTION patient() RETURNS boolean "
      "LANGUAGE plpgsql AS $$ BEGIN IF current_setting('idle_in_transaction_session_timeout') <> "
      "'0' OR current_setting('statement_timeout') <> '0' THEN RAISE EXCEPTION 'hurries'; END IF; "
      "RETURN true; END $$;CREATE VIEW discarded AS SELECT * FROM discarded_rows WHERE patient() "
      "UNION ALL SELECT 'no', 'row' WHERE NOT patient()");
  const auto copied = copy_store(url_, back_, kKept);
  EXPECT_TRUE(copied) << sentence(copied.error());
  EXPECT_TRUE(look_through_store(url_));
  EXPECT_TRUE(copy_store(url_, folder_.file("moved.db"), SourceAfter::kMoved));
}

TEST_F(StoreCopyTest, ASchemaThatHoldsMoreThanThisProgramKnowsIsNotCopied) {
  static_cast<void>(demand(copy_store(file_, url_, kKept)));
  postgres_.sql(url_, "UPDATE trammel_schema SET version = version + 1");
  EXPECT_TRUE(Store::open(url_)) << "it is served";
  const auto refused = copy_store(url_, back_, kKept);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().field, "schema") << sentence(refused.error());
  EXPECT_FALSE(std::filesystem::exists(back_));
}

TEST_F(StoreCopyTest, ADamagedStoreIsFoundAndNoCopyOfItIsLeft) {
  SQLite::Database(file_, SQLite::OPEN_READWRITE).exec("UPDATE batches SET csv = 'other'");
  EXPECT_EQ(look_through_store(file_).error().code, ErrorCode::kInternal);
  EXPECT_FALSE(copy_store(file_, back_, kKept));
  EXPECT_FALSE(std::filesystem::exists(back_));
  EXPECT_FALSE(copy_store(file_, url_, kKept));
  EXPECT_EQ(postgres_.sql(url_, "SELECT count(*) FROM batches"), "0\n");
}

TEST_F(StoreCopyTest, NamesWhatIsNotThere) {
  const auto none = look_through_store(folder_.file("no.db"));
  EXPECT_EQ(none.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(none.error().next, "its path stands in the server file as store");
  const auto away = look_through_store("postgresql://somebody@127.0.0.1:1/plant");
  EXPECT_EQ(away.error().next, "see that PostgreSQL runs there");
  EXPECT_EQ(copy_store(folder_.file("no.db"), url_, kKept).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(look_through_store(postgres_.new_database()).error().code, ErrorCode::kRefused);
}

}  // namespace
}  // namespace trammel
