// A store that several servers share: what is promised where more than one process writes it, and
// where it is away.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <map>
#include <regex>
#include <set>
#include <thread>

#include "server/store/store_check.h"
#include "server/store/store_copy.h"
#include "server/store/store_init.h"
#include "server/store/store_place.h"
#include "tests/store/store_under_test.h"
#include "tests/support/postgres.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::batch_of;
using test::demand;
using test::job_of;

class SharedStore : public testing::Test {
 protected:
  static void SetUpTestSuite() { test::Postgres::of_program(); }
  std::unique_ptr<Store> open(const std::string& cache = "cache") {
    return demand(Store::open(url_, folder_.file(cache)));
  }
  void put_in_force(Store& store, int poses) {
    ASSERT_TRUE(store.add_model("cell-7", test::nominal_model(cell_, poses), 0, true, "made"));
  }
  std::string say(const std::string& sql) { return postgres_.sql(url_, sql); }
  /// `work(number)` in so many processes at a time; how many of them ended well.
  template <typename Work>
  int at_once(int processes, const Work& work) {
    std::vector<pid_t> children;
    for (int number = 0; number < processes; ++number) {
      const pid_t child = ::fork();
      if (child == 0) ::_exit(work(number) ? 0 : 1);
      children.push_back(child);
    }
    int well = 0;
    for (const pid_t child : children) {
      int status = 0;
      if (::waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0)
        ++well;
    }
    return well;
  }

  test::Postgres& postgres_ = test::Postgres::of_program();
  const std::string url_ = postgres_.new_store();
  test::TemporaryFolder folder_;
  const std::shared_ptr<const Cell> cell_ = test::small_cell("cell-7");
};

TEST_F(SharedStore, FourProcessesThatWriteAtATimeLoseNothingAndGiveNoNumberTwice) {
  constexpr int kProcesses = 4, kEach = 8;
  const int well = at_once(kProcesses, [&](int process) {
    const auto store = open(fmt::format("cache-{}", process));
    for (int i = 0; i < kEach; ++i) {
      const std::string id = fmt::format("{}-{}", process, i);
      const auto job = store->add_batch(batch_of(id), job_of(id));
      if (!job) return false;
      const auto model = test::nominal_model(cell_, 1 + process * kEach + i);
      const auto version =
          store->add_model("cell-7", model, job->id, true, "made", false, {id, "made"});
      if (!version || store->models("cell-7")->at(static_cast<std::size_t>(*version - 1)).id !=
                          model.provenance().id)
        return false;
      // All of them ask for the same, under the same id: it is made once.
      if (!store->activate("cell-7", 1, {fmt::format("all:{}", i), "activate 1"})) return false;
    }
    return true;
  });
  EXPECT_EQ(well, kProcesses);
  const auto store = open();
  EXPECT_EQ(demand(store->batches("cell-7")).size(), std::size_t{kProcesses * kEach});
  std::set<int> versions;
  std::set<std::string> models;
  for (const StoredModel& model : demand(store->models("cell-7"))) {
    versions.insert(model.version);
    models.insert(model.hash);
  }
  EXPECT_EQ(versions.size(), std::size_t{kProcesses * kEach});
  EXPECT_EQ(*versions.rbegin(), kProcesses * kEach) << "without a gap";
  EXPECT_EQ(models.size(), versions.size());
  EXPECT_TRUE(demand(store->unfinished_jobs()).empty());
  const AuditTrail trail = demand(store->audit());
  EXPECT_FALSE(trail.broken) << sentence(*trail.broken);
  std::map<std::string, int> told;
  for (const AuditRow& row : trail.rows) ++told[row.what];
  EXPECT_EQ(told["batch"], kProcesses * kEach);
  EXPECT_EQ(told["model"], kProcesses * kEach);
  EXPECT_LE(told["activate"], kEach) << "a repeat changes nothing";
}

TEST_F(SharedStore, OneBatchThatFourProcessesSubmitAtATimeIsOneJob) {
  EXPECT_EQ(at_once(4,
                    [&](int) {
                      return open()->add_batch(batch_of("lt-07"), job_of("lt-07")).has_value();
                    }),
            4);
  EXPECT_EQ(demand(open()->unfinished_jobs()).size(), 1u);
}

