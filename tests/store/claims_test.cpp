// Who works on a job where several servers share a store.
#include <gtest/gtest.h>

#include <atomic>
#include <map>
#include <memory>
#include <set>
#include <thread>
#include <vector>

#include "server/store/database/postgres_database.h"
#include "tests/store/store_under_test.h"
#include "tests/support/postgres.h"

namespace trammel {
namespace {

using test::demand;

/// Two servers of one PostgreSQL.
class Claims : public testing::Test {
 protected:
  Claims() : one_(open("one")), other_(open("other")) {}
  std::unique_ptr<Store> open(const std::string& server) {
    auto store = demand(Store::open(url_, folder_.file(server)));
    store->works_as(server);
    return store;
  }
  std::int64_t submit(const std::string& cell, const std::string& id) {
    StoredBatch batch = test::batch_of(id);
    StoredJob job = test::job_of(id);
    batch.cell = job.cell = cell;
    return demand(one_->add_batch(batch, job)).id;
  }
  /// As if the server had not been heard of for longer than its lease.
  void let_lease_pass(std::int64_t job) {
    test::Postgres::of_program().sql(
        url_, fmt::format("UPDATE job_claims SET lease_until = 1 WHERE job = {}", job));
  }
  static int add_model(Store& store, std::int64_t job) {
    const auto cell = test::small_cell("cell-7");
    const auto made = store.add_model("cell-7", test::nominal_model(cell, 60), job, true, "made");
    return made ? *made : 0;
  }

