// Several servers with one record, a PostgreSQL: each takes changes, trains, serves, and may die.
#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <functional>
#include <future>
#include <set>

#include "server/base/text_file.h"
#include "tests/support/daemon.h"
#include "tests/support/held_answer.h"
#include "tests/support/postgres.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
constexpr seconds kLimit{180};  // a lease is 15 s, and a busy machine trains slowly
const client::CallContext kContext = [] {
  client::CallContext context;
  context.cell = "cell-7";
  return context;
}();

/// Asks until it holds; each time is a call to a server.
void wait_until(const std::function<bool()>& holds, const char* what) {
  const auto deadline = std::chrono::steady_clock::now() + kLimit;
  while (!holds()) ASSERT_LT(std::chrono::steady_clock::now(), deadline) << what;
}

class Fleet : public testing::Test {
 protected:
  /// `keys`: more lines of the server file.
  void start(test::Daemon& daemon, const std::string& keys = "") {
    std::string text = test::read_file(daemon.config_path());
    const std::string own = "store: trammel.db";
    if (const std::size_t at = text.find(own); at != std::string::npos)
      text.replace(at, own.size(), "store: '" + url_ + "'");
    ASSERT_TRUE(write_text_file(daemon.config_path(), text + keys));
    daemon.start();
  }
  static std::unique_ptr<client::Session> session_with(std::initializer_list<const test::Daemon*> daemons,
                                                       milliseconds patience = seconds(30)) {
    client::SessionOptions options = (*daemons.begin())->session_options();
    options.timeout = patience;
    options.server_ports.clear();
    for (const test::Daemon* daemon : daemons) options.server_ports.push_back(daemon->port());
    auto opened = client::Session::open(options);
    EXPECT_TRUE(opened) << sentence(opened.error());
    return std::move(*opened);
  }
  static std::int64_t submit(client::Session& session, const std::string& batch, std::uint64_t seed, int poses = 60) {
    const auto job = session.submit_measurements("cell-7", batch, test::virtual_batch_csv(poses, seed));
    EXPECT_TRUE(job) << sentence(job.error());
    return job.value_or(0);
  }
  static client::JobStatus end_of(client::Session& session, std::int64_t job) {
    const auto over = session.wait_for_job(job, kLimit, nullptr);
    EXPECT_TRUE(over) << sentence(over.error());
    return over.value_or(client::JobStatus());
  }
  /// The version that answers.
  static int served(client::Session& session) {
    const auto answer = session.predict_error(kContext, test::virtual_joints(1, 7));
    return answer ? answer->model.version : 0;
  }
  static std::set<std::string> batches(client::Session& session) {
    const auto all = session.batches("cell-7");
    EXPECT_TRUE(all) << sentence(all.error());
    std::set<std::string> ids;
    for (const client::BatchOfService& batch : *all)
      EXPECT_TRUE(ids.insert(batch.batch).second) << batch.batch << " twice";
    return ids;
  }

  test::Postgres database_;
  std::string url_ = database_.new_store();  // as the servers reach it
  test::Daemon first_{0}, second_{1}, third_{2};
};

TEST_F(Fleet, WhatIsPutInForceOnOneServerIsServedByAllAndDecidedOnAny) {
  start(first_);
  start(second_);
  const auto one = session_with({&first_}), other = session_with({&second_});
  ASSERT_TRUE(end_of(*one, submit(*one, "b1", 1)).in_force);
  wait_until([&] { return served(*other) == 1; }, "the other one serves it");
  const auto made = end_of(*other, submit(*other, "b2", 2, 90)).model_version;
  EXPECT_EQ(made, 2) << "a number is one model's in the whole fleet";
  client::ChangeOptions forced;
  forced.force = true;
  for (const int version : {2, 1}) ASSERT_TRUE(other->activate("cell-7", version, forced));
  wait_until([&] { return served(*one) == 1; }, "the first one serves it");
  client::ChangeOptions late;
  late.expected_version = 2;
  const auto refused = one->rollback("cell-7", late);
  ASSERT_FALSE(refused) << "it was decided on the sight of version 2";
  EXPECT_EQ(refused.error().code, ErrorCode::kConflict);
  client::ChangeOptions once;
  once.id = "rollback-of-the-fleet";
  once.expected_version = 1;
  const auto back = one->rollback("cell-7", once);
  ASSERT_TRUE(back) << sentence(back.error());
  const auto again = other->rollback("cell-7", once);
  ASSERT_TRUE(again) << sentence(again.error());
  EXPECT_EQ(*again, *back) << "the same change, asked of another server, is made once";
  EXPECT_EQ(batches(*session_with({&first_, &second_})), (std::set<std::string>{"b1", "b2"}));
}

