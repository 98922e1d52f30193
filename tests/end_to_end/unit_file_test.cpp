// The daemon's unit under systemd, and the demo beside another server.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <regex>
#include <string>
#include <utility>

#include "tests/support/daemon.h"
#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

constexpr std::chrono::seconds kLimit{30};

void put_everywhere(std::string& text, const std::string& what, const std::string& by) {
  for (std::size_t at = text.find(what); at != std::string::npos;
       at = text.find(what, at + by.size()))
    text.replace(at, what.size(), by);
}

/// The start check of the unit, as /bin/sh gets it, with this build's daemon and this
/// server file.
std::string start_check(const std::string& server_file) {
  const std::string unit = test::read_file(TRAMMEL_SOURCE_DIR "/deploy/trammeld.service");
  std::smatch found;
  EXPECT_TRUE(std::regex_search(unit, found, std::regex("ExecStartPre=/bin/sh -c '(.*)'"))) << unit;
  std::string command = found[1];
  put_everywhere(command, "/usr/bin/trammeld", test::trammeld_path());
  put_everywhere(command, "/etc/trammel/server.yaml", server_file);
  put_everywhere(command, "$$", "$");
  return command;
}

TEST(Unit, WaitsForNoDatabaseNeitherOfItsHostNorOfAnother) {
  const std::string unit = test::read_file(TRAMMEL_SOURCE_DIR "/deploy/trammeld.service");
  EXPECT_FALSE(std::regex_search(unit, std::regex("postgres|patroni|network-online")))
      << "a server that starts while the record is away serves what it saw last";
}

TEST(Unit, AMisspeltKeyEndsTheStartAtOnceWithItsLine) {
  const test::TemporaryFolder folder;
  const std::string start = "version: 1\nserver: checked\ncells: [" TRAMMEL_SOURCE_DIR
                            "/config/cell-7.yaml]\nstore: trammel.db\n";
  const auto checked = [&](const std::string& text) {
    return test::run({"/bin/sh", "-c", start_check(folder.write("server.yaml", text))}, kLimit);
  };
  const test::Finished wrong = checked(start + "dds: {prot: 17555}\n");
  ASSERT_TRUE(wrong.exit_code);
  EXPECT_NE(*wrong.exit_code, 0);
  EXPECT_NE(wrong.err.find("server.yaml row 5"), std::string::npos) << wrong.err;
  EXPECT_NE(wrong.err.find("prot"), std::string::npos) << wrong.err;
  const test::Daemon own;  // its port
  const test::Finished right = checked(start + "dds: {port: " + std::to_string(own.port()) + "}\n");
  EXPECT_EQ(right.exit_code, 0) << right.err;
}

/// Holds a UDP port of 127.0.0.1, as another server does.
class HeldPort {
 public:
  explicit HeldPort(std::uint16_t port) : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in name{};
    name.sin_family = AF_INET;
    name.sin_port = htons(port);
    name.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    // Where somebody else holds it, it is held.
    static_cast<void>(::bind(socket_, reinterpret_cast<const sockaddr*>(&name), sizeof name));
  }
  ~HeldPort() { ::close(socket_); }
  HeldPort(const HeldPort&) = delete;
  HeldPort& operator=(const HeldPort&) = delete;

 private:
  const int socket_;
};

/// The port that the demo would take.
std::string port_of_demo() {
  const test::Finished asked =
      test::run({"/bin/bash", "-c",
                 "eval \"$(sed -n '/^free_port()/,/^}/p' '" TRAMMEL_SOURCE_DIR
                 "/deploy/demo')\" && free_port"},
                kLimit);
  EXPECT_EQ(asked.exit_code, 0) << asked.err;
  return asked.out;
}

TEST(Demo, TakesAPortThatNobodyHas) {
  if (test::run({"/bin/sh", "-c", "command -v ss"}, kLimit).exit_code != 0)
    GTEST_SKIP() << "no ss here (iproute2)";
  const HeldPort first(17590), second_of_the_next(17593);
  EXPECT_NE(port_of_demo(), "17590\n");
  EXPECT_NE(port_of_demo(), "17592\n") << "a daemon takes two";
  EXPECT_TRUE(std::regex_match(port_of_demo(), std::regex("17[56][0-9]{2}\n")));
}

}  // namespace
}  // namespace trammel
