// Two servers of the same cell as processes: one writes, the other follows.
#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <atomic>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>

#include "server/base/text_file.h"
#include "tests/support/daemon.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using client::ServerStatus;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr std::chrono::seconds kLimit{120};
const client::CallContext kContext = [] {
  client::CallContext context;
  context.cell = "cell-7";
  return context;
}();

class ReplicasTest : public testing::Test {
 protected:
  ReplicasTest() { files_ = {test::read_file(first_.config_path()), test::read_file(second_.config_path())}; }

  /// Gives a server its part; it knows the other one.
  void give(int which, const std::string& part) {
    const test::Daemon& other = which == 0 ? second_ : first_;
    ASSERT_TRUE(write_text_file(daemon(which).config_path(),
                                fmt::format("{}replica: {{{}}}\ndds: {{peer_ports: [{}]}}\n",
                                            files_.at(static_cast<std::size_t>(which)), part, other.port())));
  }
  void give_usual_parts(const std::string& more = "") {
    give(0, "role: writer" + more);
    give(1, fmt::format("role: follower, of: {}{}", first_.name(), more));
  }
  void start_both() {
    first_.start();
    second_.start();
    client::SessionOptions options = first_.session_options();
    options.server_ports = {first_.port(), second_.port()};
    auto opened = client::Session::open(options);
    ASSERT_TRUE(opened) << opened.error().message;
    session_ = std::move(*opened);
  }
  test::Daemon& daemon(int which) { return which == 0 ? first_ : second_; }

  void learn(const std::string& batch, std::uint64_t seed) {
    const auto job = session_->submit_measurements("cell-7", batch, test::virtual_batch_csv(60, seed));
    ASSERT_TRUE(job) << sentence(job.error());
    const auto over = session_->wait_for_job(*job, kLimit, nullptr);
    ASSERT_TRUE(over) << sentence(over.error());
    ASSERT_EQ(over->stage, "done") << over->what;
  }
  /// What a server says of itself; empty: nothing, or it has no part.
  [[nodiscard]] static std::optional<ServerStatus> status_in(const std::vector<ServerStatus>& all,
                                                             const test::Daemon& daemon) {
    for (const ServerStatus& status : all) {
      if (status.server_id == daemon.name() && status.replica) return status;
    }
    return std::nullopt;
  }
  std::optional<ServerStatus> status_of(const test::Daemon& daemon) {
    return status_in(session_->servers().value_or(std::vector<ServerStatus>()), daemon);
  }
  /// Until it holds for what both say; a server that is not there says nothing.
  using Both = std::function<bool(const ServerStatus& first, const ServerStatus& second)>;
  [[nodiscard]] bool wait_until(const Both& holds) {
    bool is_so = false;
    const auto look = [&](const std::vector<ServerStatus>& all) {
      const auto first = status_in(all, first_), second = status_in(all, second_);
      return is_so = first && second && holds(*first, *second);
    };
    static_cast<void>(session_->servers_when(look, kLimit));
    return is_so;
  }
  /// Until the client has heard that it writes: until then a change goes to the one before, and there alone.
  [[nodiscard]] bool knows_as_writer(const test::Daemon& daemon) {
    bool is_so = false;
    const auto look = [&](const std::vector<ServerStatus>& all) {
      const auto status = status_in(all, daemon);
      return is_so = status && status->replica->writes;
    };
    static_cast<void>(session_->servers_when(look, kLimit));
    return is_so;
  }
  /// Both serve the same model, by the same decisions.
  [[nodiscard]] static bool same(const ServerStatus& first, const ServerStatus& second) {
    const auto &a = *first.replica, &b = *second.replica;
    return a.epoch == b.epoch && a.cells.at(0).hash == b.cells.at(0).hash && a.cells.at(0).version > 0;
  }
  /// A command that knows one server only.
  test::Finished ask(const test::Daemon& daemon, std::vector<std::string> words) {
    words.insert(words.begin(), TRAMMEL_BINARY_DIR "/clients/trammel");
    words.insert(words.end(), {"--port", std::to_string(daemon.port()), "--domain", std::to_string(daemon.domain())});
    return test::run(words, kLimit);
  }

