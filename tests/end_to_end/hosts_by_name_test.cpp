#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

/// In namespaces where every question for a name is lost: its server is an address that nobody has.
test::Finished without_names(const std::vector<std::string>& command) {
  const test::TemporaryFolder folder;
  const std::string resolver = folder.write("resolv.conf", "nameserver 10.9.9.2\n");
  constexpr const char* kMake =
      "set -e; mount --bind \"$0\" /etc/resolv.conf; ip link set lo up; ip link add nowhere type "
      "veth peer name nobody; ip link set nobody up; ip link set nowhere up; ip address add "
      "10.9.9.1/24 dev nowhere; ip neighbour add 10.9.9.2 lladdr 02:00:00:00:00:02 dev nowhere; "
      "exec \"$@\"";
  std::vector<std::string> whole = {
      "/usr/bin/unshare", "--mount", "--net", "/bin/bash", "-c", kMake, resolver};
  whole.insert(whole.end(), command.begin(), command.end());
  return test::run(whole);
}

TEST(HostsByName, ANameThatNobodyAnswersForIsGivenUpByADeadline) {
  const auto said =
      without_names({TRAMMEL_BINARY_DIR "/clients/trammel", "store", "check",
                     "postgresql://trammel:s3cret@db.plant.example,127.0.0.1:1/trammel"});
  EXPECT_EQ(said.exit_code, 4) << said.out << said.err;
  EXPECT_EQ(said.err.find("s3cret"), std::string::npos) << said.err;
  const auto alone = without_names({TRAMMEL_BINARY_DIR "/clients/trammel", "store", "check",
                                    "postgresql://trammel@db.plant.example/trammel"});
  EXPECT_EQ(alone.exit_code, 4) << alone.out << alone.err;
  EXPECT_NE(alone.err.find("the name db.plant.example was not found within 1000 ms"),
            std::string::npos)
      << alone.err;
}

TEST(HostsByName, AHostIsFoundByItsNameAsByItsAddress) {
  for (const char* host : {"localhost", "127.0.0.1"}) {
    const auto said = test::run({TRAMMEL_BINARY_DIR "/clients/trammel", "store", "check",
                                 fmt::format("postgresql://trammel@{}:1/trammel", host)});
    EXPECT_EQ(said.exit_code, 4) << said.out << said.err;
    EXPECT_NE(said.err.find("Connection refused"), std::string::npos) << said.err;
  }
}

}  // namespace
}  // namespace trammel
