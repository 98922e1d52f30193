#include "tests/support/daemon.h"

#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using client::JobStatus;

constexpr std::chrono::seconds kDaemonLimit{120};
const client::CallContext kDaemonContext = [] {
  client::CallContext context;
  context.cell = "cell-7";
  return context;
}();

class DaemonTest : public testing::Test {
 protected:
  void SetUp() override {
    daemon_.start();
    auto opened = client::Session::open(daemon_.session_options());
    ASSERT_TRUE(opened) << opened.error().message;
    session_ = std::move(*opened);
  }
  std::int64_t submit(const std::string& id, int poses) {
    const auto job = session_->submit_measurements("cell-7", id, test::virtual_batch_csv(poses, 1));
    EXPECT_TRUE(job) << job.error().message;
    return job.value_or(0);
  }
  JobStatus wait_for(std::int64_t job,
                     const std::function<void(const JobStatus&)>& listener = nullptr) {
    const auto over = session_->wait_for_job(job, kDaemonLimit, listener);
    EXPECT_TRUE(over) << over.error().message;
    return over.value_or(JobStatus{});
  }
  /// The model that answers for the cell now.
  exchange::ModelInfo model() {
    const auto answer = session_->predict_error(kDaemonContext, test::virtual_joints(3, 7));
    EXPECT_TRUE(answer) << answer.error().message;
    return answer ? answer->model : exchange::ModelInfo{};
  }

  test::Daemon daemon_;
  std::unique_ptr<client::Session> session_;
};

TEST_F(DaemonTest, ASubmittedBatchBecomesTheModelThatPredicts) {
  std::vector<std::string> stages;
  const JobStatus done = wait_for(submit("lt-07", 120), [&stages](const JobStatus& job) {
    if (stages.empty() || stages.back() != job.stage) stages.push_back(job.stage);
  });
  EXPECT_EQ(done.stage, "done") << done.what;
  EXPECT_TRUE(done.in_force) << done.what;
  EXPECT_EQ(stages.back(), "done");

  const auto answer = session_->predict_error(kDaemonContext, test::virtual_joints(20, 7));
  ASSERT_TRUE(answer) << answer.error().message;
  EXPECT_EQ(answer->model.version, done.model_version);
  EXPECT_EQ(answer->model.batch_id, "lt-07");
  ASSERT_EQ(answer->items.size(), 20u);
  double largest = 0;
  for (const auto& item : answer->items) largest = std::max(largest, std::abs(item.error_mm[0]));
  EXPECT_GT(largest, 0.1) << "the virtual robot misses by millimetres";
}

TEST_F(DaemonTest, JobsBatchesAndVersionsAreListedShownAndFetched) {
  wait_for(submit("lt-07", 60));
  const auto asked = [this](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), TRAMMEL_BINARY_DIR "/clients/trammel");
    for (const std::string& more : {std::string("--port"), std::to_string(daemon_.port()),
                                    std::string("--domain"), std::to_string(daemon_.domain())})
      arguments.push_back(more);
    return test::run(arguments);
  };
  const auto jobs = nlohmann::json::parse(asked({"jobs", "--json", "-"}).out)["jobs"];
  ASSERT_EQ(jobs.size(), 1u);
  EXPECT_EQ(jobs[0]["kind"], "train");
  EXPECT_EQ(jobs[0]["verdict"], "in_force");
  const auto batches = nlohmann::json::parse(asked({"batches", "--json", "-"}).out)["batches"];
  ASSERT_EQ(batches.size(), 1u);
  EXPECT_EQ(batches[0]["batch"], "lt-07");
  EXPECT_EQ(batches[0]["poses"], 60);
  EXPECT_FALSE(batches[0]["in_quarantine"].get<bool>());
  EXPECT_EQ(asked({"batches", "--cell", "cell-7", "--batch", "lt-07", "-o", "-"}).out,
            test::virtual_batch_csv(60, 1));
  EXPECT_EQ(asked({"batches", "--cell", "cell-7", "--batch", "lt-08", "-o", "-"}).exit_code, 3);
  const auto shown = asked({"show", "--model", "cell-7@1"});
  EXPECT_EQ(shown.exit_code, 0) << shown.err;
  EXPECT_NE(shown.out.find("lt-07"), std::string::npos) << shown.out;
  EXPECT_NE(shown.out.find("compensated"), std::string::npos) << shown.out;
}

