// Servers that a client finds by a discovery server: Fast DDS's own, as it is installed.
#include <dirent.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "server/base/text_file.h"
#include "tests/support/daemon.h"
#include "tests/support/own_ports.h"
#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

namespace fs = std::filesystem;
using std::chrono::seconds;
constexpr seconds kDiscoveryServerLimit{30};
constexpr const char* kProgram = "/usr/bin/fast-discovery-server";

/// The shipped file, on another port.
std::string set_up(std::uint16_t port) {
  std::string text = test::read_file(TRAMMEL_SOURCE_DIR "/deploy/discovery-server.xml");
  const std::string shipped = "<port>11811</port>";
  const std::size_t at = text.find(shipped);
  EXPECT_NE(at, std::string::npos);
  return text.replace(at, shipped.size(), fmt::format("<port>{}</port>", port));
}

class DiscoveryServer {
 public:
  explicit DiscoveryServer(int number)
      : port_(static_cast<std::uint16_t>(test::own_ports() + 4 + number)),
        process_({kProgram, "-i", std::to_string(number), "-x",
                  folder_.write("discovery.xml", set_up(port_))}) {
    EXPECT_TRUE(process_.wait_for_line("Server is running", kDiscoveryServerLimit) ||
                process_.wait_for_line("Server GUID", kDiscoveryServerLimit))
        << process_.standard_output() << process_.standard_error();
  }
  void kill() {
    process_.signal(SIGKILL);
    EXPECT_EQ(process_.wait(kDiscoveryServerLimit), 128 + SIGKILL);
  }
  [[nodiscard]] HostPort place() const { return {"127.0.0.1", port_}; }
  [[nodiscard]] pid_t pid() const { return process_.pid(); }

 private:
  test::TemporaryFolder folder_;
  std::uint16_t port_;
  test::Process process_;
};

/// The local addresses of a process's UDP sockets, as /proc has them.
std::set<std::string> addresses_of(pid_t pid) {
  std::set<std::string> own, found;
  for (const auto& entry : fs::directory_iterator(fmt::format("/proc/{}/fd", pid))) {
    std::error_code gone;
    own.insert(fs::read_symlink(entry.path(), gone).string());
  }
  std::ifstream table(fmt::format("/proc/{}/net/udp", pid));
  std::string line;
  std::getline(table, line);
  while (std::getline(table, line)) {
    std::istringstream fields(line);
    std::string number, local, skipped, inode;
    fields >> number >> local;
    for (int i = 2; i < 9; ++i) fields >> skipped;
    fields >> inode;
    if (own.contains("socket:[" + inode + "]")) found.insert(local.substr(0, local.find(':')));
  }
  return found;
}

class DiscoveryServerTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(kProgram)) GTEST_SKIP() << "needs " << kProgram << " (fastdds-tools)";
  }
  static void name(const test::Daemon& daemon, const std::vector<HostPort>& discovery_servers) {
    std::string list;
    for (const HostPort& one : discovery_servers)
      list += fmt::format("{}'{}'", list.empty() ? "" : ", ", to_string(one));
    const std::string text = test::read_file(daemon.config_path());
    ASSERT_TRUE(write_text_file(daemon.config_path(),
                                text + fmt::format("dds: {{discovery_servers: [{}]}}\n", list)));
  }
  /// Asks the discovery servers only.
  static Result<std::unique_ptr<client::Session>> open(
      const test::Daemon& daemon, const std::vector<HostPort>& discovery_servers) {
    client::SessionOptions options = daemon.session_options();
    options.server_ports = {};
    options.discovery_servers = discovery_servers;
    return client::Session::open(options);
  }
  static std::size_t servers_of(client::Session& session, std::size_t expected) {
    const auto there = [expected](const auto& servers) { return servers.size() >= expected; };
    const auto servers = session.servers_when(there, kDiscoveryServerLimit);
    return servers ? servers->size() : 0;
  }

  test::Daemon first_{0}, second_{1};
};

TEST_F(DiscoveryServerTest, AClientFindsAServerWithoutBeingToldItsPort) {
  const DiscoveryServer discovery(0);
  name(first_, {discovery.place()});
  first_.start();
  const auto session = open(first_, {discovery.place()});
  ASSERT_TRUE(session) << sentence(session.error());
  EXPECT_EQ(servers_of(**session, 1), 1u);
  const test::Finished status =
      test::run({TRAMMEL_BINARY_DIR "/clients/trammel", "status", "--discovery-server",
                 to_string(discovery.place()), "--domain", std::to_string(first_.domain())});
  EXPECT_EQ(status.exit_code, 0) << status.err;
  EXPECT_NE(status.out.find(first_.name()), std::string::npos) << status.out;
}

TEST_F(DiscoveryServerTest, WhoeverComesLaterIsFoundToo) {
  const DiscoveryServer discovery(0);
  name(first_, {discovery.place()});
  name(second_, {discovery.place()});
  first_.start();
  second_.start();
  const auto session = open(first_, {discovery.place()});
  ASSERT_TRUE(session) << sentence(session.error());
  EXPECT_EQ(servers_of(**session, 2), 2u);
}

TEST_F(DiscoveryServerTest, OfTwoDiscoveryServersOneIsEnough) {
  DiscoveryServer zero(0);
  const DiscoveryServer one(1);
  const std::vector<HostPort> both = {zero.place(), one.place()};
  name(first_, both);
  first_.start();
  ASSERT_TRUE(open(first_, both));
  zero.kill();
  const auto session = open(first_, both);
  ASSERT_TRUE(session) << sentence(session.error());
  EXPECT_EQ(servers_of(**session, 1), 1u);
}

TEST_F(DiscoveryServerTest, ASessionOutlivesItsDiscoveryServer) {
  DiscoveryServer discovery(0);
  name(first_, {discovery.place()});
  first_.start();
  const auto session = open(first_, {discovery.place()});
  ASSERT_TRUE(session) << sentence(session.error());
  ASSERT_EQ(servers_of(**session, 1), 1u);
  discovery.kill();
  const auto lease_over =
      std::chrono::steady_clock::now() + seconds(5);  // longer than any lease here
  while (std::chrono::steady_clock::now() < lease_over) {
    const auto began = std::chrono::steady_clock::now();
    const auto models = (*session)->models("cell-7");
    ASSERT_TRUE(models) << sentence(models.error());
    ASSERT_LT(std::chrono::steady_clock::now() - began, seconds(2)) << "a gap";
  }
  EXPECT_EQ(first_.stop(), 0);
}

TEST_F(DiscoveryServerTest, AServerOutlivesADiscoveryServerThatComesLate) {
  const HostPort late{"127.0.0.1", static_cast<std::uint16_t>(test::own_ports() + 4)};
  name(first_, {late});
  first_.start();  // it waits for none
  const DiscoveryServer discovery(0);
  const auto session = open(first_, {discovery.place()});
  ASSERT_TRUE(session) << sentence(session.error());
}

TEST_F(DiscoveryServerTest, EverybodyListensOnLoopbackOnly) {
  const DiscoveryServer discovery(0);
  name(first_, {discovery.place()});
  first_.start();
  ASSERT_TRUE(open(first_, {discovery.place()}));
  const std::set<std::string> loopback = {"0100007F"};
  EXPECT_EQ(addresses_of(discovery.pid()), loopback);
  EXPECT_EQ(addresses_of(first_.process().pid()), loopback);
}

}  // namespace
}  // namespace trammel
