#include "server/store/store_copy.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "server/compensate/model_file.h"
#include "server/store/audit.h"
#include "tests/store/store_under_test.h"
#include "tests/support/postgres.h"

namespace trammel {
namespace {

using test::demand;

class StoreCopyTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { test::Postgres::of_program(); }
  /// A bit of everything, also bytes that no text may hold.
  void SetUp() override {
    const auto store = demand(Store::open(file_));
    const std::string csv("# \xC3\xA4 \xFF\0 end\r\n", 13);
    const StoredJob job = test::job_of("lt-07");
    const auto made = demand(store->add_batch(test::batch_of("lt-07", csv, "client:1"), job));
    JobOutcome outcome;
    outcome.verdict = JobVerdict::kInForce;
    outcome.after = 0.1 + 0.2;
    ASSERT_TRUE(store->add_model("cell-7", test::nominal_model(cell_, 1), made.id, true, "made", false, {}, outcome));
    ASSERT_TRUE(store->add_model("cell-7", test::nominal_model(cell_, 2), 0, true, "better"));
    ASSERT_TRUE(store->rollback("cell-7", 1, {"robot-3:17", "roll back"}));
    ASSERT_TRUE(store->set_quarantine("cell-7", "lt-07", "odd"));
    ASSERT_TRUE(store->add_diagnosis(job, {csv, true, "", ""}));
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
  /// What is served, and what else a client sees.
  std::string seen(const std::string& place) {
    const auto store = demand(Store::open(place));
    std::string all = fmt::format("in force {}", demand(store->version_in_force("cell-7")).value_or(0));
    for (const StoredModel& model : demand(store->models("cell-7")))
      all += "\n" + demand(store->model_text("cell-7", model.version));
    for (const StoredJob& job : demand(store->recent_jobs("", 10)))
      all += fmt::format("\njob {} {} {}", job.id, job.message, job.outcome.after.value_or(0));
    all += demand(store->batch("cell-7", "lt-07")).csv + demand(store->batch("cell-7", "lt-07")).quarantine;
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
  expect_same(demand(copy_store(file_, url_)), before);
  EXPECT_EQ(seen(url_), was);
  EXPECT_FALSE(demand(read_audit(url_, {})).broken);
  EXPECT_EQ(demand(read_audit(url_, {})).rows.back().what, "copy") << "the trail says where it came from";
  const StoreContent there = demand(look_through_store(url_));
  expect_same(demand(copy_store(url_, back_)), there);
  EXPECT_EQ(seen(back_), was);
}

TEST_F(StoreCopyTest, ACopyGoesOnWhereTheOtherEnded) {
  static_cast<void>(demand(copy_store(file_, url_)));
  const auto store = demand(Store::open(url_));
  EXPECT_EQ(demand(store->add_model("cell-7", test::nominal_model(cell_, 3), 0, true, "made")), 3);
  const std::int64_t last = demand(store->recent_jobs("", 10)).back().id;
  const auto next = demand(store->add_batch(test::batch_of("lt-08"), test::job_of("lt-08")));
  EXPECT_EQ(next.id, last + 1);
}

TEST_F(StoreCopyTest, RefusesATargetThatIsNotEmptyAndASourceThatIsServed) {
  static_cast<void>(demand(copy_store(file_, url_)));
  EXPECT_EQ(copy_store(file_, url_).error().code, ErrorCode::kRefused);
  EXPECT_EQ(copy_store(url_, file_).error().code, ErrorCode::kRefused);
  const auto serving = demand(Store::open(file_));
  EXPECT_EQ(copy_store(file_, postgres_.new_database()).error().code, ErrorCode::kConflict);
}

TEST_F(StoreCopyTest, ADamagedStoreIsFoundAndNoCopyOfItIsLeft) {
  SQLite::Database(file_, SQLite::OPEN_READWRITE).exec("UPDATE batches SET csv = 'other'");
  EXPECT_EQ(look_through_store(file_).error().code, ErrorCode::kInternal);
  EXPECT_FALSE(copy_store(file_, back_));
  EXPECT_FALSE(std::filesystem::exists(back_));
  EXPECT_FALSE(copy_store(file_, url_));
  EXPECT_EQ(postgres_.sql(url_, "SELECT count(*) FROM batches"), "0\n");
}

TEST_F(StoreCopyTest, NamesWhatIsNotThere) {
  const auto none = look_through_store(folder_.file("no.db"));
  EXPECT_EQ(none.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(none.error().next, "its path stands in the server file as store");
  const auto away = look_through_store("postgresql://somebody@127.0.0.1:1/plant");
  EXPECT_EQ(away.error().next, "see that PostgreSQL runs there");
  EXPECT_EQ(copy_store(folder_.file("no.db"), url_).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(look_through_store(postgres_.new_database()).error().code, ErrorCode::kRefused);
}

}  // namespace
}  // namespace trammel
