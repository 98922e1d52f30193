#include "server/store/commit_safety.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

CommitSettings patroni(const std::string& names, int standbys,
                       std::vector<std::string> waited_for) {
  CommitSettings settings;
  settings.standby_names = names;
  settings.standbys = standbys;
  settings.waited_for = std::move(waited_for);
  return settings;
}

TEST(CommitSafety, IsSaidInOneSentence) {
  EXPECT_EQ(safety_of(patroni("db-2", 2, {"db-2"})).survives,
            "the loss of one host of three: db-2 has it, too");
  EXPECT_EQ(safety_of(patroni("ANY 1 (db-2, db-3)", 2, {"db-2", "db-3"})).survives,
            "the loss of one host of three: db-2, db-3 have it, too");
  EXPECT_EQ(safety_of(patroni("2 (db-2, db-3)", 2, {"db-2", "db-3"})).survives,
            "the loss of two hosts of three: db-2, db-3 have it, too");
  EXPECT_EQ(safety_of({}).survives,
            "a crash of the database's host, and not its loss: this host only");
  for (const CommitSettings& good : {patroni("db-2", 2, {"db-2"}), CommitSettings()})
    EXPECT_EQ(safety_of(good).worry, "");
}

TEST(CommitSafety, SaysWhatIsNotAsItShouldBe) {
  CommitSettings settings = patroni("db-2", 2, {"db-2"});
  settings.synchronous_commit = "local";
  EXPECT_NE(safety_of(settings).survives.find("this host only"), std::string::npos);
  EXPECT_NE(safety_of(settings).worry.find("synchronous_commit is local"), std::string::npos);
  settings.synchronous_commit = "off";
  EXPECT_NE(safety_of(settings).survives.find("no crash of the database's host"),
            std::string::npos);
  settings.fsync = false;
  EXPECT_NE(safety_of(settings).survives.find("fsync is off"), std::string::npos);
  EXPECT_NE(safety_of(patroni("*", 0, {})).worry.find("not there"), std::string::npos)
      << "changes wait";
  EXPECT_NE(safety_of(patroni("", 2, {})).worry.find("no change waits for the two standbys"),
            std::string::npos);
  CommitSettings unseen = patroni("db-2", 0, {});
  unseen.standbys_are_seen = false;
  EXPECT_NE(safety_of(unseen).worry.find("pg_read_all_stats"), std::string::npos);
}

TEST(CommitSafety, PatroniWithoutAWatchdogIsNamed) {
  const test::TemporaryFolder host;
  const std::string proc = host.file("proc"), sys = host.file("sys");
  std::filesystem::create_directories(proc + "/12");
  std::filesystem::create_directories(sys + "/class/watchdog/watchdog0");
  EXPECT_EQ(missing_watchdog(proc, sys), "") << "no Patroni runs there";
  host.write("proc/12/comm", "patroni\n");
  EXPECT_NE(missing_watchdog(proc, sys).find("without a watchdog"), std::string::npos);
  host.write("sys/class/watchdog/watchdog0/state", "active\n");
  EXPECT_EQ(missing_watchdog(proc, sys), "");
}

}  // namespace
}  // namespace trammel
