#include "server/config/start_check.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <map>

#include "server/dds/port_lock.h"
#include "server/store/store.h"
#include "tests/support/demand.h"
#include "tests/support/own_ports.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

namespace fs = std::filesystem;

using test::own_ports;

class StartCheckTest : public testing::Test {
 protected:
  StartCheckTest() {
    folder_.write("robot.yaml", test::small_robot_yaml());
    folder_.write("cell-7.yaml", test::small_cell_yaml("cell-7"));
    folder_.write("cell-8.yaml", test::small_cell_yaml("cell-8"));
    write_server("");
  }
  void write_server(const std::string& more, const std::string& store = "t.db") {
    server_ = folder_.write(
        "server.yaml",
        fmt::format("version: 1\nserver: a\ncells: [cell-7.yaml, cell-8.yaml]\nstore: {}\n"
                    "dds: {{port: {}}}\n{}",
                    store, own_ports(), more));
  }
  /// cell-7 with `old` replaced.
  void change_cell(const std::string& old, const std::string& with) {
    std::string cell = test::small_cell_yaml("cell-7");
    const auto at = cell.find(old);
    ASSERT_NE(at, std::string::npos) << old;
    folder_.write("cell-7.yaml", cell.replace(at, old.size(), with));
  }
  /// After which the folder holds what it held.
  StartCheck check() const {
    const auto before = listing();
    StartCheck found = check_start(read_server(server_), server_);
    EXPECT_EQ(listing(), before) << "the check changed something";
    return found;
  }
  std::string problems() const {
    std::string all;
    for (const Error& problem : check().problems) all += sentence(problem) + "\n";
    return all;
  }
  /// One of the problems is of this file and key, with this word or value as it stands there.
  void expect_problem(const std::string& file, const std::string& field,
                      const std::string& is = "") const {
    const std::vector<Error> found = check().problems;
    const auto is_it = [&](const Error& problem) {
      const std::string value = problem.value ? fmt::format("{:g}", *problem.value) : "";
      return problem.file == folder_.file(file) && problem.field == field &&
             (is.empty() || problem.text == is || problem.text == folder_.file(is) || value == is);
    };
    EXPECT_TRUE(std::any_of(found.begin(), found.end(), is_it))
        << file << " " << field << " is not in\n"
        << problems();
  }

  test::TemporaryFolder folder_;
  std::string server_;

 private:
  std::map<std::string, std::string> listing() const {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder_.path())) {
      files[entry.path().string()] =
          entry.is_regular_file() ? test::read_file(entry.path().string()) : "";
    }
    return files;
  }
};

TEST_F(StartCheckTest, WhatCanStartHasNoProblems) {
  EXPECT_EQ(problems(), "");
  static_cast<void>(
      test::demand(Store::open(folder_.file("t.db"))));  // a store that was there before
  EXPECT_EQ(problems(), "");
}

TEST_F(StartCheckTest, WhatTheFirstTrainingWouldRefuseIsNamedWithFileKeyAndValue) {
  change_cell("bias: none", "bias: rbf");
  expect_problem("cell-7.yaml", "model: bias", "rbf");
  change_cell("[base]", "[base, complience]");
  expect_problem("cell-7.yaml", "model: error_sources", "complience");
  change_cell("[base]", "[payload]");
  expect_problem("cell-7.yaml", "model: error_sources", "payload");
  change_cell("[base]", "[compliance_first_order, compliance_linear]");
  expect_problem("cell-7.yaml", "model: error_sources", "compliance_linear");
  change_cell("[base]", "['gear_transmission:9']");
  expect_problem("cell-7.yaml", "model: error_sources", "gear_transmission:9");
  change_cell("[base]", "[base, base]");
  expect_problem("cell-7.yaml", "model: error_sources", "base");
}