  nlohmann::json batches_of(const test::Daemon& daemon) {
    return nlohmann::json::parse(ask(daemon, {"batches", "--cell", "cell-7", "--json", "-"}).out).at("batches");
  }
  bool wait_until_it_keeps(const test::Daemon& daemon, const std::string& batch) {
    std::string kept;
    for (const auto until = steady_clock::now() + kLimit;
         kept.find(batch) == std::string::npos && steady_clock::now() < until;)
      kept = ask(daemon, {"batches", "--cell", "cell-7", "--json", "-"}).out;
    return kept.find(batch) != std::string::npos;
  }
  /// What the shipped robot would measure with a tool that the model in force does not know.
  static std::string measured_with_another_tool() {
    const test::TemporaryFolder folder;
    std::string truth = test::read_file(TRAMMEL_SOURCE_DIR "/models/truth/chapter-5.yaml");
    truth.insert(truth.find("noise:"), "  tool: {tx_mm: 3.0, tz_mm: -2.0}\n");
    const std::string plan = folder.file("plan.csv"), measured = folder.file("measured.csv");
    const auto tell = [](std::vector<std::string> words) {
      words.insert(words.begin(), TRAMMEL_BINARY_DIR "/clients/trammel");
      words.insert(words.end(), {"--cell", test::shipped_cell_file()});
      EXPECT_EQ(test::run(words, kLimit).exit_code, 0);
    };
    tell({"plan", "--count", "60", "--seed", "9", "-o", plan});
    tell({"simulate", "--truth", folder.write("tool.yaml", truth), "--plan", plan, "-o", measured});
    return test::read_file(measured);
  }
  /// Why it keeps the batch out; empty: it does not, or does not have it.
  std::string why_kept_out(const test::Daemon& daemon, const std::string& batch) {
    for (const nlohmann::json& one : batches_of(daemon)) {
      if (one.at("batch") == batch) return one.at("reason");
    }
    return "";
  }

  /// Asks this one alone.
  static bool wait_until_it_answers(const test::Daemon& daemon) {
    const auto session = client::Session::open(daemon.session_options());
    if (!session) return false;
    for (const auto until = steady_clock::now() + kLimit; steady_clock::now() < until;) {
      if ((*session)->predict_error(kContext, test::virtual_joints(3, 7))) return true;
    }
    return false;
  }

  test::Daemon first_{0}, second_{1};
  std::vector<std::string> files_;
  std::unique_ptr<client::Session> session_;
};

TEST_F(ReplicasTest, AFollowerThatTakesOnACellGetsItsModelAndBatchesThoughTheyAreOld) {
  std::string other = test::read_file(std::filesystem::path(first_.config_path()).replace_filename("cell-7.yaml"));
  other.replace(other.find("cell: cell-7"), 12, "cell: cell-8");
  for (const int which : {0, 1}) {
    const std::filesystem::path server_file = daemon(which).config_path();
    ASSERT_TRUE(write_text_file(std::filesystem::path(server_file).replace_filename("cell-8.yaml"), other));
  }
  const auto name_cells = [this](std::size_t which, const std::string& before, const std::string& now) {
    files_[which].replace(files_[which].find(before), before.size(), now);
  };
  name_cells(0, "[cell-7.yaml]", "[cell-7.yaml, cell-8.yaml]");
  name_cells(1, "[cell-7.yaml]", "[cell-8.yaml]");
  const std::string copies = ", batches_to_followers: true, copy_timeout_s: 1";
  give_usual_parts(copies);
  start_both();
  learn("lt-1", 1);
  name_cells(1, "[cell-8.yaml]", "[cell-8.yaml, cell-7.yaml]");
  give_usual_parts(copies);
  second_.process().signal(SIGHUP);
  ASSERT_TRUE(second_.process().wait_for_line("taken on: cells: cell-7", kLimit)) << second_.process().standard_error();
  ASSERT_TRUE(wait_until(same)) << second_.process().standard_error();
  EXPECT_TRUE(wait_until_it_keeps(second_, "lt-1"));
  first_.kill();
  const auto answer = session_->predict_error(kContext, test::virtual_joints(3, 7));
  ASSERT_TRUE(answer) << sentence(answer.error());
  EXPECT_EQ(answer->model.version, 1);
}

TEST_F(ReplicasTest, AFollowerServesWhatTheWriterPutInForceAlsoAfterItsOwnRestart) {
  give_usual_parts();
  start_both();
  learn("lt-1", 1);
  ASSERT_TRUE(wait_until(same));
  EXPECT_EQ(status_of(second_)->replica->follows, first_.name());
  first_.kill();
  second_.kill();
  second_.start();
  const auto answer = session_->predict_error(kContext, test::virtual_joints(3, 7));
  ASSERT_TRUE(answer) << sentence(answer.error());
  EXPECT_EQ(answer->model.version, 1);
  EXPECT_EQ(answer->model.batch_id, "lt-1");
}

