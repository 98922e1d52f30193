#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "server/base/neighbours.h"
#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

using nlohmann::json;
using test::Finished;

class Doctor : public testing::Test {
 protected:
  [[nodiscard]] Finished examine(std::vector<std::string> words) const {
    words.insert(words.begin(), {"/usr/bin/env", "-C", folder_.path(), "TRAMMEL_DEFAULTS=",
                                 TRAMMEL_BINARY_DIR "/clients/trammel", "doctor", "--json", "-"});
    return test::run(words);
  }
  /// The check of this name; null where none is.
  static json check(const Finished& finished, const std::string& name) {
    const json all = json::parse(finished.out);
    for (const json& one : all.at("checks")) {
      if (one.at("check") == name) return one;
    }
    return nullptr;
  }
  test::TemporaryFolder folder_;
};

TEST_F(Doctor, SaysOfAMachineWithoutAServerHowToStartOne) {
  const Finished finished = examine({"--port", "17891"});
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  EXPECT_EQ(check(finished, "network").at("state"), "good");
  EXPECT_EQ(check(finished, "port 17891").at("state"), "note");
  EXPECT_NE(check(finished, "port 17891").at("next").get<std::string>().find("trammeld"),
            std::string::npos);
  EXPECT_EQ(check(finished, "leftovers").at("state"), "good");
}

TEST_F(Doctor, WarnsOfOthersOnThisHostUnlessCertificatesAreUsed) {
  const Neighbours here = neighbours();
  const bool others = !here.may_log_in.empty();
  const json open = check(examine({"--port", "17891"}), "neighbours");
  EXPECT_EQ(open.at("state"), others ? "note" : "good") << open;
  for (const std::string& name : here.logged_in.empty() ? here.may_log_in : here.logged_in)
    EXPECT_NE(open.at("what").get<std::string>().find(name), std::string::npos) << open;
  const json guarded =
      check(examine({"--port", "17891", "--security", folder_.path()}), "neighbours");
  EXPECT_EQ(guarded.at("state"), "good") << guarded;
}

TEST_F(Doctor, FindsAPortThatAnotherProgramHasAStoreWithoutAFolderAndLeftovers) {
  const int other = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in place{};
  place.sin_family = AF_INET;
  place.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof place;
  ASSERT_EQ(::bind(other, reinterpret_cast<const sockaddr*>(&place), sizeof place), 0);
  ASSERT_EQ(::getsockname(other, reinterpret_cast<sockaddr*>(&place), &size), 0);
  const std::string port = std::to_string(ntohs(place.sin_port));
  folder_.write("cell.model.4194399.part", "half");  // no process has such a number
  const Finished finished = examine({"--port", port, "--store", "no/such/folder/here.db"});
  ::close(other);
  EXPECT_EQ(finished.exit_code, 1) << finished.err;
  EXPECT_EQ(check(finished, "port " + port).at("state"), "bad");
  EXPECT_EQ(check(finished, "store").at("state"), "bad");
  EXPECT_EQ(check(finished, "leftovers").at("state"), "note");
  const json all = json::parse(finished.out);
  for (const json& one : all.at("checks"))
    EXPECT_EQ(one.at("state") == "good", one.at("next") == "")
        << one << " has nothing to do about it";
}

}  // namespace
}  // namespace trammel