TEST_F(DaemonTest, TheHistoryOfACellIsAPageWithItsVersionsTrainingsAndEvents) {
  wait_for(submit("lt-07", 60));
  ASSERT_TRUE(session_->activate("cell-7", 1));
  test::TemporaryFolder folder;
  const test::Finished told =
      test::run({TRAMMEL_BINARY_DIR "/clients/trammel", "history", "--cell", "cell-7", "--port",
                 std::to_string(daemon_.port()), "--domain", std::to_string(daemon_.domain()), "-o",
                 folder.file("history.html"), "--json", "-"});
  ASSERT_EQ(told.exit_code, 0) << told.err;
  const auto history = nlohmann::json::parse(told.out);
  ASSERT_EQ(history["versions"].size(), 1u);
  EXPECT_TRUE(history["versions"][0]["in_force"].get<bool>());
  EXPECT_GT(history["versions"][0]["parameters"].size(), 20u);
  ASSERT_EQ(history["trainings"].size(), 1u);
  EXPECT_EQ(history["trainings"][0]["batches"], "lt-07");
  EXPECT_GT(history["events"].size(), 1u);
  EXPECT_NE(test::read_file(folder.file("history.html")).find("Version 1 is in force"),
            std::string::npos);
}

TEST_F(DaemonTest, ServesTheSameModelAfterARestart) {
  wait_for(submit("lt-07", 60));
  const exchange::ModelInfo before = model();
  EXPECT_EQ(daemon_.stop(), 0);
  daemon_.start();
  const exchange::ModelInfo after = model();
  EXPECT_FALSE(before.id.empty());
  EXPECT_EQ(after.id, before.id);
  EXPECT_EQ(after.version, before.version);
  EXPECT_EQ(after.hash, before.hash);
}

TEST_F(DaemonTest, WhatItKeepsIsForItsOwnUserOnly) {
  wait_for(submit("lt-07", 60));
  int files = 0;
  const std::string name = std::filesystem::path(daemon_.store_path()).filename();
  for (const auto& entry : std::filesystem::recursive_directory_iterator(
           std::filesystem::path(daemon_.store_path()).parent_path())) {
    if (!entry.is_regular_file() || entry.path().string().find(name) == std::string::npos) continue;
    ++files;
    const auto for_others = std::filesystem::perms::others_all | std::filesystem::perms::group_all;
    EXPECT_EQ(entry.status().permissions() & for_others, std::filesystem::perms::none)
        << entry.path();
  }
  EXPECT_GE(files, 2) << "the store and the copy of its model";
}

TEST_F(DaemonTest, EndsCleanlyWhenAskedToAndSaysSo) {
  EXPECT_EQ(daemon_.stop(), 0) << daemon_.process().standard_error();
  EXPECT_NE(daemon_.process().standard_error().find("stopped"), std::string::npos);
  daemon_.start();
  daemon_.process().signal(SIGINT);
  EXPECT_EQ(daemon_.process().wait(std::chrono::seconds(30)), 0);
}

TEST_F(DaemonTest, EndsCleanlyWhileTrainingAndFinishesTheJobAfterwards) {
  bool stopped = false;
  const std::int64_t job = submit("lt-07", 300);
  const JobStatus done = wait_for(job, [&](const JobStatus& status) {
    if (stopped || status.share < 0.3) return;
    stopped = true;
    EXPECT_EQ(status.stage, "training") << "the training was over before it could be stopped";
    EXPECT_EQ(daemon_.stop(), 0) << daemon_.process().standard_error();
    daemon_.start();
  });
  EXPECT_TRUE(stopped);
  EXPECT_EQ(done.stage, "done") << done.what;
  EXPECT_EQ(model().version, done.model_version);
}

TEST_F(DaemonTest, ASecondOneOnTheSameStoreOrPortOrOfTheSameNameIsRefused) {
  auto same_store = daemon_.command_line();
  same_store[4] = std::to_string(daemon_.port() + 2);
  const auto second = test::run(same_store);
  EXPECT_EQ(second.exit_code, 3);
  EXPECT_NE(second.err.find(std::to_string(daemon_.process().pid())), std::string::npos)
      << second.err;

  auto same_port = daemon_.command_line();
  same_port.insert(same_port.end(), {"--store", daemon_.store_path() + "2"});
  const auto third = test::run(same_port);
  EXPECT_EQ(third.exit_code, 3);
  EXPECT_NE(third.err.find(std::to_string(daemon_.port())), std::string::npos) << third.err;

  auto same_name = same_store;
  same_name.insert(same_name.end(), {"--store", daemon_.store_path() + "2"});
  const auto fourth = test::run(same_name);
  EXPECT_EQ(fourth.exit_code, 3);
  EXPECT_NE(fourth.err.find("is called"), std::string::npos) << fourth.err;
  EXPECT_EQ(daemon_.stop(), 0);
}