TEST_F(SharedStore, WhereSeveralDecideAgainstTheSameVersionOneOfThemDoes) {
  const auto store = open();
  put_in_force(*store, 1);
  for (int poses = 2; poses <= 5; ++poses)
    ASSERT_TRUE(store->add_model("cell-7", test::nominal_model(cell_, poses), 0, false, "made"));
  const int decided = at_once(4, [&](int process) {
    ChangeId by{fmt::format("client:{}", process), "activate"};
    by.expected_version = 1;
    return open()->activate("cell-7", 2 + process, by).has_value();
  });
  EXPECT_EQ(decided, 1);
}

TEST_F(SharedStore, ARepeatOnAnotherServerLearnsWhatCameOfTheFirst) {
  const auto one = open("one"), other = open("other");
  put_in_force(*one, 1);
  put_in_force(*one, 2);
  const ChangeId id{"robot-3:17", "roll back"};
  EXPECT_EQ(demand(one->rollback("cell-7", 1, id)), 1);
  EXPECT_EQ(demand(other->rollback("cell-7", 1, id)), 1);
  EXPECT_EQ(demand(other->outcome_of(id))->version, 1);
  EXPECT_EQ(other->outcome_of({"robot-3:17", "something else"}).error().code, ErrorCode::kConflict);
}

TEST_F(SharedStore, AConnectionThatIsCutIsMadeAnewAndNobodyNotices) {
  const auto store = open();
  put_in_force(*store, 1);
  say("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE application_name = 'trammel' "
      "AND datname = current_database()");
  EXPECT_TRUE(store->add_batch(batch_of("lt-07"), job_of("lt-07")));
  EXPECT_FALSE(store->state().why_not_written);
}

TEST_F(SharedStore, AnEmptyDatabaseIsRefusedWithTheCommandThatMakesItAStore) {
  const std::string empty = postgres_.new_database();
  const auto refused = Store::open(empty, folder_.file("cache"));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kRefused);
  EXPECT_NE(refused.error().next.find("trammel store init"), std::string::npos)
      << refused.error().next;
  ASSERT_TRUE(init_store(empty));
  EXPECT_TRUE(init_store(empty)) << "a second time changes nothing";
  EXPECT_TRUE(Store::open(empty, folder_.file("cache")));
}

TEST_F(SharedStore, TheDatabaseOfAnotherProgramIsRefusedAndLeftAlone) {
  const std::string other = postgres_.new_database();
  postgres_.sql(other, "CREATE TABLE theirs (a int)");
  EXPECT_EQ(Store::open(other).error().code, ErrorCode::kRefused);
  EXPECT_EQ(init_store(other).error().code, ErrorCode::kRefused);
  EXPECT_EQ(postgres_.sql(other, "SELECT count(*) FROM pg_tables WHERE schemaname = 'public'"),
            "1\n");
}

TEST_F(SharedStore, ASchemaOfTheFutureIsRefusedUnlessItSaysThatThisProgramWorksOnIt) {
  say("UPDATE trammel_schema SET version = 7, works_from = 7");
  const auto newer = Store::open(url_);
  ASSERT_FALSE(newer);
  EXPECT_EQ(newer.error().field, "schema");
  EXPECT_EQ(newer.error().value, 7);
  say("UPDATE trammel_schema SET version = 7, works_from = 3");
  EXPECT_TRUE(Store::open(url_)) << "a rolling update";
}

TEST_F(SharedStore, ASchemaOfBeforeIsBroughtUpToDateByInitAndByNothingElse) {
  say("CREATE TABLE replica (epoch bigint); CREATE TABLE learned_elsewhere (cell text); CREATE "
      "TABLE versions_elsewhere (cell text); DROP TABLE servers, cell_descriptions; ALTER TABLE "
      "audit DROP COLUMN server; ALTER TABLE job_outcomes DROP COLUMN held_back; ALTER TABLE "
      "health_checks DROP COLUMN tolerance_m; UPDATE trammel_schema SET version = 1, works_from = "
      "1");
  const auto older = Store::open(url_);
  ASSERT_FALSE(older);
  EXPECT_NE(sentence(older.error()).find("trammel store init"), std::string::npos)
      << sentence(older.error());
  const Status made = init_store(url_);
  ASSERT_TRUE(made) << sentence(made.error());
  EXPECT_TRUE(Store::open(url_));
  EXPECT_EQ(postgres_.sql(url_,
                          "SELECT count(*) FROM pg_tables WHERE tablename IN ('replica', "
                          "'learned_elsewhere', 'versions_elsewhere')"),
            "0\n");
  EXPECT_EQ(postgres_.sql(url_, "SELECT version >= 3 AND works_from >= 2 FROM trammel_schema"),
            "t\n");
}