TEST_F(StartCheckTest, WhatIsWrongWithTheFilesIsNamed) {
  change_cell("robot.yaml", "nowhere.yaml");
  expect_problem("nowhere.yaml", "robot");
  change_cell("tracker:", "traker:");
  expect_problem("cell-7.yaml", "traker");
  folder_.write("robot.yaml",
                "version: 1\nname: x\njoints: [{d_mm: long, a_mm: 1, limits_deg: [0, 1]}]\n");
  expect_problem("robot.yaml", "joints 1: d_mm", "long");
  write_server("log: {level: wran}\n");
  expect_problem("server.yaml", "log: level", "wran");
  write_server("trainr: {}\n");
  expect_problem("server.yaml", "trainr");
}

TEST_F(StartCheckTest, EveryProblemIsNamedInOneRun) {
  change_cell("bias: none", "bias: rbf");
  folder_.write(
      "cell-8.yaml",
      "version: 2\ncell: a b\nrobot: nowhere.yaml\ntools: {}\ntracker: {sigma_mm: -1}\nnoise: 1\n"
      "model: {error_sources: base}\n");
  write_server("trainer: {seed: -1, accept_ratio: 99}\nlog: {level: loud}\n", "nowhere/t.db");
  expect_problem("cell-7.yaml", "model: bias", "rbf");
  expect_problem("cell-8.yaml", "version", "2");
  expect_problem("cell-8.yaml", "cell", "a b");
  expect_problem("cell-8.yaml", "tools", "0");
  expect_problem("cell-8.yaml", "tracker: sigma_mm", "-1");
  expect_problem("cell-8.yaml", "noise");
  expect_problem("cell-8.yaml", "model: error_sources");
  expect_problem("nowhere.yaml", "robot");
  expect_problem("server.yaml", "trainer: seed", "-1");
  expect_problem("server.yaml", "trainer: accept_ratio", "99");
  expect_problem("server.yaml", "log: level", "loud");
  expect_problem("server.yaml", "store", "nowhere/t.db");
}

TEST_F(StartCheckTest, AStoreThatCouldNotBeOpenedIsNamed) {
  write_server("", "nowhere/t.db");
  expect_problem("server.yaml", "store", "nowhere/t.db");
  write_server("", "cell-7.yaml/t.db");
  expect_problem("server.yaml", "store", "cell-7.yaml/t.db");
  write_server("", ".");
  expect_problem("server.yaml", "store", ".");
  folder_.write("notes.db", std::string(200, 'x'));
  write_server("", "notes.db");
  expect_problem("server.yaml", "store", "notes.db");
  std::string header = "SQLite format 3" + std::string(1, '\0') + std::string(84, '\0');
  header.replace(60, 4, std::string("\0\0\0\x63", 4));
  header.replace(68, 4, "TRML");
  folder_.write("new.db", header);
  write_server("", "new.db");
  expect_problem("server.yaml", "store", "new.db");
  header.replace(68, 4, "ABCD");
  folder_.write("other.db", header);
  write_server("", "other.db");
  expect_problem("server.yaml", "store", "other.db");
}

TEST_F(StartCheckTest, APortOrAnAddressThatCannotBeHadIsNamed) {
  {
    const auto taken = test::demand(PortLock::take("127.0.0.1", own_ports()));
    expect_problem("server.yaml", "dds: port", std::to_string(own_ports()));
  }
  EXPECT_EQ(problems(), "");
  server_ = folder_.write("server.yaml",
                          "version: 1\nserver: a\ncells: [cell-7.yaml]\nstore: t.db\n"
                          "dds: {address: 203.0.113.77, allow_network: true}\n");
  expect_problem("server.yaml", "dds: address", "203.0.113.77");
}

TEST_F(StartCheckTest, TheServerThatRunsAlreadyIsANote) {
  const auto store = test::demand(Store::open(folder_.file("t.db")));
  expect_problem("server.yaml", "store", "t.db");
  const auto port = test::demand(PortLock::take("127.0.0.1", own_ports()));
  const StartCheck found = check_start(read_server(server_), server_);
  EXPECT_TRUE(found.problems.empty()) << sentence(found.problems.front());
  ASSERT_EQ(found.notes.size(), 3u);
  EXPECT_NE(found.notes[0].find("runs already"), std::string::npos);
  EXPECT_EQ(found.notes[1], "cell cell-7 has no model yet");
}

