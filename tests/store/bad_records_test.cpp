// A database that is not as it should be: each refusal has a code and words that name the place
// without the password, and nothing that was acknowledged is lost.
#include <gtest/gtest.h>

#include <random>
#include <set>
#include <thread>

#include "server/store/moved.h"
#include "server/store/store_check.h"
#include "server/store/store_copy.h"
#include "server/store/store_init.h"
#include "server/store/store_place.h"
#include "tests/store/store_under_test.h"
#include "tests/support/pooler.h"
#include "tests/support/postgres.h"

namespace trammel {
namespace {

using test::batch_of;
using test::demand;
using test::job_of;
using test::Postgres;

constexpr std::chrono::seconds kPatience{60};

std::set<std::string> batches_of(Store& store) {
  std::set<std::string> ids;
  for (const StoredBatch& one : demand(store.batches("cell-7"))) ids.insert(one.id);
  return ids;
}

/// The URL of the database for another role, perhaps with a password.
std::string as(std::string url, const std::string& who) {
  return url.replace(url.find("postgres@"), 8, who);
}

/// All on one server.
class BadRecord : public testing::Test {
 protected:
  static void SetUpTestSuite() { Postgres::of_program(); }
  std::unique_ptr<Store> open(const std::string& url) {
    return demand(Store::open(url, folder_.file("cache")));
  }
  std::string say(const std::string& sql) { return postgres_.sql(url_, sql); }

  Postgres& postgres_ = Postgres::of_program();
  const std::string url_ = postgres_.new_store();
  test::TemporaryFolder folder_;
  const std::shared_ptr<const Cell> cell_ = test::small_cell("cell-7");
};

TEST_F(BadRecord, AWrongPasswordAndNoneAreRefusedWithoutSayingIt) {
  ASSERT_TRUE(init_store(url_, "needs_password"));
  EXPECT_TRUE(Store::open(as(url_, "needs_password:right")));
  for (const char* who : {"needs_password:s3cret", "needs_password"}) {
    const std::string url = as(url_, who);
    for (const Error& refused : {Store::open(url).error(), check_store(url).error(),
                                 init_store(url).error(), look_through_store(url).error()}) {
      EXPECT_EQ(refused.code, ErrorCode::kRefused) << sentence(refused);
      EXPECT_EQ(refused.file, spoken_place(url));
      EXPECT_NE(refused.message.find("password"), std::string::npos) << sentence(refused);
      EXPECT_EQ(sentence(refused).find("s3cret"), std::string::npos) << sentence(refused);
      EXPECT_EQ(refused.next, "mend the URL, or what the database allows");
    }
  }
}

TEST_F(BadRecord, APasswordThatIsChangedWhileItServesStopsChangesUntilItIsRightAgain) {
  ASSERT_TRUE(init_store(url_, "needs_password"));
  const auto store = open(as(url_, "needs_password:right"));
  ASSERT_TRUE(store->add_model("cell-7", test::nominal_model(cell_, 1), 0, true, "made"));
  say("ALTER ROLE needs_password PASSWORD 'other'");
  say("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE usename = 'needs_password'");
  const auto refused = store->add_batch(batch_of("lt-07"), job_of("lt-07"));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kBusy) << sentence(refused.error());
  EXPECT_NE(refused.error().message.find("password"), std::string::npos)
      << sentence(refused.error());
  EXPECT_EQ(store->versions_to_serve("cell-7"), std::vector<int>{1}) << "from its copy";
  say("ALTER ROLE needs_password PASSWORD 'right'");
  ASSERT_TRUE(store->wait_until_writable({}));
  EXPECT_TRUE(store->add_batch(batch_of("lt-07"), job_of("lt-07")));
}

TEST_F(BadRecord, WhatIsMissingIsNamed) {
  const std::string none = postgres_.url("no_such_database");
  const auto no_database = Store::open(none);
  ASSERT_FALSE(no_database);
  EXPECT_EQ(no_database.error().code, ErrorCode::kRefused);
  EXPECT_NE(no_database.error().message.find("no_such_database"), std::string::npos)
      << sentence(no_database.error());
  const auto no_role = Store::open(as(url_, "nobody"));
  ASSERT_FALSE(no_role);
  EXPECT_EQ(no_role.error().code, ErrorCode::kRefused);
  EXPECT_NE(no_role.error().message.find("nobody"), std::string::npos) << sentence(no_role.error());
  say("CREATE ROLE stranger LOGIN");
  const auto no_rights = Store::open(as(url_, "stranger"));
  ASSERT_FALSE(no_rights);
  EXPECT_EQ(no_rights.error().code, ErrorCode::kRefused);
  EXPECT_NE(no_rights.error().message.find("permission denied"), std::string::npos)
      << sentence(no_rights.error());
}

TEST_F(BadRecord, ADatabaseThatMayNotBeWrittenIsServedFromItsCopies) {
  {
    const auto store = open(url_);
    ASSERT_TRUE(store->add_model("cell-7", test::nominal_model(cell_, 1), 0, true, "made"));
  }
  const std::string name = say("SELECT current_database()");
  postgres_.sql(postgres_.url("postgres"),
                "ALTER DATABASE " + name + " SET default_transaction_read_only = on");
  EXPECT_EQ(check_store(url_).error().code, ErrorCode::kUnreachable);
  EXPECT_EQ(init_store(url_).error().code, ErrorCode::kUnreachable);
  const auto store = open(url_);
  EXPECT_EQ(store->versions_to_serve("cell-7"), std::vector<int>{1});
  const auto refused = store->add_batch(batch_of("lt-07"), job_of("lt-07"));
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("read-only"), std::string::npos)
      << sentence(refused.error());
  EXPECT_EQ(refused.error().next, "name the primary, or all hosts of the cluster");
  postgres_.sql(postgres_.url("postgres"),
                "ALTER DATABASE " + name + " RESET default_transaction_read_only");
  ASSERT_TRUE(store->wait_until_writable({}));
  EXPECT_TRUE(store->add_batch(batch_of("lt-07"), job_of("lt-07")));
}