TEST_F(SharedStore, ARoleThatMayOnlyUseItCannotChangeTheAuditTrail) {
  say("CREATE ROLE service LOGIN");
  std::string service = url_;
  service.replace(service.find("postgres@"), 9, "service@");
  const auto not_let_in = Store::open(service);
  ASSERT_FALSE(not_let_in);
  EXPECT_EQ(not_let_in.error().code, ErrorCode::kRefused) << sentence(not_let_in.error());
  ASSERT_TRUE(init_store(url_, "service"));
  EXPECT_EQ(init_store(url_, "postgres").error().code, ErrorCode::kRefused) << "it owns the store";
  const auto store = demand(Store::open(service));
  ASSERT_TRUE(store->add_batch(batch_of("lt-07"), job_of("lt-07")));
  put_in_force(*store, 1);
  EXPECT_FALSE(demand(store->audit()).broken);
  const auto may = [&](const char* right) {
    return say(fmt::format("SELECT has_table_privilege('service', 'audit', '{}')", right)) == "t\n";
  };
  EXPECT_TRUE(may("INSERT"));
  EXPECT_FALSE(may("UPDATE"));
  EXPECT_FALSE(may("DELETE"));
  EXPECT_FALSE(may("TRUNCATE"));
}

TEST_F(SharedStore, NoErrorHoldsThePasswordOrAValue) {
  const std::string secret = "postgresql://somebody:s3cret@127.0.0.1:1/plant?connect_timeout=1";
  EXPECT_EQ(spoken_place(secret), "postgresql://somebody@127.0.0.1:1/plant");
  EXPECT_EQ(spoken_place("postgresql://host/db?password=p@ss"), "postgresql://host/db");
  EXPECT_EQ(spoken_place("postgresql://u:x@host/db?password=p@ss"), "postgresql://u@host/db");
  EXPECT_EQ(spoken_place("postgresql://host?password=p@ss/db").find("p@"), std::string::npos);
  EXPECT_EQ(spoken_place("postgresql://host?password=p@ss/db").find("=p"), std::string::npos);
  const auto store = demand(Store::open(secret, folder_.file("none")));
  ASSERT_TRUE(store->state().why_not_written);
  EXPECT_EQ(sentence(*store->state().why_not_written).find("s3cret"), std::string::npos);
  const auto unread = Store::open("postgresql://u:s3%zzcret@h/d");
  ASSERT_FALSE(unread);
  EXPECT_EQ(sentence(unread.error()).find("s3"), std::string::npos) << sentence(unread.error());
  StoredBatch odd = batch_of("lt-07");
  odd.request_id = "s3cret\xFF";
  const auto refused = open()->add_batch(odd, job_of("lt-07"));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kRefused);
  EXPECT_EQ(sentence(refused.error()).find("s3cret"), std::string::npos)
      << sentence(refused.error());
}

TEST_F(SharedStore, APlaceThatLibpqCannotReadIsRefusedAndNothingOfItRepeated) {
  for (const char* place :
       {"postgresql://keeper:s3@cret@127.0.0.1/plant",
        "postgresql://keeper:s3/cret@127.0.0.1/plant", "postgresql://keeper:5/cret@127.0.0.1/plant",
        "postgresql://keeper:s3%zzcret@h/plant", "PostgreSQL://keeper:s3cret@127.0.0.1/plant",
        "mysql://keeper:s3cret@127.0.0.1/plant", "host=127.0.0.1 dbname=plant password=s3 cret",
        "postgresql://h/plant?nonsense=s3cret"}) {
    const std::string wrong = place;
    const std::vector<Error> refusals = {Store::open(wrong, folder_.file("none")).error(),
                                         check_store(wrong).error(), init_store(wrong).error(),
                                         look_through_store(wrong).error()};
    for (const Error& refused : refusals) {
      EXPECT_EQ(refused.code, ErrorCode::kRefused) << sentence(refused);
      EXPECT_NE(sentence(refused).find("no URL that PostgreSQL reads"), std::string::npos);
      for (const char* secret : {"s3", "cret", "5/"})
        EXPECT_EQ(sentence(refused).find(secret), std::string::npos) << sentence(refused);
    }
  }
}