TEST_F(DaemonTest, AnImportOfAnyBytesIsRefusedAndTheDaemonGoesOn) {
  wait_for(submit("lt-07", 60));
  const exchange::ModelInfo before = model();
  const std::string head = R"({"trammel_model":2,"content":)";
  for (const std::string& text :
       {head + std::string(1'000'000, '['), std::string(30'000'000, '['), std::string("{}"),
        head + "{\"a\":" + std::string(20'000'000, '7') + "}}"}) {
    const auto imported = session_->import_model("cell-7", text);
    ASSERT_FALSE(imported);
    EXPECT_EQ(imported.error().message.find("no server"), std::string::npos)
        << imported.error().message;
    EXPECT_EQ(imported.error().file, "imported model") << imported.error().message;
  }
  EXPECT_EQ(model().hash, before.hash);
  EXPECT_EQ(daemon_.stop(), 0) << daemon_.process().standard_error();
}

TEST_F(DaemonTest, ARollbackThatIsRepeatedAfterACrashGoesBackOnce) {
  wait_for(submit("lt-07", 60));
  const int first = model().version;
  const auto text = session_->export_model("cell-7", first);
  ASSERT_TRUE(text) << text.error().message;
  for (const int poses : {80, 100}) wait_for(submit(fmt::format("lt-{}", poses), poses));
  const auto versions = session_->models("cell-7");
  ASSERT_TRUE(versions) << versions.error().message;
  ASSERT_EQ(versions->size(), 3u);
  client::ChangeOptions by_force;  // the first one is worse than those after it
  by_force.force = true;
  for (const exchange::ModelInfo& version : *versions) {
    ASSERT_TRUE(session_->activate("cell-7", version.version, by_force)) << version.version;
  }
  const int last = model().version;
  client::ChangeOptions once;
  once.id = "rollback-of-this-test";
  once.expected_version = last;
  const auto back = session_->rollback("cell-7", once);
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_NE(*back, last);
  daemon_.kill();
  daemon_.start();
  const auto repeated = session_->rollback("cell-7", once);
  ASSERT_TRUE(repeated) << repeated.error().message;
  EXPECT_EQ(*repeated, *back);
  EXPECT_EQ(model().version, *back) << "it went back twice";
  once.id = "another-one";
  EXPECT_EQ(session_->rollback("cell-7", once).error().code, ErrorCode::kConflict)
      << "another version is in force";
  once.id = "rollback-of-this-test";
  EXPECT_EQ(session_->activate("cell-7", last, once).error().code, ErrorCode::kConflict)
      << "the id is of a rollback";
  EXPECT_EQ(model().version, *back);
}

TEST_F(DaemonTest, AClientOfAnotherDomainIsNotAnswered) {
  const std::string trammel = TRAMMEL_BINARY_DIR "/clients/trammel";
  const auto status = [&](std::uint32_t domain) {
    return test::run({trammel, "status", "--service", "--port", std::to_string(daemon_.port()),
                      "--domain", std::to_string(domain), "--timeout", "3"});
  };
  EXPECT_EQ(status(daemon_.domain()).exit_code, 0);
  const auto other = status(daemon_.domain() + 65);
  EXPECT_EQ(other.exit_code, 4) << other.out << other.err;
  EXPECT_NE(other.err.find(fmt::format("domain {}", daemon_.domain() + 65)), std::string::npos)
      << other.err;
  EXPECT_EQ(status(daemon_.domain()).exit_code, 0);
}