TEST_F(Fleet, TheJobOfATrainingHostThatIsKilledIsDoneByAnother) {
  start(first_, "trains: false\n");
  start(second_, "serves: false\n");
  const auto session = session_with({&first_});
  const std::int64_t job = submit(*session, "b1", 1, 400);
  ASSERT_TRUE(second_.process().wait_for_line(fmt::format("job {}: ", job), kLimit)) << "it works on the job";
  start(third_, "serves: false\n");
  second_.kill();
  const auto over = end_of(*session, job);
  EXPECT_TRUE(over.in_force) << over.what;
  EXPECT_EQ(over.model_version, 1);
}

TEST_F(Fleet, AHostThatWasStoppedWhileAnotherDidItsJobStoresNothingWhenItGoesOn) {
  start(first_, "trains: false\n");
  start(second_, "serves: false\n");
  const auto session = session_with({&first_});
  const std::int64_t job = submit(*session, "b1", 1, 400);
  ASSERT_TRUE(second_.process().wait_for_line(fmt::format("job {}: ", job), kLimit)) << "it works on the job";
  second_.process().signal(SIGSTOP);
  start(third_, "serves: false\n");
  EXPECT_EQ(end_of(*session, job).model_version, 1);
  second_.process().signal(SIGCONT);
  EXPECT_EQ(end_of(*session, submit(*session, "b2", 2, 60)).model_version, 2);
  const auto models = session->models("cell-7");
  ASSERT_TRUE(models) << sentence(models.error());
  EXPECT_EQ(models->size(), 2U) << "one model of each job";
}

class FleetOfDyingServers : public Fleet {
 protected:
  /// Two servers that answer, and two versions: 1 in force, a rollback leads to 2, another one to 1.
  void SetUp() override {
    url_ = held_.url();
    start(first_, "trains: false\n");
    start(second_, "trains: false\n");
    start(third_, "serves: false\n");
    session_ = session_with({&first_, &second_}, seconds(60));
    ASSERT_TRUE(end_of(*session_, submit(*session_, "b1", 1)).in_force);
    ASSERT_EQ(end_of(*session_, submit(*session_, "b2", 2, 90)).model_version, 2);
    EXPECT_EQ(third_.stop(), 0);
    client::ChangeOptions forced;
    forced.force = true;
    for (const int version : {2, 1}) ASSERT_TRUE(session_->activate("cell-7", version, forced));
  }
  /// What the session is told of a change whose server is killed once the transaction with `statement` is committed,
  /// before it hears of it. The server is started again.
  template <typename Ask>
  auto told_by_another(const std::string& statement, const Ask& ask) -> decltype(ask()) {
    held_.hold(statement);
    auto asked = std::async(std::launch::async, ask);
    const pid_t maker = held_.held(kLimit);
    EXPECT_TRUE(maker == first_.process().pid() || maker == second_.process().pid()) << maker;
    test::Daemon& dead = maker == first_.process().pid() ? first_ : second_;
    dead.kill();
    auto told = asked.get();
    EXPECT_TRUE(told) << sentence(told.error());
    dead.start();
    return told;
  }
  std::string counted(const std::string& rows) { return database_.sql(direct_, "SELECT count(*) FROM " + rows); }

  const std::string direct_ = url_;
  test::HeldAnswer held_{direct_};
  std::unique_ptr<client::Session> session_;
};

