// The table of states in server/http/README.md, state by state.
#include "server/http/readiness.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "tests/http/watched_server.h"

namespace trammel {
namespace {

using State = CellReadiness::State;
namespace fs = std::filesystem;

/// Every `old` in the file becomes `with`, which is as long.
void replace_in_file(const std::string& path, const std::string& old, const std::string& with) {
  std::string bytes = test::read_file(path);
  for (std::size_t at = bytes.find(old); at != std::string::npos; at = bytes.find(old, at))
    bytes.replace(at, old.size(), with);
  std::ofstream(path, std::ios::binary) << bytes;
}

class ReadinessTest : public testing::Test {
 protected:
  CellReadiness cell(const std::string& name = "cell-7") {
    const Watched watched = server_.watched();
    for (CellReadiness& one : cells_readiness(watched)) {
      if (one.cell == name) return std::move(one);
    }
    return {};
  }
  Readiness ready(ServerPhase phase = ServerPhase::kServing, const std::string& of = "") {
    const Watched watched = server_.watched();
    return readiness(watched, phase, of);
  }
  void expect_dark(State state, const std::string& why) {
    const CellReadiness now = cell();
    EXPECT_STREQ(to_text(now.state), to_text(state)) << now.why;
    EXPECT_TRUE(now.is_dark());
    EXPECT_NE(now.why.find(why), std::string::npos) << now.why;
    const Readiness all = ready();
    EXPECT_FALSE(all.ready);
    EXPECT_EQ(all.told["state"], "dark");
    EXPECT_EQ(all.told["dark"][0]["cell"], "cell-7");
    EXPECT_EQ(all.told["dark"][0]["state"], to_text(state));
    EXPECT_NE(all.told["dark"][0]["why"].get<std::string>().find(why), std::string::npos);
  }
  void expect_ready(State state) {
    const CellReadiness now = cell();
    EXPECT_STREQ(to_text(now.state), to_text(state)) << now.why;
    const Readiness all = ready();
    EXPECT_TRUE(all.ready) << all.told;
    EXPECT_TRUE(all.told["dark"].empty());
  }
  void train(const std::string& batch, std::uint64_t seed) {
    server_.submit("cell-7", batch, seed);
    server_.work();
  }
  /// On the same store, as at a start.
  void restart(std::size_t budget = ModelRegistry::kNoLimit) {
    server_.take_down();
    server_.set_up(budget);
  }
  /// With the models loaded.
  void take_up() { static_cast<void>(server_.trainer().take_up()); }

