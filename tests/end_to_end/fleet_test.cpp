// Several servers with one record, a PostgreSQL: each takes changes, trains, serves, and may die.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <functional>
#include <future>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>

#include "server/base/text_file.h"
#include "tests/support/daemon.h"
#include "tests/support/held_answer.h"
#include "tests/support/http_client.h"
#include "tests/support/own_ports.h"
#include "tests/support/postgres.h"
#include "tests/support/process.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
constexpr seconds kFleetLimit{180};  // a lease is 15 s, and a busy machine trains slowly
const client::CallContext kContext = [] {
  client::CallContext context;
  context.cell = "cell-7";
  return context;
}();

/// Asks until it holds; each time is a call to a server.
void wait_until(const std::function<bool()>& holds, const char* what) {
  const auto deadline = std::chrono::steady_clock::now() + kFleetLimit;
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
  static std::unique_ptr<client::Session> session_with(
      std::initializer_list<const test::Daemon*> daemons, milliseconds patience = seconds(30)) {
    client::SessionOptions options = (*daemons.begin())->session_options();
    options.timeout = patience;
    options.server_ports.clear();
    for (const test::Daemon* daemon : daemons) options.server_ports.push_back(daemon->port());
    auto opened = client::Session::open(options);
    EXPECT_TRUE(opened) << sentence(opened.error());
    return std::move(*opened);
  }
  static std::int64_t submit(client::Session& session, const std::string& batch, std::uint64_t seed,
                             int poses = 60) {
    const auto job =
        session.submit_measurements("cell-7", batch, test::virtual_batch_csv(poses, seed));
    EXPECT_TRUE(job) << sentence(job.error());
    return job.value_or(0);
  }
  static client::JobStatus end_of(client::Session& session, std::int64_t job) {
    const auto over = session.wait_for_job(job, kFleetLimit, nullptr);
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

  static std::string with_pages(const test::Daemon& daemon) {
    return fmt::format("http: {{port: {}}}\n", pages_of(daemon));
  }
  static std::uint16_t pages_of(const test::Daemon& daemon) {
    return static_cast<std::uint16_t>(daemon.port() + 1);
  }
  static test::HttpAnswer page(const test::Daemon& daemon, const std::string& path) {
    return test::http_get(pages_of(daemon), path);
  }
  /// The servers of the record as this one tells them, by name, without what changes all the time.
  static std::map<std::string, nlohmann::json> fleet_of(client::Session& session) {
    std::map<std::string, nlohmann::json> fleet;
    const auto texts = session.health("", 1);
    if (!texts || texts->empty()) return fleet;
    const nlohmann::json told = nlohmann::json::parse(texts->front());
    for (nlohmann::json server : told["servers"]) {
      for (const char* key : {"heard_unix_s", "silent_s"}) server.erase(key);
      const std::string name = server["server"];
      fleet[name] = std::move(server);
    }
    return fleet;
  }
  static bool is_gone(client::Session& session, const test::Daemon& daemon) {
    const auto fleet = fleet_of(session);
    const auto found = fleet.find(daemon.name());
    return found != fleet.end() && found->second["gone"] == true;
  }
  static std::string command(const std::vector<std::string>& arguments) {
    std::vector<std::string> line = {TRAMMEL_BINARY_DIR "/clients/trammel"};
    line.insert(line.end(), arguments.begin(), arguments.end());
    const auto done = test::run(line);
    EXPECT_EQ(done.exit_code, 0) << done.out << done.err;
    return done.out;
  }
  static std::filesystem::path cell_file_of(const test::Daemon& daemon) {
    return std::filesystem::path(daemon.config_path()).parent_path() / "cell-7.yaml";
  }
  /// A robot file of its own for this server, the shipped one but for a link's length.
  static void give_another_robot(const test::Daemon& daemon) {
    const std::string cell = test::read_file(cell_file_of(daemon));
    std::smatch named;
    ASSERT_TRUE(std::regex_search(cell, named, std::regex("\nrobot: (\\S+)")));
    std::string robot = test::read_file(named[1].str());
    const std::size_t at = robot.find("d_mm: ");
    ASSERT_NE(at, std::string::npos);
    robot.insert(at + 6, "1");
    ASSERT_TRUE(write_text_file(cell_file_of(daemon).parent_path() / "robot.yaml", robot));
    ASSERT_TRUE(write_text_file(
        cell_file_of(daemon),
        std::regex_replace(cell, std::regex("\nrobot: \\S+"), "\nrobot: robot.yaml")));
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

TEST(FleetToTry, IsStartedByOneCommandAndLosesNothingWhenOneOfEachIsKilled) {
  const auto shown = test::run(
      {"/usr/bin/env", "TRAMMEL_BUILD=" TRAMMEL_BINARY_DIR,
       fmt::format("TRAMMEL_PORT={}", test::own_ports()),
       fmt::format("TRAMMEL_DOMAIN={}", test::own_domain()), TRAMMEL_SOURCE_DIR "/deploy/fleet"},
      2 * kFleetLimit);
  EXPECT_EQ(shown.exit_code, 0) << shown.out << shown.err;
  for (const char* line :
       {"job 1 of cell cell-7 done: version 1, in force", "job 2 of cell cell-7 done: version 2",
        "  one on .*: gone, not heard of since", "  trainer on .*: gone, not heard of since",
        "the same answers while the database is away", "cell-7 +third +40 .*",
        "all [0-9]+ rows are as they were written"})
    EXPECT_TRUE(std::regex_search(shown.out, std::regex(line))) << line << "\n" << shown.out;
}

TEST_F(Fleet, TheJobOfATrainingHostThatIsKilledIsDoneByAnother) {
  start(first_, "trains: false\n");
  start(second_, "serves: false\n");
  const auto session = session_with({&first_});
  const std::int64_t job = submit(*session, "b1", 1, 400);
  ASSERT_TRUE(second_.process().wait_for_line(fmt::format("job {}: ", job), kFleetLimit))
      << "it works on the job";
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
  ASSERT_TRUE(second_.process().wait_for_line(fmt::format("job {}: ", job), kFleetLimit))
      << "it works on the job";
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
  /// Two servers that answer, and two versions: 1 in force, a rollback leads to 2, another one
  /// to 1.
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
  /// The session's answer to a change whose server is killed once the transaction with
  /// `statement` is committed, before it hears of it. The server is started again.
  template <typename Ask>
  auto told_by_another(const std::string& statement, const Ask& ask) -> decltype(ask()) {
    held_.hold(statement);
    auto asked = std::async(std::launch::async, ask);
    const pid_t maker = held_.held(kFleetLimit);
    EXPECT_TRUE(maker == first_.process().pid() || maker == second_.process().pid()) << maker;
    test::Daemon& dead = maker == first_.process().pid() ? first_ : second_;
    dead.kill();
    auto told = asked.get();
    EXPECT_TRUE(told) << sentence(told.error());
    dead.start();
    return told;
  }
  std::string counted(const std::string& rows) {
    return database_.sql(direct_, "SELECT count(*) FROM " + rows);
  }

  const std::string direct_ = url_;
  test::HeldAnswer held_{direct_};
  std::unique_ptr<client::Session> session_;
};

TEST_F(FleetOfDyingServers, AChangeThatIsCommittedAndNotAnsweredIsToldByAnotherServerAndMadeOnce) {
  const char* const change = "INSERT INTO changes";
  EXPECT_EQ(told_by_another(change, [&] { return session_->rollback("cell-7"); }).value_or(0), 2);
  EXPECT_EQ(counted("audit WHERE what = 'rollback'"), "1\n");
  wait_until(
      [&] {
        return served(*session_with({&first_})) == 2 && served(*session_with({&second_})) == 2;
      },
      "served");

  client::ChangeOptions forced;
  forced.force = true;
  const std::string before = counted("activations");
  EXPECT_EQ(
      told_by_another(change, [&] { return session_->activate("cell-7", 1, forced); }).value_or(0),
      1);
  EXPECT_EQ(std::stoi(counted("activations")), std::stoi(before) + 1);

  const auto job =
      told_by_another(change, [&] { return session_->train("cell-7", {"b1"}, "", ""); });
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

TEST_F(FleetOfDyingServers, ADatabaseThatIsStoppedAndNotDeadKeepsNoServerFromEnding) {
  EXPECT_EQ(second_.stop(), 0);
  held_.hold("INSERT INTO batches");
  auto asked = std::async(std::launch::async, [&] {
    return session_with({&first_}, seconds(20))
        ->submit_measurements("cell-7", "b3", test::virtual_batch_csv(60, 3));
  });
  EXPECT_EQ(held_.held(kFleetLimit), first_.process().pid());
  database_.freeze(true);
  EXPECT_EQ(first_.stop(), 0) << first_.process().standard_error();
  EXPECT_FALSE(asked.get()) << "nobody knows whether it was made";
  database_.freeze(false);
  first_.start();
  const auto known =
      session_with({&first_})->submit_measurements("cell-7", "b3", test::virtual_batch_csv(60, 3));
  EXPECT_TRUE(known) << sentence(known.error());
  EXPECT_EQ(counted("batches WHERE id = 'b3'"), "1\n");
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
    std::atomic<bool> is_restarted = false;
    // The thread that starts a process must live as long as it does.
    auto asking = std::async(std::launch::async, [&] {
      for (int asked = 0; asked < 200 || !is_restarted; ++asked) {
        const auto answer = session->predict_error(kContext, test::virtual_joints(1, 7));
        ASSERT_TRUE(answer) << asked << ": " << sentence(answer.error());
        ASSERT_EQ(answer->model.version, 1) << asked;
      }
    });
    EXPECT_EQ(daemon->stop(), 0);
    daemon->start();
    is_restarted = true;
    asking.get();
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
  const std::string status =
      command({"status", "--service", "--port", std::to_string(first_.port()), "--domain",
               std::to_string(first_.domain())});
  EXPECT_NE(status.find(" is away since 20"), std::string::npos) << status;
  EXPECT_NE(status.find("cell-7@1 "), std::string::npos) << "what is in force: " << status;
  database_.start();
  wait_until(
      [&] {
        return one->submit_measurements("cell-7", "b3", test::virtual_batch_csv(60, 3)).has_value();
      },
      "batches are taken again");
  const auto known = batches(*other);
  EXPECT_TRUE(known.contains("b1"));
  EXPECT_TRUE(known.contains("b3"));
}

TEST_F(Fleet, WhoeverHoldsTheRecordLockedIsNamedToWhoAsksAndKeepsNoServerFromEnding) {
  start(first_);
  ASSERT_TRUE(end_of(*session_with({&first_}), submit(*session_with({&first_}), "b1", 1)).in_force);
  const auto hasty = session_with({&first_}, seconds(4));
  for (const char* mode : {"EXCLUSIVE", "ACCESS EXCLUSIVE"}) {
    const test::LockedTable somebody(url_, "audit_end, servers", mode);
    EXPECT_EQ(served(*hasty), 1);
    const auto refused = hasty->submit_measurements("cell-7", "b2", test::virtual_batch_csv(60, 2));
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().message.find("psql of role postgres"), std::string::npos)
        << sentence(refused.error());
    EXPECT_EQ(first_.stop(), 0) << mode;
    first_.start();
    EXPECT_EQ(served(*hasty), 1) << "started meanwhile";
  }
  wait_until([&] { return hasty->batches("cell-7").has_value(); }, "it is let go");
  EXPECT_EQ(batches(*hasty), std::set<std::string>{"b1"});
}

TEST_F(Fleet, EachServerShowsTheSameFleetAndOneThatIsKilledIsSaidToBeGone) {
  start(first_, with_pages(first_));
  start(second_, with_pages(second_));
  start(third_, "serves: false\n" + with_pages(third_));
  const auto one = session_with({&first_}), other = session_with({&second_});
  ASSERT_TRUE(end_of(*one, submit(*one, "b1", 1)).in_force);
  const auto is_served = [](const auto& named) {
    const nlohmann::json& server = named.second;
    return server["gone"] == false && server["changes_behind"] == 0 && server["works_on"].empty() &&
           server["cells"][0]["version"] == 1;
  };
  wait_until(
      [&] {
        const auto fleet = fleet_of(*one);
        return fleet.size() == 3 && std::all_of(fleet.begin(), fleet.end(), is_served);
      },
      "all are there and have taken up what is in force");
  const auto fleet = fleet_of(*one);
  EXPECT_EQ(fleet_of(*other), fleet);
  EXPECT_EQ(fleet.at(third_.name())["serves"], false) << "it is shown though it answers nobody";
  EXPECT_EQ(fleet.at(third_.name())["trains"], true);
  EXPECT_EQ(fleet.at(second_.name())["pid"], second_.process().pid());
  const auto jobs = one->jobs("cell-7");
  ASSERT_TRUE(jobs);
  EXPECT_TRUE(fleet.contains(jobs->front().worker)) << jobs->front().worker;
  const std::string shown = command({"status", "--service", "--port", std::to_string(first_.port()),
                                     "--domain", std::to_string(first_.domain())});
  for (const test::Daemon* daemon : {&first_, &second_, &third_}) {
    EXPECT_NE(shown.find(daemon->name() + " on "), std::string::npos) << shown;
    EXPECT_NE(page(*daemon, "/fleet").body.find("All 3 servers are there."), std::string::npos)
        << "also the last one";
  }

  third_.kill();
  wait_until([&] { return is_gone(*one, third_); }, "it is said to be gone");
  wait_until([&] { return is_gone(*other, third_); }, "also by the other one");
  wait_until(
      [&] {
        return page(second_, "/fleet").body.find("1 of 3 servers gone: " + third_.name()) !=
               std::string::npos;
      },
      "the page");
  wait_until(
      [&] {
        return page(first_, "/readyz").body.find(third_.name() + " on ") != std::string::npos;
      },
      "/readyz");
  const std::string metrics = page(first_, "/metrics").body;
  EXPECT_TRUE(std::regex_search(
      metrics, std::regex("trammel_server_there\\{[^}]*" + third_.name() + "[^}]*\\} 0")))
      << metrics;
  EXPECT_NE(metrics.find("trammel_record_reachable 1"), std::string::npos);
  EXPECT_EQ(second_.stop(), 0);
  wait_until([&] { return !fleet_of(*one).contains(second_.name()); },
             "one that ends takes its leave");
}

TEST_F(Fleet, ACellThatAServerDescribesOtherwiseIsNotServedThereUntilTheyAgree) {
  start(first_, with_pages(first_));
  const auto one = session_with({&first_});
  ASSERT_TRUE(end_of(*one, submit(*one, "b1", 1)).in_force);
  const std::string own = test::read_file(cell_file_of(second_));
  give_another_robot(second_);
  start(second_, with_pages(second_));
  const auto other = session_with({&second_}, seconds(4));
  const auto refused = other->predict_error(kContext, test::virtual_joints(1, 7));
  ASSERT_FALSE(refused);
  const std::string why = second_.name() + " has another robot file than " + first_.name();
  for (const std::string& said :
       {sentence(refused.error()), page(second_, "/readyz?cell=cell-7").body,
        second_.process().standard_error()})
    EXPECT_NE(said.find(why), std::string::npos) << said;
  wait_until([&] { return page(second_, "/fleet").body.find(why) != std::string::npos; },
             "the page, which is read from the record now and then");
  EXPECT_EQ(page(second_, "/readyz?cell=cell-7").code, 503);
  EXPECT_EQ(page(first_, "/readyz?cell=cell-7").code, 200);
  EXPECT_FALSE(other->submit_measurements("cell-7", "b2", test::virtual_batch_csv(60, 2)))
      << "it is not its cell now";
  const auto both = session_with({&second_, &first_});
  EXPECT_TRUE(both->predict_error(kContext, test::virtual_joints(1, 7))) << "the other one answers";

  command({"store", "describe", url_, "--cell", "cell-7", "--as", second_.name()});
  const auto has_former_files = [&] {
    return page(first_, "/readyz?cell=cell-7").body.find("former_files") != std::string::npos;
  };
  wait_until(has_former_files, "now it is the first one that has another file");
  EXPECT_EQ(served(*one), 1) << "it goes on with the model that it has";
  EXPECT_FALSE(one->submit_measurements("cell-7", "b3", test::virtual_batch_csv(60, 3)))
      << "and changes nothing";
  command({"store", "describe", url_, "--cell", "cell-7", "--as", first_.name()});
  wait_until([&] { return !has_former_files(); }, "a person has said whose files count");
  EXPECT_EQ(served(*one), 1);

  EXPECT_EQ(second_.stop(), 0);
  ASSERT_TRUE(write_text_file(cell_file_of(second_), own));
  second_.start();
  EXPECT_EQ(served(*session_with({&second_})), 1) << "the files agree";
  EXPECT_NE(command({"audit", "--store", url_}).find(" on " + first_.name()), std::string::npos);
}

TEST_F(Fleet, AJobIsCancelledOnAnyServerWhetherItWaitsOrRunsElsewhere) {
  start(first_, "trains: false\n");
  start(second_, "trains: false\n");
  const auto one = session_with({&first_}), other = session_with({&second_});
  const std::int64_t waits = submit(*one, "b1", 1);
  ASSERT_TRUE(other->cancel(waits)) << "whether it has heard of the job or not";
  EXPECT_EQ(end_of(*one, waits).stage, "cancelled");
  start(third_, "serves: false\n");
  const std::int64_t runs = submit(*one, "b2", 2, 400);
  ASSERT_TRUE(third_.process().wait_for_line(fmt::format("job {}: ", runs), kFleetLimit))
      << "it works on the job";
  ASSERT_TRUE(other->cancel(runs));
  const auto over = end_of(*one, runs);
  EXPECT_EQ(over.stage, "cancelled") << over.what;
  EXPECT_EQ(over.model_version, 0);
  const auto jobs = one->jobs("cell-7");
  ASSERT_TRUE(jobs);
  EXPECT_EQ(jobs->back().worker, third_.name());
}

}  // namespace
}  // namespace trammel