TEST_F(ReplicasTest, AModelThatAFollowerCannotLoadComesFromTheWriterOnceMore) {
  give_usual_parts();
  start_both();
  learn("lt-1", 1);
  ASSERT_TRUE(wait_until(same));
  second_.kill();
  SQLite::Database(second_.store_path(), SQLite::OPEN_READWRITE).exec("UPDATE models SET content = 'damaged'");
  std::filesystem::remove_all(second_.store_path() + ".models");
  second_.start();
  ASSERT_TRUE(wait_until_it_answers(second_)) << second_.process().standard_error();
  first_.kill();
  second_.kill();
  second_.start();
  EXPECT_TRUE(wait_until_it_answers(second_)) << "it was not stored: " << second_.process().standard_error();
}

TEST_F(ReplicasTest, ARollbackIsFollowedThoughItsVersionIsLower) {
  give_usual_parts();
  start_both();
  learn("lt-1", 1);
  learn("lt-2", 2);
  ASSERT_TRUE(session_->activate("cell-7", 2));
  ASSERT_TRUE(wait_until(
      [](const ServerStatus& a, const ServerStatus& b) { return same(a, b) && b.replica->cells.at(0).version == 2; }));
  ASSERT_TRUE(session_->rollback("cell-7"));
  EXPECT_TRUE(wait_until(
      [](const ServerStatus& a, const ServerStatus& b) { return same(a, b) && b.replica->cells.at(0).version == 1; }));
}

TEST_F(ReplicasTest, AChangeThatIsAskedOfTheFollowerIsReferredToTheWriter) {
  give_usual_parts();
  start_both();
  learn("lt-1", 1);
  ASSERT_TRUE(wait_until(same));
  // With the second one alone it is not waited for: the timeout is longer than the test may take.
  const auto refused = ask(second_, {"activate", "--model", "cell-7@1", "--timeout", "600"});
  EXPECT_EQ(refused.exit_code, 4) << refused.out;
  EXPECT_NE(refused.err.find("host and port of " + first_.name()), std::string::npos) << refused.err;
  EXPECT_TRUE(session_->activate("cell-7", 1));
}

TEST_F(ReplicasTest, ABatchIsOnTheFollowerBeforeItIsAcknowledged) {
  give_usual_parts(", batches_to_followers: true, copy_timeout_s: 30");
  start_both();
  ASSERT_TRUE(
      wait_until([&](const ServerStatus&, const ServerStatus& b) { return b.replica->follows == first_.name(); }));
  ASSERT_TRUE(session_->submit_measurements("cell-7", "lt-1", test::virtual_batch_csv(60, 1)));
  first_.kill();
  const auto kept = ask(second_, {"batches", "--cell", "cell-7", "--json", "-"});
  EXPECT_EQ(kept.exit_code, 0) << kept.err;
  EXPECT_NE(kept.out.find("lt-1"), std::string::npos) << kept.out;
}

TEST_F(ReplicasTest, WhatWasDiscardedIsDiscardedOnTheFollowerBeforeItIsAcknowledged) {
  give_usual_parts(", batches_to_followers: true, copy_timeout_s: 30");
  start_both();
  learn("lt-1", 1);
  ASSERT_TRUE(wait_until_it_keeps(second_, "lt-1")) << "the writer knows of it";
  ASSERT_TRUE(session_->submit_measurements("cell-7", "lt-2", test::virtual_batch_csv(60, 2)));
  client::ChangeOptions because;
  because.reason = "the tracker was bumped";
  ASSERT_TRUE(session_->discard("cell-7", "lt-2", because));
  first_.kill();
  EXPECT_EQ(why_kept_out(second_, "lt-2"), "discarded: the tracker was bumped");
  give(1, "role: writer");
  second_.process().signal(SIGHUP);
  ASSERT_TRUE(knows_as_writer(second_)) << second_.process().standard_error();
  learn("lt-3", 3);
  const auto versions = session_->models("cell-7");
  ASSERT_TRUE(versions) << sentence(versions.error());
  for (const client::ModelInfo& version : *versions)
    EXPECT_EQ(version.batch_id.find("lt-2"), std::string::npos) << version.batch_id;
}