  test::TemporaryFolder folder_;
  const std::string url_ = test::Postgres::of_program().new_store();
  std::unique_ptr<Store> one_, other_;
};

TEST_F(Claims, AJobThatAServerWorksOnIsTakenByNobodyElse) {
  const std::int64_t job = submit("cell-7", "b1");
  EXPECT_TRUE(demand(other_->jobs_to_take()).contains(job));
  ASSERT_TRUE(one_->set_job_running(job));
  EXPECT_EQ(other_->set_job_running(job).error().code, ErrorCode::kConflict);
  EXPECT_TRUE(demand(other_->jobs_to_take()).empty());
  EXPECT_EQ(demand(other_->job(job)).server, "one");
  EXPECT_EQ(demand(other_->job(job)).attempts, 1);
}

TEST_F(Claims, OneCellIsTrainedByOneServerAtATimeAndAnotherCellMeanwhile) {
  const std::int64_t first = submit("cell-7", "b1"), second = submit("cell-7", "b2"),
                     of_eight = submit("cell-8", "b1");
  ASSERT_TRUE(one_->set_job_running(first));
  EXPECT_EQ(other_->set_job_running(second).error().code, ErrorCode::kConflict);
  EXPECT_EQ(demand(other_->job(second)).state, JobState::kQueued) << "it waits";
  EXPECT_EQ(demand(other_->jobs_to_take()),
            (std::map<std::int64_t, std::string>{{of_eight, "cell-8"}}));
  EXPECT_TRUE(other_->set_job_running(of_eight));
  ASSERT_TRUE(one_->set_job_done(first, "done"));
  EXPECT_TRUE(other_->set_job_running(second));
}

TEST_F(Claims, OfManyServersThatWantAJobOneGetsIt) {
  const std::int64_t job = submit("cell-7", "b1");
  std::atomic<int> got = 0;
  std::vector<std::unique_ptr<Store>> servers;
  for (int i = 0; i < 4; ++i) servers.push_back(open(fmt::format("server-{}", i)));
  {
    std::vector<std::jthread> wanting;
    for (const auto& server : servers)
      wanting.emplace_back([&got, &server, job] { got += server->set_job_running(job) ? 1 : 0; });
  }
  EXPECT_EQ(got, 1);
  EXPECT_EQ(demand(one_->job(job)).attempts, 1);
}

TEST_F(Claims, AServerThatWasNotHeardOfLosesItsJobAndStoresNothingOfItAfterwards) {
  const std::int64_t job = submit("cell-7", "b1");
  ASSERT_TRUE(one_->set_job_running(job));
  let_lease_pass(job);
  EXPECT_TRUE(demand(one_->renew_claim(job)).is_held) << "nobody else wanted it";
  let_lease_pass(job);
  EXPECT_TRUE(demand(other_->jobs_to_take()).contains(job));
  ASSERT_TRUE(other_->set_job_running(job));
  EXPECT_EQ(demand(other_->job(job)).attempts, 2);
  EXPECT_FALSE(demand(one_->renew_claim(job)).is_held);
  EXPECT_EQ(add_model(*one_, job), 0) << "it slept, and somebody else does the job";
  EXPECT_EQ(one_->set_job_failed(job, "late").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(one_->set_job_queued(job).error().code, ErrorCode::kNotFound);
  let_lease_pass(job);
  EXPECT_EQ(add_model(*one_, job), 0) << "also where that one is gone, too";
  EXPECT_EQ(add_model(*other_, job), 1);
  EXPECT_EQ(demand(one_->models("cell-7")).size(), 1U);
}

TEST_F(Claims, WhoLostAJobThatWasPutBackSinceStoresNothingOfIt) {
  const std::int64_t job = submit("cell-7", "b1");
  ASSERT_TRUE(one_->set_job_running(job));
  let_lease_pass(job);
  ASSERT_TRUE(other_->set_job_running(job));
  ASSERT_TRUE(other_->set_job_queued(job)) << "it stops, and the job waits";
  EXPECT_EQ(add_model(*one_, job), 0) << "it slept meanwhile";
  EXPECT_EQ(one_->set_job_done(job, "late").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(demand(one_->job(job)).state, JobState::kQueued);
}

TEST_F(Claims, AJobThatWasToEndEndsAlsoWhereItsServerIsGone) {
  const std::int64_t job = submit("cell-7", "b1");
  ASSERT_TRUE(one_->set_job_running(job));
  ASSERT_EQ(demand(other_->cancel_job(job, {}, {"", "", "anna"})), CancelledJob::kAsked);
  let_lease_pass(job);
  ASSERT_TRUE(other_->set_job_running(job));
  EXPECT_EQ(demand(other_->renew_claim(job)).cancelled_by, "anna");
}

TEST_F(Claims, WhatAServerWorkedOnBeforeItWasStartedAgainWaitsForNobody) {
  const std::int64_t job = submit("cell-7", "b1"), second = submit("cell-7", "b2");
  const auto here = [](const std::string& host) {
    return ServerSelf{"", host, 7, "0.1.0", true, true, {}, 0};
  };
  ASSERT_TRUE(one_->tell_presence(here("host-a")));
  ASSERT_TRUE(one_->set_job_running(job));
  const auto elsewhere = open("one");
  ASSERT_TRUE(elsewhere->tell_presence(here("host-b")));
  EXPECT_TRUE(demand(other_->jobs_to_take()).empty())
      << "one of the same name on another host is another one";
  const auto again = open("one");
  ASSERT_TRUE(again->tell_presence(here("host-a")));
  EXPECT_EQ(demand(other_->jobs_to_take()).size(), 2U)
      << "killed and started again: its lease ends at once";
  ASSERT_TRUE(other_->set_job_running(second)) << "its cell is free, too";
  EXPECT_EQ(again->set_job_running(job).error().code, ErrorCode::kConflict);
  ASSERT_TRUE(other_->set_job_done(second, "done"));
  ASSERT_TRUE(again->set_job_running(job));
  EXPECT_EQ(add_model(*one_, job), 0)
      << "should the first start live all the same, it stores nothing of it";
  ASSERT_TRUE(again->tell_presence(here("host-a")));
  EXPECT_TRUE(demand(again->renew_claim(job)).is_held) << "what it works on itself stays its own";
  EXPECT_FALSE(demand(other_->jobs_to_take()).contains(job));
}

TEST_F(Claims, OfAJobThatIsPutBackWithoutHavingBeenBegunNoAttemptIsTakenBack) {
  const std::int64_t job = submit("cell-7", "b1");
  ASSERT_TRUE(one_->set_job_running(job));
  ASSERT_TRUE(one_->set_job_queued(job, true)) << "its computing broke off: that counts";
  ASSERT_TRUE(other_->set_job_queued(job)) << "it could not be begun";
  EXPECT_EQ(demand(one_->job(job)).attempts, 1);
  ASSERT_TRUE(one_->set_job_running(job));
  ASSERT_TRUE(one_->set_job_queued(job)) << "the server stops: that does not count";
  EXPECT_EQ(demand(one_->job(job)).attempts, 1);
}

TEST_F(Claims, OthersHearAtOnceOfAJobThatIsPutBack) {
  const std::int64_t job = submit("cell-7", "b1");
  ASSERT_TRUE(one_->set_job_running(job));
  std::stop_source never;
  other_->wait_for_change(never.get_token(),
                          std::chrono::seconds(30));  // connects, and hears from then on
  ASSERT_TRUE(one_->set_job_queued(job));
  other_->wait_for_change(never.get_token(), std::chrono::hours(1));
  EXPECT_TRUE(demand(other_->jobs_to_take()).contains(job));
}

TEST_F(Claims, JobsAreReadTogetherAndWhatCameWithABatchIsToldFromWhatWasAskedFor) {
  const std::int64_t came = submit("cell-7", "b1"), of_eight = submit("cell-8", "b1");
  StoredJob asked = test::job_of("b1");
  const std::int64_t wanted = demand(one_->add_job(asked)).id;
  const auto jobs = demand(other_->jobs({came, of_eight, wanted, 999}));
  ASSERT_EQ(jobs.size(), 3U);
  EXPECT_EQ(jobs[1].cell, "cell-8");
  for (const StoredJob& job : jobs) EXPECT_EQ(job.batch_ids, std::vector<std::string>{"b1"});
  EXPECT_EQ(demand(other_->came_with_batches({came, of_eight, wanted})),
            (std::set<std::int64_t>{came, of_eight}));
  EXPECT_TRUE(demand(other_->jobs({})).empty());
  const auto unfinished = demand(other_->unfinished_jobs());
  ASSERT_EQ(unfinished.size(), 3U);
  EXPECT_EQ(unfinished[2].batch_ids, std::vector<std::string>{"b1"});
}

TEST_F(Claims, ABatchThatIsAcceptedComesWithTheJobAsTheRecordHasItAndARepeatSaysThatItIsOne) {
  const StoredBatch batch = test::batch_of("b1");
  StoredJob asked = test::job_of("b1");
  asked.asked = AskedTraining{"M3"};
  asked.created_at = 1700000000;
  const AcceptedJob made = demand(one_->add_batch(batch, asked)),
                    again = demand(other_->add_batch(batch, asked));
  const StoredJob stored = demand(other_->job(made.id));
  EXPECT_FALSE(made.is_repeat);
  EXPECT_TRUE(again.is_repeat);
  for (const StoredJob& one : {StoredJob(made), StoredJob(again)}) {
    EXPECT_EQ(one.id, stored.id);
    EXPECT_EQ(one.cell, stored.cell);
    EXPECT_EQ(one.batch_ids, stored.batch_ids);
    EXPECT_EQ(std::get<AskedTraining>(one.asked).level, "M3");
    EXPECT_EQ(one.created_at, stored.created_at);
    EXPECT_EQ(one.state, stored.state);
  }
  EXPECT_EQ(demand(one_->batch("cell-7", "b1")).csv, batch.csv);
  EXPECT_EQ(demand(one_->batch_record("cell-7", "b1")).poses, batch.poses);
  const StoredBatch other_content = test::batch_of("b1", "other", "client:2");
  EXPECT_EQ(other_->add_batch(other_content, asked).error().code, ErrorCode::kConflict);
  EXPECT_EQ(demand(one_->unfinished_jobs()).size(), 1U);
  EXPECT_FALSE(demand(one_->audit()).broken);
}

TEST_F(Claims, AServerTakesUpItsOwnJobThatItLeftBehind) {
  const std::int64_t job = submit("cell-7", "b1");
  ASSERT_TRUE(one_->set_job_running(job));
  EXPECT_TRUE(demand(one_->jobs_to_take()).empty()) << "it works on it";
  let_lease_pass(job);
  EXPECT_TRUE(demand(one_->jobs_to_take()).contains(job));
}

TEST_F(Claims, WhoRunsAJobHearsThatAnotherServerWasAskedToEndIt) {
  const std::int64_t job = submit("cell-7", "b1");
  ASSERT_TRUE(one_->set_job_running(job));
  EXPECT_FALSE(demand(one_->renew_claim(job)).cancelled_by);
  std::stop_source never;
  one_->wait_for_change(never.get_token(),
                        std::chrono::seconds(30));  // connects, and hears from then on
  ASSERT_EQ(demand(other_->cancel_job(job, {}, {"", "", "anna"})), CancelledJob::kAsked);
  one_->wait_for_change(never.get_token(), std::chrono::hours(1));
  EXPECT_EQ(demand(one_->renew_claim(job)).cancelled_by, "anna") << "it is told at once";
}

TEST_F(Claims, AJobThatWaitsOrWhoseServerIsGoneIsEndedByAnyServer) {
  const std::int64_t waits = submit("cell-7", "b1"), left = submit("cell-8", "b1");
  EXPECT_EQ(demand(other_->cancel_job(waits, {}, {"", "", "anna"})), CancelledJob::kEnded);
  EXPECT_EQ(demand(one_->job(waits)).state, JobState::kFailed);
  EXPECT_EQ(one_->set_job_running(waits).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(one_->cancel_job(waits, {}, {"", "", "bert"}).error().code, ErrorCode::kConflict)
      << "it is over";
  ASSERT_TRUE(one_->set_job_running(left));
  let_lease_pass(left);
  EXPECT_EQ(demand(other_->cancel_job(left, {}, {"", "", "anna"})), CancelledJob::kEnded);
  EXPECT_EQ(one_->set_job_done(left, "late").error().code, ErrorCode::kNotFound);
  const AuditTrail trail = demand(one_->audit());
  EXPECT_FALSE(trail.broken);
  EXPECT_EQ(trail.rows.back().who, "anna");
  EXPECT_EQ(trail.rows.back().server, "other");
}

TEST_F(Claims, ABatchIsPutInQuarantineByTheServerThatHasItsJobAlone) {
  const std::int64_t job = submit("cell-7", "b1");
  ASSERT_TRUE(one_->set_job_running(job));
  let_lease_pass(job);
  ASSERT_TRUE(other_->set_job_running(job));
  EXPECT_EQ(one_->set_quarantine("cell-7", "b1", "late", {}, job).error().code,
            ErrorCode::kNotFound);
  EXPECT_EQ(demand(one_->batch_record("cell-7", "b1")).quarantine, "");
  ASSERT_TRUE(other_->set_quarantine("cell-7", "b1", "moved", {}, job));
  EXPECT_EQ(demand(one_->batch_record("cell-7", "b1")).quarantine, "moved");
}

TEST_F(Claims, AClaimIsKeptWhileAllOtherConnectionsOfItsServerWaitForLocks) {
  const std::int64_t job = submit("cell-7", "b1");
  ASSERT_TRUE(one_->set_job_running(job));
  const auto holder = demand(PostgresDatabase::connect(url_, PostgresDatabase::Session::kWrites));
  {
    Transaction held(*holder, Transaction::For::kWriting);
    holder->execute("SELECT 1 FROM audit_end FOR UPDATE");
    std::atomic<bool> over = false;
    std::vector<std::jthread> waiting;
    for (int i = 0; i < 4; ++i)
      waiting.emplace_back([&, i] {
        while (!over) static_cast<void>(one_->set_quarantine("cell-7", "b1", std::to_string(i)));
      });
    const auto all_wait = [&] {
      return test::Postgres::of_program().sql(
                 url_,
                 "SELECT count(*) FROM pg_stat_activity WHERE wait_event_type = 'Lock' AND datname "
                 "= current_database()") == "4\n";
    };
    const auto until = std::chrono::steady_clock::now() + std::chrono::minutes(2);
    while (!all_wait()) ASSERT_LT(std::chrono::steady_clock::now(), until);
    EXPECT_TRUE(demand(one_->renew_claim(job)).is_held);
    EXPECT_TRUE(one_->tell_presence({}));
    over = true;
  }
}

TEST_F(Claims, AJobIsToEndOnceUnderOneIdWhicheverServerIsAsked) {
  const std::int64_t waits = submit("cell-7", "b1"), runs = submit("cell-8", "b2");
  const ChangeId of_waiting{"cancel-1", "cancel", "anna"}, of_running{"cancel-2", "cancel", "anna"};
  ASSERT_TRUE(one_->set_job_failed(waits, "cancelled", {}, of_waiting));
  const std::int64_t changes = demand(one_->changes_made());
  EXPECT_TRUE(other_->set_job_failed(waits, "cancelled", {}, of_waiting))
      << "it is over, by this very change";
  EXPECT_EQ(demand(one_->changes_made()), changes);
  EXPECT_EQ(
      other_->set_job_failed(waits, "cancelled", {}, {"cancel-3", "cancel", "anna"}).error().code,
      ErrorCode::kNotFound);
  ASSERT_TRUE(one_->set_job_running(runs));
  ASSERT_EQ(demand(other_->cancel_job(runs, {}, of_running)), CancelledJob::kAsked);
  ASSERT_TRUE(one_->set_job_failed(runs, "cancelled"));
  EXPECT_EQ(demand(one_->cancel_job(runs, {}, of_running)), CancelledJob::kEnded)
      << "it is over, and it was asked";
}

TEST_F(Claims, AServerHearsOfAChangeOfAnotherAndWhichCellItWas) {
  std::stop_source never;
  other_->wait_for_change(never.get_token(),
                          std::chrono::seconds(30));  // connects, and hears from then on
  const std::int64_t known = demand(other_->changes_made());
  submit("cell-8", "b1");
  other_->wait_for_change(never.get_token(), std::chrono::hours(1));
  EXPECT_GT(demand(other_->changes_made()), known);
  EXPECT_EQ(demand(other_->cells_changed_after(known)), std::set<std::string>{"cell-8"});
}

TEST_F(Claims, AFileHasOneServerAndAClaimOfAStartBeforeIsNobodys) {
  one_ = demand(Store::open(folder_.file("trammel.db")));
  const std::int64_t job = submit("cell-7", "b1");
  ASSERT_TRUE(one_->set_job_running(job));
  one_.reset();
  one_ = demand(Store::open(folder_.file("trammel.db")));
  ASSERT_TRUE(one_->set_job_running(job));
  EXPECT_EQ(demand(one_->job(job)).attempts, 2);
  EXPECT_TRUE(one_->set_job_done(job, "done"));
}

}  // namespace
}  // namespace trammel