TEST_F(SharedStore, MayBeNamedInEitherWayThatLibpqReads) {
  const std::string words =
      std::regex_replace(url_, std::regex("postgresql://(.*)@/(.*)[?]host=(.*)"),
                         "user=$1 dbname=$2 host=$3 password=s3cret");
  EXPECT_EQ(spoken_place(words), spoken_place(url_));
  EXPECT_TRUE(check_store(words));
  put_in_force(*demand(Store::open(words, folder_.file("words"))), 1);
  EXPECT_EQ(demand(open()->version_in_force("cell-7")), 1);
  for (const char* file : {"trammel.db", "/var/lib/a=b/trammel.db", "a=b.db", ""})
    EXPECT_FALSE(is_postgres_url(file)) << file;
}

TEST_F(SharedStore, WhoeverHoldsItLockedIsNamedBeforeTheClientsPatienceEnds) {
  const auto store = open();
  put_in_force(*store, 1);
  constexpr std::chrono::seconds kPatienceOfClients{2};  // if nobody says otherwise
  for (const char* held : {"audit_end", "cells", "batches", "job_batches"}) {
    const test::LockedTable somebody(url_, held, "EXCLUSIVE");
    const auto begin = std::chrono::steady_clock::now();
    const auto refused = store->add_batch(batch_of("lt-07"), job_of("lt-07"));
    EXPECT_LT(std::chrono::steady_clock::now() - begin, kPatienceOfClients) << held;
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::kBusy);
    EXPECT_NE(refused.error().message.find("psql of role postgres"), std::string::npos)
        << sentence(refused.error());
    EXPECT_TRUE(demand(store->batches("cell-7")).empty());
  }
  EXPECT_TRUE(store->add_batch(batch_of("lt-07"), job_of("lt-07")));
}

TEST_F(SharedStore, ATableThatNobodyCanReadTakesTheRecordAwayUntilItIsLetGo) {
  const auto store = open();
  put_in_force(*store, 1);
  {
    const test::LockedTable somebody(url_, "models", "ACCESS EXCLUSIVE");
    const auto is_named = [](const Error& error) {
      EXPECT_EQ(error.code, ErrorCode::kBusy) << sentence(error);
      EXPECT_NE(error.message.find("psql of role postgres"), std::string::npos) << sentence(error);
    };
    is_named(store->models("cell-7").error());
    is_named(look_through_store(url_).error());
    EXPECT_FALSE(store->state().readable);
    is_named(store->try_again().error());
    EXPECT_FALSE(store->state().readable) << "it is not there yet";
    const auto begin = std::chrono::steady_clock::now();
    for (int i = 0; i < 100; ++i) is_named(store->models("cell-7").error());
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(1)) << "at once";
    EXPECT_EQ(store->versions_to_serve("cell-7"), std::vector<int>{1}) << "from its copy";
  }
  ASSERT_TRUE(store->wait_until_writable({}));
  EXPECT_EQ(demand(store->models("cell-7")).size(), 1u);
}

/// A test that takes the whole database away has one of its own.
class SharedStoreAway : public testing::Test {
 protected:
  test::Postgres postgres_;
  const std::string url_ = postgres_.new_store();
  test::TemporaryFolder folder_;
  const std::shared_ptr<const Cell> cell_ = test::small_cell("cell-7");
  std::unique_ptr<Store> open() { return demand(Store::open(url_, folder_.file("cache"))); }
  void check_it_comes_back(Store& store) {
    EXPECT_TRUE(store.wait_until_writable({}));
    EXPECT_FALSE(store.state().why_not_written);
    EXPECT_TRUE(store.state().readable);
    EXPECT_TRUE(store.add_batch(batch_of("after"), job_of("after")));
  }
};

TEST_F(SharedStoreAway, ChangesAreRefusedTheModelInForceIsServedAndItComesBackByItself) {
  const auto store = open();
  ASSERT_TRUE(store->add_model("cell-7", test::nominal_model(cell_, 1), 0, true, "made"));
  postgres_.stop();
  const auto refused = store->add_batch(batch_of("lt-07"), job_of("lt-07"));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kBusy);
  EXPECT_GT(store->state().since, 0);
  EXPECT_FALSE(store->state().readable);
  EXPECT_EQ(store->versions_to_serve("cell-7"), std::vector<int>{1});
  EXPECT_TRUE(store->model("cell-7", 1)) << "from its copy";
  postgres_.start();
  check_it_comes_back(*store);
}