TEST_F(ReplicasTest, WhatIsKeptOutIsKeptOutOnTheFollowerAndReleasedThereBeforeThatIsAcknowledged) {
  give_usual_parts(", batches_to_followers: true, copy_timeout_s: 30");
  start_both();
  learn("lt-1", 1);
  ASSERT_TRUE(session_->submit_measurements("cell-7", "lt-2", measured_with_another_tool()));
  for (const auto until = steady_clock::now() + kLimit;
       why_kept_out(second_, "lt-2").empty() && steady_clock::now() < until;) {
  }
  ASSERT_NE(why_kept_out(second_, "lt-2").find("the tool is another one"), std::string::npos);
  ASSERT_TRUE(session_->release("cell-7", "lt-2"));
  first_.kill();
  EXPECT_TRUE(wait_until_it_keeps(second_, "lt-2"));
  EXPECT_EQ(why_kept_out(second_, "lt-2"), "");
}

TEST_F(ReplicasTest, OnceThePartIsHandedBackWhatTheTwoKnowOfBatchesIsHeldAgainstEachOtherAgain) {
  give_usual_parts(", batches_to_followers: true, copy_timeout_s: 30");
  start_both();
  learn("lt-1", 1);
  ASSERT_TRUE(wait_until_it_keeps(second_, "lt-1"));
  ASSERT_TRUE(wait_until(same));
  give(1, "role: writer");  // and copies nothing
  second_.process().signal(SIGHUP);
  ASSERT_TRUE(wait_until([](const ServerStatus& a, const ServerStatus& b) {
    return same(a, b) && !a.replica->writes && b.replica->writes;
  })) << second_.process().standard_error();
  ASSERT_TRUE(session_->discard("cell-7", "lt-1"));
  give(1, fmt::format("role: follower, of: {}", first_.name()));
  second_.process().signal(SIGHUP);
  ASSERT_TRUE(wait_until([](const ServerStatus& a, const ServerStatus&) { return a.replica->writes; }));
  EXPECT_TRUE(first_.process().wait_for_line("batch lt-1 of cell cell-7 was discarded", kLimit))
      << first_.process().standard_error();
}

TEST_F(ReplicasTest, APromotedFollowerLearnsOnWithAllThatTheWriterHadLearnedFrom) {
  give_usual_parts(", batches_to_followers: true, copy_timeout_s: 30");
  start_both();
  learn("lt-1", 1);
  learn("lt-2", 2);  // version 2, whether it is in force or not
  ASSERT_TRUE(wait_until(same));
  ASSERT_TRUE(
      wait_until([](const ServerStatus&, const ServerStatus& b) { return b.replica->cells.at(0).newest == 2; }));
  const auto is_learned = [](const nlohmann::json& batches) {
    return batches.size() == 2 && batches[0]["learned"] == true && batches[1]["learned"] == true;
  };
  for (const auto until = steady_clock::now() + kLimit;
       !is_learned(batches_of(second_)) && steady_clock::now() < until;) {
  }
  ASSERT_TRUE(is_learned(batches_of(second_)));
  first_.kill();
  give(1, "role: writer");
  second_.process().signal(SIGHUP);
  ASSERT_TRUE(knows_as_writer(second_)) << second_.process().standard_error();
  learn("lt-3", 3);
  const auto versions = session_->models("cell-7");
  ASSERT_TRUE(versions) << sentence(versions.error());
  EXPECT_EQ(versions->back().version, 3) << "version 2 is another model";
  EXPECT_EQ(versions->back().batch_id, "lt-1+lt-2+lt-3");
}

TEST_F(ReplicasTest, ABatchThatOnlyTheOldWriterDiscardedIsSaidByTheNewOne) {
  give_usual_parts(", batches_to_followers: true, copy_timeout_s: 1");
  start_both();
  learn("lt-1", 1);
  ASSERT_TRUE(wait_until(same));
  ASSERT_TRUE(wait_until_it_keeps(second_, "lt-1"));
  second_.kill();
  ASSERT_TRUE(session_->discard("cell-7", "lt-1"));
  first_.kill();
  give(1, "role: writer, batches_to_followers: true, copy_timeout_s: 1");
  second_.start();
  ASSERT_TRUE(knows_as_writer(second_)) << second_.process().standard_error();
  first_.start();
  ASSERT_TRUE(second_.process().wait_for_line("batch lt-1 of cell cell-7 was discarded", kLimit))
      << second_.process().standard_error();
  ASSERT_TRUE(session_->discard("cell-7", "lt-1")) << "once it is discarded there, too, nothing is left to say";
  EXPECT_TRUE(second_.process().wait_for_line("over: " + first_.name() + " may lack", kLimit))
      << second_.process().standard_error();
}