TEST_F(FleetOfDyingServers, AChangeThatIsCommittedAndNotAnsweredIsToldByAnotherServerAndMadeOnce) {
  const char* const change = "INSERT INTO changes";
  EXPECT_EQ(told_by_another(change, [&] { return session_->rollback("cell-7"); }).value_or(0), 2);
  EXPECT_EQ(counted("audit WHERE what = 'rollback'"), "1\n");
  wait_until([&] { return served(*session_with({&first_})) == 2 && served(*session_with({&second_})) == 2; }, "served");

  client::ChangeOptions forced;
  forced.force = true;
  const std::string before = counted("activations");
  EXPECT_EQ(told_by_another(change, [&] { return session_->activate("cell-7", 1, forced); }).value_or(0), 1);
  EXPECT_EQ(std::stoi(counted("activations")), std::stoi(before) + 1);

  const auto job = told_by_another(change, [&] { return session_->train("cell-7", {"b1"}, "", ""); });
  ASSERT_TRUE(job);
  EXPECT_EQ(counted("jobs WHERE state = 'queued'"), "1\n");
  EXPECT_EQ(counted(fmt::format("jobs WHERE id = {}", *job)), "1\n");

  EXPECT_TRUE(told_by_another(change, [&] { return session_->cancel(*job); }));
  EXPECT_EQ(counted("audit WHERE what = 'job' AND after = 'cancelled'"), "1\n");
  EXPECT_EQ(end_of(*session_, *job).verdict, "cancelled");

  EXPECT_TRUE(told_by_another(change, [&] { return session_->discard("cell-7", "b2"); }));
  EXPECT_EQ(counted("audit WHERE what = 'discard'"), "1\n");

  const auto taken = told_by_another("INSERT INTO batches", [&] {
    return session_->submit_measurements("cell-7", "b3", test::virtual_batch_csv(60, 3));
  });
  ASSERT_TRUE(taken);
  EXPECT_EQ(counted("batches WHERE id = 'b3'"), "1\n");
  EXPECT_EQ(counted("job_batches WHERE batch = 'b3'"), "1\n");
  EXPECT_EQ(counted(fmt::format("job_batches WHERE batch = 'b3' AND job = {}", *taken)), "1\n");
}

TEST_F(Fleet, WhenAServerIsKilledTheOtherAnswersAtOnceAndWithTheSameModel) {
  start(first_);
  start(second_);
  const auto session = session_with({&first_, &second_}), other = session_with({&second_});
  ASSERT_TRUE(end_of(*session, submit(*session, "b1", 1)).in_force);
  wait_until([&] { return served(*other) == 1; }, "the other one serves it");
  for (int i = 0; i < 20; ++i) ASSERT_EQ(served(*session), 1);
  first_.kill();
  const auto answer = session->predict_error(kContext, test::virtual_joints(3, 7));
  ASSERT_TRUE(answer) << sentence(answer.error());
  EXPECT_EQ(answer->model.batch_id, "b1");
}

TEST_F(Fleet, StoppingAndStartingOneAfterTheOtherLosesNoRequest) {
  start(first_);
  start(second_);
  const auto session = session_with({&first_, &second_}), other = session_with({&second_});
  ASSERT_TRUE(end_of(*session, submit(*session, "b1", 1)).in_force);
  wait_until([&] { return served(*other) == 1; }, "the other one serves it");
  for (test::Daemon* daemon : {&first_, &second_}) {
    auto restarted = std::async(std::launch::async, [daemon] {
      EXPECT_EQ(daemon->stop(), 0);
      daemon->start();
    });
    for (int asked = 0; asked < 200 || restarted.wait_for(seconds(0)) != std::future_status::ready; ++asked)
      ASSERT_EQ(served(*session), 1) << asked;
  }
}

TEST_F(Fleet, WhileTheRecordIsAwayPredictionsGoOnAndNothingAcknowledgedIsLost) {
  start(first_);
  start(second_);
  const auto session = session_with({&first_, &second_});
  ASSERT_TRUE(end_of(*session, submit(*session, "b1", 1)).in_force);
  const auto one = session_with({&first_}), other = session_with({&second_});
  wait_until([&] { return served(*one) == 1 && served(*other) == 1; }, "both serve it");
  database_.stop();
  EXPECT_EQ(served(*one), 1);
  EXPECT_EQ(served(*other), 1);
  const auto hasty = session_with({&first_}, seconds(4));
  const auto refused = hasty->submit_measurements("cell-7", "b2", test::virtual_batch_csv(60, 2));
  EXPECT_FALSE(refused) << "nothing is acknowledged that is not in the record";
  database_.start();
  wait_until([&] { return one->submit_measurements("cell-7", "b3", test::virtual_batch_csv(60, 3)).has_value(); },
             "batches are taken again");
  const auto known = batches(*other);
  EXPECT_TRUE(known.contains("b1"));
  EXPECT_TRUE(known.contains("b3"));
}

}  // namespace
}  // namespace trammel
