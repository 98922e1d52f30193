// The host's clock is set while the daemon runs, also to times that no clock shows.
#include <gtest/gtest.h>

#include <cstdint>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "clients/session/session.h"
#include "tests/support/daemon.h"
#include "tests/support/demand.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

using std::chrono::seconds;
using test::demand;

constexpr seconds kLimit{30};
constexpr std::int64_t kHour = 3600, kYear = 365 * 24 * kHour;

class ClockTest : public testing::Test {
 protected:
  void SetUp() override {
    set_clock(0);
    start();
  }
  void start() {
    std::vector<std::string> argv = {"/usr/bin/env", "LD_PRELOAD=" TRAMMEL_MOVED_CLOCK,
                                     "TRAMMEL_TEST_CLOCK=" + file_};
    const std::vector<std::string> daemon = daemon_.command_line();
    argv.insert(argv.end(), daemon.begin(), daemon.end());
    process_ = std::make_unique<test::Process>(argv);
    ASSERT_TRUE(process_->wait_for_line("ready", kLimit)) << process_->standard_error();
  }
  /// The daemon's clock shows what this one shows and `moved` (s).
  void set_clock(std::int64_t moved) {
    std::fstream file(file_, std::ios::binary | std::ios::in | std::ios::out);
    if (!file) file.open(file_, std::ios::binary | std::ios::out);
    file.write(reinterpret_cast<const char*>(&moved), sizeof moved);
  }
  [[nodiscard]] std::unique_ptr<client::Session> client() const {
    return std::move(client::Session::open(daemon_.session_options()).value());
  }
  /// The trouble that the only server tells, once it holds `wanted` (empty: once there is none).
  [[nodiscard]] std::string trouble(client::Session& session, const std::string& wanted) const {
    const auto servers = demand(session.servers_when(
        [&](const std::vector<client::ServerStatus>& all) {
          return all.size() == 1 &&
                 (wanted.empty() ? all[0].trouble.empty()
                                 : all[0].trouble.find(wanted) != std::string::npos);
        },
        kLimit));
    return servers.at(0).trouble;
  }

  test::TemporaryFolder folder_;
  const std::string file_ = folder_.file("clock");
  test::Daemon daemon_;
  std::unique_ptr<test::Process> process_;
};

TEST_F(ClockTest, EveryRequestIsAnsweredAndNewClientsFindTheServiceHoweverItIsSet) {
  const auto here_before = client();
  ASSERT_TRUE(here_before->models("cell-7"));
  for (const std::int64_t moved : {-kHour, -100 * kYear, 140 * kYear, std::int64_t{0}}) {
    set_clock(moved);
    for (int i = 0; i < 20; ++i) EXPECT_TRUE(here_before->models("cell-7")) << moved;
    EXPECT_TRUE(client()->models("cell-7")) << "somebody new, at " << moved;
  }
  EXPECT_TRUE(here_before->models("cell-7"));
}

TEST_F(ClockTest, ThatItWasSetIsSaidForAsLongAsItIsOffAndStandsInTheTrail) {
  const auto session = client();
  EXPECT_EQ(trouble(*session, ""), "");
  set_clock(-kHour);
  const std::string said = "the host's clock was set by -3600 s";
  EXPECT_NE(trouble(*session, said).find(said), std::string::npos);
  const auto trail = demand(session->audit("", 0, 0));
  ASSERT_EQ(trail.size(), 1U);
  EXPECT_NE(trail[0].json.find("set by -3600 s"), std::string::npos) << trail[0].json;
  set_clock(0);
  EXPECT_EQ(trouble(*session, ""), "");
}

TEST_F(ClockTest, AServiceThatStartsBehindItsLastChangeSaysSo) {
  process_->signal(SIGTERM);
  ASSERT_EQ(process_->wait(kLimit), 0);
  set_clock(-kHour);
  start();
  EXPECT_NE(trouble(*client(), "behind").find("s behind the last change in the store"),
            std::string::npos);
}

}  // namespace
}  // namespace trammel