TEST_F(ReplicasTest, AFollowerThatWasAwayGetsTheBatchesThatItLacks) {
  give_usual_parts(", batches_to_followers: true, copy_timeout_s: 1");
  start_both();
  ASSERT_TRUE(wait_until([](const ServerStatus&, const ServerStatus&) { return true; }));
  second_.kill();
  learn("lt-1", 1);
  second_.start();
  ASSERT_TRUE(wait_until(same));
  EXPECT_TRUE(wait_until_it_keeps(second_, "lt-1"));
}

TEST_F(ReplicasTest, ABatchThatAFollowerRefusesKeepsNoOtherOneFromIt) {
  give(0, "role: writer, batches_to_followers: true, copy_timeout_s: 1");
  second_.start();  // alone: it gets a batch of the same name
  const auto alone = client::Session::open(second_.session_options());
  ASSERT_TRUE(alone) << sentence(alone.error());
  ASSERT_TRUE((*alone)->submit_measurements("cell-7", "lt-1", test::virtual_batch_csv(60, 9)));
  EXPECT_EQ(second_.stop(), 0);
  give(1, fmt::format("role: follower, of: {}", first_.name()));
  first_.start();
  const auto session = client::Session::open(first_.session_options());
  ASSERT_TRUE(session) << sentence(session.error());
  ASSERT_TRUE((*session)->submit_measurements("cell-7", "lt-1", test::virtual_batch_csv(60, 1)));
  ASSERT_TRUE((*session)->submit_measurements("cell-7", "lt-2", test::virtual_batch_csv(60, 2)));
  second_.start();
  EXPECT_TRUE(wait_until_it_keeps(second_, "lt-2"));
}

TEST_F(ReplicasTest, WhatFollowersMayLackIsReadFromTheOneThatWrites) {
  give(0, fmt::format("role: follower, of: {}", second_.name()));
  give(1, "role: writer");
  start_both();
  ASSERT_TRUE(wait_until([](const ServerStatus&, const ServerStatus& second) { return second.replica->writes; }));
  learn("lt-1", 1);
  ASSERT_TRUE(wait_until(same));
  for (int i = 0; i < 3; ++i) {
    const auto batch = session_->export_batch("cell-7", "lt-1");
    ASSERT_TRUE(batch) << sentence(batch.error());
    EXPECT_EQ(*batch, test::virtual_batch_csv(60, 1));
  }
  second_.kill();
  const auto models = session_->models("cell-7");
  ASSERT_TRUE(models) << "of the follower, where no other one is there: " << sentence(models.error());
  EXPECT_EQ(models->size(), 1u);
}

TEST_F(ReplicasTest, WhenTheWriterIsKilledTheFollowerAnswersAtOnce) {
  give_usual_parts();
  start_both();
  learn("lt-1", 1);
  ASSERT_TRUE(wait_until(same));
  const auto joints = test::virtual_joints(3, 7);
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(session_->predict_error(kContext, joints));
  first_.kill();
  const auto answer = session_->predict_error(kContext, joints);
  ASSERT_TRUE(answer) << sentence(answer.error());
  EXPECT_EQ(answer->model.batch_id, "lt-1");
}

TEST_F(ReplicasTest, AFollowerThatWasStoppedForLongerThanItsLeaseFollowsAgain) {
  give_usual_parts();
  start_both();
  learn("lt-1", 1);
  ASSERT_TRUE(wait_until(same));
  // Each client makes the two confirm more of each other's endpoints: what has been confirmed is not told again.
  for (int i = 0; i < 20; ++i)
    ASSERT_EQ(ask(i % 2 == 0 ? first_ : second_, {"models", "--cell", "cell-7"}).exit_code, 0);
  second_.process().signal(SIGSTOP);
  bool gone = false;
  const auto look = [&](const std::vector<ServerStatus>& all) { return gone = !status_in(all, second_); };
  static_cast<void>(session_->servers_when(look, kLimit));
  second_.process().signal(SIGCONT);
  ASSERT_TRUE(gone);
  learn("lt-2", 2);
  const auto versions = session_->models("cell-7");
  ASSERT_TRUE(versions) << sentence(versions.error());
  const int newest = versions->back().version;
  ASSERT_EQ(newest, 2);
  const auto activated = session_->activate("cell-7", newest);
  ASSERT_TRUE(activated) << sentence(activated.error());
  EXPECT_TRUE(wait_until([&](const ServerStatus& a, const ServerStatus& b) {
    return same(a, b) && b.replica->cells.at(0).version == newest;
  }));
}