TEST_F(BadRecord, AConnectionThatIsCutWithinATransactionLeavesNothingHalfDone) {
  const auto store = open(url_);
  test::Process somebody({"/usr/bin/psql", url_, "-c", "BEGIN", "-c",
                          "LOCK TABLE audit_end IN EXCLUSIVE MODE", "-c", "SELECT 'locked'", "-c",
                          "SELECT pg_sleep(60)"});
  ASSERT_TRUE(somebody.wait_for_line("locked", kPatience));
  Result<StoredJob> made = tl::make_unexpected(Error{});
  {
    const std::jthread asks([&] { made = store->add_batch(batch_of("lt-07"), job_of("lt-07")); });
    // It has written the batch and its job, and waits for the end of the trail.
    const std::string waiting =
        "FROM pg_stat_activity WHERE wait_event_type = 'Lock' AND datname = current_database()";
    for (int i = 0; i < 1000 && say("SELECT count(*) " + waiting) == "0\n"; ++i) continue;
    say("SELECT pg_terminate_backend(pid) " + waiting);
    say("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE application_name = 'psql' "
        "AND pid <> pg_backend_pid() AND datname = current_database()");
  }
  // It was asked again by itself; had that been refused, too, whoever asked would do so.
  if (!made && store->wait_until_writable({}))
    made = store->add_batch(batch_of("lt-07"), job_of("lt-07"));
  ASSERT_TRUE(made) << sentence(made.error());
  EXPECT_EQ(batches_of(*store), std::set<std::string>{"lt-07"});
  EXPECT_EQ(demand(store->unfinished_jobs()).size(), 1u);
  EXPECT_FALSE(demand(store->audit()).broken);
}

TEST_F(BadRecord, FiveThousandModelsAreListed) {
  const auto store = open(url_);
  ASSERT_TRUE(store->add_model("cell-7", test::nominal_model(cell_, 1), 0, true, "made"));
  say("INSERT INTO models (cell, version, id, hash, level, batch_id, created_at, training_poses, "
      "validation_rms, content) SELECT cell, n, id || n, hash || n, level, batch_id, created_at, "
      "training_poses, validation_rms, content FROM models, generate_series(2, 5000) AS n");
  say("UPDATE cells SET last_version = 5000");
  const auto models = demand(store->models("cell-7"));
  ASSERT_EQ(models.size(), 5000u);
  EXPECT_EQ(models.front().version, 1);
  EXPECT_EQ(models.back().version, 5000);
  EXPECT_EQ(demand(store->add_model("cell-7", test::nominal_model(cell_, 2), 0, false, "made")),
            5001);
}

TEST_F(BadRecord, APoolerThatSharesConnectionsByTransactionMayStandBetween) {
  const test::Pooler pooler(postgres_);
  const std::string empty = postgres_.new_database();
  ASSERT_TRUE(init_store(pooler.through(empty))) << "a store is made through it, too";
  const std::string url = pooler.through(url_);
  const auto one = open(url);
  const auto other = demand(Store::open(url, folder_.file("other")));
  ASSERT_TRUE(one->add_model("cell-7", test::nominal_model(cell_, 1), 0, true, "made"));
  constexpr int kEach = 20;
  const auto add = [](Store& store, const std::string& who) {
    for (int i = 0; i < kEach; ++i) {
      const std::string id = fmt::format("{}-{}", who, i);
      const auto made = store.add_batch(batch_of(id), job_of(id));
      EXPECT_TRUE(made) << sentence(made.error());
    }
  };
  {
    const std::jthread first([&] { add(*one, "a"); });
    const std::jthread second([&] { add(*one, "b"); });
    const std::jthread third([&] { add(*other, "c"); });
    const std::jthread fourth([&] { add(*other, "d"); });
  }
  EXPECT_EQ(batches_of(*one).size(), std::size_t{4 * kEach});
  EXPECT_FALSE(demand(other->audit()).broken);
  // Its limits do not stay behind for others who use the same connections.
  EXPECT_EQ(postgres_.sql(pooler.through(url_), "SHOW statement_timeout"), "0\n");
  // No word comes through it for sure: what changed is seen when the wait is over, at the latest.
  ASSERT_TRUE(one->add_model("cell-7", test::nominal_model(cell_, 2), 0, true, "made"));
  other->wait_for_change({}, std::chrono::milliseconds(1));
  EXPECT_EQ(demand(other->version_in_force("cell-7")), 2);
}