TEST_F(SharedStoreAway, AServerThatStartsMeanwhileServesWhatItSawLast) {
  {
    const auto store = open();
    ASSERT_TRUE(store->add_model("cell-7", test::nominal_model(cell_, 1), 0, true, "made"));
    ASSERT_TRUE(store->add_model("cell-7", test::nominal_model(cell_, 2), 0, true, "made"));
  }
  postgres_.stop();
  const auto store = open();
  EXPECT_EQ(store->versions_to_serve("cell-7"), (std::vector<int>{2, 1}));
  EXPECT_EQ(store->model("cell-7", 2)->provenance().training_poses, 2);
  EXPECT_FALSE(store->state().readable);
  postgres_.start();
  check_it_comes_back(*store);
}

TEST_F(SharedStoreAway, ADatabaseThatIsStoppedAndNotDeadIsNoticedByADeadline) {
  const auto store = open();
  postgres_.freeze(true);
  const auto refused = store->add_batch(batch_of("lt-07"), job_of("lt-07"));
  EXPECT_FALSE(refused);
  postgres_.freeze(false);
  check_it_comes_back(*store);
}

TEST_F(SharedStoreAway,
       ACommitThatTheStandbyHasNotConfirmedIsNoAcknowledgementAndARepeatLearnsWhatCameOfIt) {
  const auto store = open();
  const auto standbys = [&](const char* names) {
    postgres_.sql(url_, fmt::format("ALTER SYSTEM SET synchronous_standby_names = '{}'", names));
    postgres_.sql(url_, "SELECT pg_reload_conf()");
  };
  const std::string waiting = "FROM pg_stat_activity WHERE wait_event = 'SyncRep'";
  standbys("nobody");
  Result<StoredJob> unknown;
  {
    const std::jthread asks(
        [&] { unknown = store->add_batch(batch_of("lt-07"), job_of("lt-07")); });
    while (postgres_.sql(url_, "SELECT count(*) " + waiting) == "0\n") continue;
    postgres_.sql(url_, "SELECT pg_cancel_backend(pid) " + waiting);
  }
  ASSERT_FALSE(unknown) << "the server made it, and on one host alone";
  EXPECT_EQ(unknown.error().code, ErrorCode::kBusy);
  EXPECT_NE(unknown.error().message.find("not known"), std::string::npos)
      << sentence(unknown.error());
  standbys("");
  ASSERT_TRUE(store->add_batch(batch_of("lt-07"), job_of("lt-07")));
  EXPECT_EQ(demand(store->unfinished_jobs()).size(), 1u);
}

TEST_F(SharedStoreAway, AHeartbeatWaitsForNoStandby) {
  const auto store = open();
  store->works_as("one");
  const std::int64_t job = demand(store->add_batch(batch_of("lt-07"), job_of("lt-07"))).id;
  ASSERT_TRUE(store->set_job_running(job));
  ASSERT_TRUE(store->tell_presence({}));
  const auto standbys = [&](const char* names) {
    postgres_.sql(url_, fmt::format("ALTER SYSTEM SET synchronous_standby_names = '{}'", names));
    postgres_.sql(url_, "SELECT pg_reload_conf()");
  };
  standbys("nobody");
  std::atomic<bool> waits{false};  // a write that gives up is followed by the next one until then
  const std::jthread asks([&] {
    for (int number = 8; !waits; ++number) {
      const std::string id = fmt::format("lt-{:02}", number);
      static_cast<void>(store->add_batch(batch_of(id), job_of(id)));
    }
  });
  while (postgres_.sql(
             url_, "SELECT count(*) FROM pg_stat_activity WHERE wait_event = 'SyncRep'") == "0\n")
    continue;
  waits = true;
  EXPECT_TRUE(demand(store->renew_claim(job)).is_held);
  EXPECT_TRUE(store->tell_presence({}));
  standbys("");
}

TEST_F(SharedStoreAway, TheRecordGoesBeforeACopyOfAHistoryThatIsNoMore) {
  {
    const auto store = open();
    for (int poses = 1; poses <= 2; ++poses)
      ASSERT_TRUE(store->add_model("cell-7", test::nominal_model(cell_, poses), 0, true, "made"));
  }
  postgres_.sql(url_, "DELETE FROM activations WHERE version = 2");
  const auto store = open();
  EXPECT_EQ(store->versions_to_serve("cell-7").front(), 1) << "as every other server does";
  ASSERT_TRUE(store->take_back_from_copy("cell-7"));
  EXPECT_EQ(demand(store->version_in_force("cell-7")), 1);
}

}  // namespace
}  // namespace trammel