TEST_F(StartCheckTest, ACopyOfTheStoreIsLookedAtWhileTheServiceRuns) {
  const auto running = test::demand(Store::open(folder_.file("t.db")));
  static_cast<void>(test::demand(Store::open(folder_.file("copy.db"))));
  const auto port = test::demand(PortLock::take("127.0.0.1", own_ports()));
  ServerReading server = read_server(server_);
  server.config.store = folder_.file("copy.db");
  const StartCheck meant = check_start(server, server_);
  ASSERT_EQ(meant.problems.size(), 1u) << "a start with this store would fail";
  const StartCheck copy = check_start(server, server_, StoreToCheck::kCopy);
  EXPECT_TRUE(copy.problems.empty()) << sentence(copy.problems.front());
  ASSERT_EQ(copy.notes.size(), 3u);
  EXPECT_NE(copy.notes[0].find("dds: port is in use"), std::string::npos) << copy.notes[0];
  EXPECT_EQ(copy.notes[1], "cell cell-7 has no model yet");
}

TEST_F(StartCheckTest, AStoreThatIsWrittenMeanwhileIsLookedAtAllTheSame) {
  const auto running = test::demand(Store::open(folder_.file("t.db")));
  const StartCheck found = check_start(read_server(server_), server_, StoreToCheck::kCopy);
  EXPECT_TRUE(found.problems.empty()) << sentence(found.problems.front());
  ASSERT_EQ(found.notes.size(), 3u);
  EXPECT_NE(found.notes[0].find("store is in use"), std::string::npos) << found.notes[0];
}

TEST_F(StartCheckTest, ADatabaseThatIsAwayIsANoteSinceTheServiceStartsWithoutIt) {
  write_server("", "postgresql://somebody:secret@127.0.0.1:1/plant");
  const StartCheck found = check();
  EXPECT_TRUE(found.problems.empty()) << sentence(found.problems.front());
  ASSERT_EQ(found.notes.size(), 1u);
  EXPECT_NE(found.notes[0].find("the store is away"), std::string::npos) << found.notes[0];
  EXPECT_EQ(found.notes[0].find("secret"), std::string::npos);
  write_server("", "postgresql://somebody:sec%zzret@127.0.0.1/plant");
  expect_problem("server.yaml", "store");
}

TEST_F(StartCheckTest, AFolderOfRecordsThatCannotBeMadeIsNamed) {
  write_server("record: {folder: cell-7.yaml/records}\n");
  expect_problem("server.yaml", "record: folder", "cell-7.yaml/records");
  write_server("record: {folder: new/records}\n");
  EXPECT_TRUE(check().problems.empty()) << problems();
}

TEST_F(StartCheckTest, ALogFileThatCannotBeWrittenIsNamed) {
  write_server("log: {file: nowhere/x.log}\n");
  expect_problem("server.yaml", "log: file", "nowhere/x.log");
}

TEST_F(StartCheckTest, APortForPagesThatIsTakenIsAProblem) {
  const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(own_ports() + 1));
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  ASSERT_EQ(::bind(socket, reinterpret_cast<const sockaddr*>(&to), sizeof(to)), 0);
  ASSERT_EQ(::listen(socket, 1), 0);
  write_server(fmt::format("http: {{port: {}}}\n", own_ports() + 1));
  expect_problem("server.yaml", "http: port");
  ::close(socket);
  const StartCheck free = check();
  EXPECT_TRUE(free.problems.empty()) << problems();
  EXPECT_TRUE(free.dark.empty());
  EXPECT_TRUE(free.notes.empty()) << "there is no store yet";
}

}  // namespace
}  // namespace trammel