TEST_F(DaemonTest, DaemonsOfTwoDomainsEachAnswerTheirOwn) {
  auto second = daemon_.command_line();
  const std::uint16_t port = daemon_.port() + 2;
  const std::uint32_t domain = daemon_.domain() + 65;
  second[4] = std::to_string(port);
  second[6] = std::to_string(domain);
  second.insert(second.end(), {"--store", daemon_.store_path() + "2"});
  test::Process other(second);
  ASSERT_TRUE(other.wait_for_line("ready", std::chrono::seconds(30))) << other.standard_error();

  // Each client looks at both ports.
  for (const std::uint32_t of : {daemon_.domain(), domain}) {
    client::SessionOptions options = daemon_.session_options();
    options.domain = of;
    options.server_ports = {daemon_.port(), port};
    auto session = client::Session::open(options);
    ASSERT_TRUE(session) << session.error().message;
    const auto servers = (*session)->servers();
    ASSERT_TRUE(servers) << servers.error().message;
    EXPECT_EQ(servers->size(), 1u);
  }
  other.signal(SIGTERM);
  EXPECT_EQ(other.wait(std::chrono::seconds(30)), 0) << other.standard_error();
}

TEST(DaemonCommandLine, ExitsWith2OnWrongUsage) {
  EXPECT_EQ(test::run({test::trammeld_path()}).exit_code, 2);
  EXPECT_EQ(test::run({test::trammeld_path(), "--config", "x", "--bogus"}).exit_code, 2);
  EXPECT_EQ(test::run({test::trammeld_path(), "--config", "x", "--port", "80"}).exit_code, 2);
  EXPECT_EQ(test::run({test::trammeld_path(), "--help"}).exit_code, 0);
  const auto without_a_file = test::run({test::trammeld_path(), "--check"});
  EXPECT_EQ(without_a_file.err.find("trammeld: --config is required"), 0u) << without_a_file.err;
  EXPECT_NE(without_a_file.err.find("trammeld --help"), std::string::npos) << without_a_file.err;
}

TEST(DaemonCommandLine, HasTheVersionOfTheCommandLine) {
  const auto daemon = test::run({test::trammeld_path(), "--version"});
  EXPECT_EQ(daemon.exit_code, 0) << daemon.err;
  EXPECT_EQ(daemon.out, test::run({TRAMMEL_BINARY_DIR "/clients/trammel", "--version"}).out);
}

TEST(DaemonCommandLine, ExitsWith3OnARefusedServerFileAndNamesIt) {
  const test::TemporaryFolder folder;
  const std::string file = folder.write("bad.yaml", "version: 1\nserver: a\nbogus: 1\n");
  const auto refused = test::run({test::trammeld_path(), "--config", file});
  EXPECT_EQ(refused.exit_code, 3);
  EXPECT_NE(refused.err.find(file), std::string::npos) << refused.err;
  EXPECT_NE(refused.err.find("bogus"), std::string::npos) << refused.err;
  EXPECT_TRUE(refused.out.empty()) << refused.out;
}

TEST(DaemonCommandLine, RefusesTheSameMistakesWhenCheckedAndWhenStarted) {
  const test::TemporaryFolder folder;
  folder.write("cell.yaml", "version: 1\ncell: a\nrobot: " TRAMMEL_SOURCE_DIR
                            "/models/abb_irb6640-205-275.yaml\ntools: {t: null}\n"
                            "model: {error_sources: [base, complience], bias: rbf}\n");
  const std::string file =
      folder.write("server.yaml", "version: 1\nserver: a\ncells: [cell.yaml]\nstore: t.db\n");
  for (const bool check : {true, false}) {
    std::vector<std::string> command = {test::trammeld_path(), "--config", file};
    if (check) command.emplace_back("--check");
    const auto refused = test::run(command);
    EXPECT_EQ(refused.exit_code, 3);
    EXPECT_NE(refused.err.find("did you mean compliance?"), std::string::npos) << refused.err;
    EXPECT_NE(refused.err.find("`rbf` is unknown"), std::string::npos) << refused.err;
    EXPECT_FALSE(std::filesystem::exists(folder.file("t.db")));
  }
}

TEST(DaemonCommandLine, ChecksWhatShipsWithoutServing) {
  const auto checked = test::run(
      {test::trammeld_path(), "--config", TRAMMEL_SOURCE_DIR "/config/server.yaml", "--check"});
  EXPECT_EQ(checked.exit_code, 0) << checked.err;
  EXPECT_FALSE(std::filesystem::exists(TRAMMEL_SOURCE_DIR "/config/trammel.db"));
}

}  // namespace
}  // namespace trammel