TEST_F(ReplicasTest, APromotedFollowerWritesAndTheOldWriterComesBackAsItsFollower) {
  give_usual_parts();
  start_both();
  learn("lt-1", 1);
  learn("lt-2", 2);  // version 2 of the first one, whether it is in force or not
  ASSERT_TRUE(wait_until(same));
  first_.kill();
  give(1, "role: writer");
  second_.process().signal(SIGHUP);
  ASSERT_TRUE(knows_as_writer(second_)) << second_.process().standard_error();
  learn("lt-3", 3);
  const auto versions = session_->models("cell-7");
  ASSERT_TRUE(versions) << sentence(versions.error());
  const auto activated = session_->activate("cell-7", versions->back().version);
  ASSERT_TRUE(activated) << sentence(activated.error());
  first_.start();  // its file still says that it writes
  ASSERT_TRUE(wait_until([](const ServerStatus& a, const ServerStatus& b) {
    return same(a, b) && !a.replica->writes && b.replica->writes;
  }));
  const auto kept = ask(first_, {"models", "--cell", "cell-7", "--json", "-"});
  for (const char* batch : {"lt-1", "lt-2", "lt-3"})
    EXPECT_NE(kept.out.find(batch), std::string::npos) << batch << " is written over: " << kept.out;
}

TEST_F(ReplicasTest, OfTwoWritersOneStopsAndSaysSoAndNothingIsLost) {
  give(0, "role: writer");
  give(1, "role: writer");
  first_.start();
  client::SessionOptions options = first_.session_options();
  options.server_ports = {first_.port(), second_.port()};
  auto opened = client::Session::open(options);
  ASSERT_TRUE(opened) << opened.error().message;
  session_ = std::move(*opened);
  learn("lt-1", 1);
  second_.start();  // has decided nothing yet: its epoch is the lower one
  ASSERT_TRUE(second_.process().wait_for_line("two servers write", kLimit)) << second_.process().standard_error();
  EXPECT_TRUE(wait_until([](const ServerStatus& a, const ServerStatus& b) {
    return same(a, b) && a.replica->writes && !b.replica->writes && a.replica->cells.at(0).version == 1;
  }));
}

TEST_F(ReplicasTest, AFollowerWritesByItselfWhereItsFileSaysAfterHowLong) {
  give(0, "role: writer");
  give(1, fmt::format("role: follower, of: {}, promote_after_s: 3", first_.name()));
  start_both();
  learn("lt-1", 1);
  ASSERT_TRUE(wait_until(same));
  first_.kill();
  const auto writes = [&](const std::vector<ServerStatus>& all) {
    const auto second = status_in(all, second_);
    return second && second->replica->writes;
  };
  const auto left = session_->servers_when(writes, kLimit);
  ASSERT_TRUE(left && writes(*left));
  EXPECT_TRUE(session_->activate("cell-7", 1));
}

TEST_F(ReplicasTest, StoppingAndStartingOneAfterTheOtherLosesNoRequest) {
  give_usual_parts();
  start_both();
  learn("lt-1", 1);
  ASSERT_TRUE(wait_until(same));
  std::atomic<int> asked{0}, failed{0};
  std::jthread client([&](const std::stop_token& stop) {
    const auto joints = test::virtual_joints(3, 7);
    while (!stop.stop_requested()) {
      ++asked;
      if (!session_->predict_error(kContext, joints)) ++failed;
    }
  });
  for (const int which : {0, 1}) {
    const int before = asked;
    EXPECT_EQ(daemon(which).stop(), 0);
    daemon(which).start();
    while (asked < before + 200) std::this_thread::yield();
    EXPECT_TRUE(wait_until(same));
  }
  client.request_stop();
  client.join();
  EXPECT_EQ(failed, 0) << "of " << asked;
}

}  // namespace
}  // namespace trammel