  test::WatchedServer server_;
};

TEST_F(ReadinessTest, StartingIsNotReady) {
  const Readiness now = ready(ServerPhase::kStarting);
  EXPECT_FALSE(now.ready);
  EXPECT_EQ(now.told["state"], "starting");
}

TEST_F(ReadinessTest, StoppingIsNotReady) {
  const Readiness now = ready(ServerPhase::kStopping);
  EXPECT_FALSE(now.ready);
  EXPECT_EQ(now.told["state"], "stopping");
}

TEST_F(ReadinessTest, APartThatHangsIsNamedAndNothingIsReady) {
  train("b1", 1);
  server_.movement.still = {"replies"};
  const Readiness now = ready();
  EXPECT_FALSE(now.ready);
  EXPECT_EQ(now.told["state"], "hung");
  EXPECT_NE(now.told["why"].get<std::string>().find("replies"), std::string::npos);
}

TEST_F(ReadinessTest, ACellWithoutAModelIsDarkAndSaysWhatToDo) {
  expect_dark(State::kUntrained, "submit a batch");
}

TEST_F(ReadinessTest, ACellWhoseFirstModelIsBeingMadeIsDark) {
  const std::int64_t job = server_.submit("cell-7", "b1", 1);
  expect_dark(State::kInTraining, fmt::format("job {}", job));
}

TEST_F(ReadinessTest, ACellWhoseFirstTrainingFailedIsDarkAndSaysWhy) {
  const std::int64_t job = server_.submit("cell-7", "b1", 1);
  server_.take_down();
  server_.set_up();
  ASSERT_TRUE(server_.store().set_job_running(job));
  ASSERT_TRUE(server_.store().set_job_failed(job, "the poses show nothing", {}));
  expect_dark(State::kTrainingEnded, "the poses show nothing");
}

TEST_F(ReadinessTest, ACellWithItsModelInMemoryIsServed) {
  train("b1", 1);
  expect_ready(State::kServed);
  EXPECT_EQ(cell().version, 1);
}

TEST_F(ReadinessTest, AModelThatIsStillToBeLoadedIsDarkUntilItIs) {
  train("b1", 1);
  restart();
  server_.registry().announce("cell-7", 1);
  expect_dark(State::kLoading, "being loaded");
  take_up();
  expect_ready(State::kServed);
}

TEST_F(ReadinessTest, AModelForWhichMemoryHasNoRoomIsReadyOnDisk) {
  train("b1", 1);
  restart(0);
  server_.registry().announce("cell-7", 1);
  expect_ready(State::kOnDisk);
}

TEST_F(ReadinessTest, AModelOfAnotherRobotIsDarkAndSaysSo) {
  train("b1", 1);
  server_.take_down();
  auto other = *test::small_cell("cell-7");
  other.tools["spindle"]->translation().x() += 0.1;
  other.tools = {{"gripper", other.tools.begin()->second}};
  server_.set_cells({{"cell-7", std::make_shared<const Cell>(other)}});
  server_.set_up();
  take_up();
  expect_dark(State::kOfAnotherRobot, "version 1");
}

TEST_F(ReadinessTest, AnOlderVersionThatIsServedInPlaceOfADamagedOneIsReadyAndNoted) {
  train("b1", 1);
  train("b2", 2);
  ASSERT_TRUE(server_.trainer().activate("cell-7", 2, {}, true));
  server_.take_down();
  fs::remove_all(server_.store_path() + ".models");
  replace_in_file(server_.store_path(), "\"batch_id\":\"b1+b2\"", "\"batch_id\":\"b1-b2\"");
  server_.set_up();
  take_up();
  expect_ready(State::kOlderServed);
  EXPECT_EQ(cell().version, 1);
  EXPECT_NE(ready().told["noted"][0]["why"].get<std::string>().find("instead of a newer one"),
            std::string::npos);
}

TEST_F(ReadinessTest, AModelThatIsServedFromItsCopyIsReadyAndItIsSaidWhichAndWhy) {
  train("b1", 1);
  server_.take_down();
  replace_in_file(server_.store_path(), "\"batch_id\":\"b1\"", "\"batch_id\":\"xx\"");
  server_.set_up();
  take_up();
  expect_ready(State::kCopyServed);
  const std::string said = "version 1 is served from its copy " + server_.store_path() + ".models/";
  EXPECT_NE(ready().told["noted"][0]["why"].get<std::string>().find(said), std::string::npos)
      << ready().told;
  EXPECT_EQ(server_.trainer().troubles(), std::vector<std::string>{cell().why}) << "once";
}

TEST_F(ReadinessTest, AModelThatCannotBeReadIsDarkAndSaysWhy) {
  train("b1", 1);
  server_.take_down();
  fs::remove_all(server_.store_path() + ".models");
  replace_in_file(server_.store_path(), "\"batch_id\":\"b1\"", "\"batch_id\":\"xx\"");
  server_.set_up();
  take_up();
  expect_dark(State::kUnreadable, "is not served");
}

TEST_F(ReadinessTest, AStoreThatCannotBeWrittenIsNotedAndTheCellStaysReady) {
  train("b1", 1);
  fs::rename(server_.store_path(), server_.store_path() + ".away");
  EXPECT_FALSE(server_.store().try_again()) << "the store is gone";
  const Readiness now = ready();
  EXPECT_TRUE(now.ready) << now.told;
  ASSERT_EQ(now.told["notes"].size(), 1u);
  EXPECT_NE(now.told["notes"][0].get<std::string>().find("cannot be"), std::string::npos);
}

TEST_F(ReadinessTest, AStoreThatCannotBeReadIsNotedWhereCopiesOfItsModelsAreServed) {
  train("b1", 1);
  server_.take_down();
  std::ofstream(server_.store_path(), std::ios::binary) << std::string(4096, 'x');
  server_.set_up();
  take_up();
  expect_ready(State::kCopyServed);
  EXPECT_NE(ready().told["notes"][0].get<std::string>().find("copies of its models are served"),
            std::string::npos);
}

TEST_F(ReadinessTest, OneCellCanBeAskedForAloneAndAForeignOneIsNotReady) {
  server_.take_down();
  server_.set_cells(
      {{"cell-7", test::small_cell("cell-7")}, {"cell-8", test::small_cell("cell-8")}});
  server_.set_up();
  train("b1", 1);
  EXPECT_FALSE(ready().ready) << "cell-8 is dark";
  EXPECT_TRUE(ready(ServerPhase::kServing, "cell-7").ready);
  EXPECT_FALSE(ready(ServerPhase::kServing, "cell-8").ready);
  EXPECT_FALSE(ready(ServerPhase::kServing, "cell-9").ready);
}

}  // namespace
}  // namespace trammel