TEST_F(BadRecord, ProgramsOfTwoBuildsWorkOnOneSchema) {
  const auto old = open(url_);
  ASSERT_TRUE(old->add_model("cell-7", test::nominal_model(cell_, 1), 0, true, "made"));
  // A newer program's `store init` adds this while older ones go on: it says from which schema on
  // programs may.
  say("ALTER TABLE jobs ADD COLUMN colour TEXT NOT NULL DEFAULT '';ALTER TABLE models ADD COLUMN "
      "weight BIGINT;CREATE TABLE job_colours (job BIGINT PRIMARY KEY REFERENCES jobs (id));UPDATE "
      "trammel_schema SET version = version + 1");
  ASSERT_TRUE(old->add_batch(batch_of("lt-07"), job_of("lt-07"))) << "it was there before";
  const auto restarted = demand(Store::open(url_, folder_.file("restarted")));
  ASSERT_TRUE(restarted->add_batch(batch_of("lt-08"), job_of("lt-08")));
  EXPECT_EQ(demand(restarted->add_model("cell-7", test::nominal_model(cell_, 2), 0, true, "made")),
            2);
  // The newer program's own.
  say("INSERT INTO jobs (cell, level, bias, state, message, created_at, colour) VALUES ('cell-7', "
      "'M3', 'none', 'queued', '', 1700000000, 'red')");
  ASSERT_TRUE(old->rollback("cell-7"));
  EXPECT_EQ(demand(restarted->version_in_force("cell-7")), 1);
  EXPECT_EQ(demand(restarted->unfinished_jobs()).size(), 3u);
  EXPECT_FALSE(demand(restarted->audit()).broken);
  say("UPDATE trammel_schema SET works_from = version");
  const auto too_old = Store::open(url_);
  ASSERT_FALSE(too_old);
  EXPECT_EQ(too_old.error().code, ErrorCode::kRefused);
  EXPECT_EQ(too_old.error().next, "start a newer one");
}

TEST(BadRecordServer, AStandbyThatTakesNoChangesIsNamed) {
  Postgres postgres;
  const std::string url = postgres.new_store();
  postgres.become_standby();
  EXPECT_NE(check_store(url).error().message.find("read-only standby"), std::string::npos);
  const auto store = demand(Store::open(url));
  const auto refused = store->add_batch(batch_of("lt-07"), job_of("lt-07"));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kBusy);
  EXPECT_EQ(refused.error().next, "name the primary, or all hosts of the cluster");
  EXPECT_TRUE(look_through_store(url)) << "it can be looked at";
}

TEST(BadRecordServer, ADiskOfTheDatabaseThatIsFullStopsChangesUntilThereIsRoom) {
  Postgres postgres(Postgres::Disk::kSmall);
  const auto store = demand(Store::open(postgres.new_store("TABLESPACE small")));
  std::mt19937_64 random(1);
  std::string bytes(3'000'000, '\0');  // not to be compressed
  std::set<std::string> acknowledged;
  Result<StoredJob> last = tl::make_unexpected(Error{});
  for (int i = 0; i < 40; ++i) {
    for (char& byte : bytes) byte = static_cast<char>(random());
    const std::string id = fmt::format("lt-{}", i);
    last = store->add_batch(batch_of(id, bytes, "client:" + id), job_of(id));
    if (!last) break;
    acknowledged.insert(id);
  }
  ASSERT_FALSE(last) << "64 MB hold no 120";
  EXPECT_EQ(last.error().code, ErrorCode::kBusy);
  EXPECT_NE(last.error().message.find("No space left on device"), std::string::npos)
      << sentence(last.error());
  EXPECT_TRUE(store->state().why_not_written);
  EXPECT_TRUE(store->state().readable);
  EXPECT_EQ(batches_of(*store), acknowledged);
  postgres.make_room();
  ASSERT_TRUE(store->wait_until_writable({}));
  ASSERT_TRUE(store->add_batch(batch_of("after"), job_of("after")));
  acknowledged.insert("after");
  EXPECT_EQ(batches_of(*store), acknowledged);
  EXPECT_FALSE(demand(store->audit()).broken);
}

}  // namespace
}  // namespace trammel
