// The answers of discovery servers that are believed.
#include "idl/transport/places.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "server/base/text_file.h"
#include "tests/support/own_ports.h"
#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace trammel::wire {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kNoTime{0};

Place place(std::uint16_t port = 17500, const std::string& address = "10.1.0.3",
            std::uint32_t domain = 5) {
  Place result;
  result.at.address = address;
  result.at.port = port;
  result.domain = domain;
  result.server_id = "line-3";
  return result;
}

TEST(Places, APlaceIsReadAsItIsSaid) {
  EXPECT_EQ(place_text(place()), "trammel.server=10.1.0.3:17500;domain=5;id=line-3");
  EXPECT_EQ(read_place(place_text(place())), place());
}

TEST(Places, OnlyAWholePlaceInItsOneSpellingIsBelieved) {
  const std::vector<std::string> hostile = {
      "",
      "trammel.domain=5",
      "trammel.server=",
      "trammel.server=10.1.0.3:17500",
      "trammel.server=10.1.0.3:17500;domain=5",
      "trammel.server=10.1.0.3:17500;domain=5;id=",
      "trammel.server=10.1.0.3:17500;id=line-3;domain=5",
      "trammel.server=line-3:17500;domain=5;id=line-3",
      "trammel.server=localhost:17500;domain=5;id=line-3",
      "trammel.server=10.1.3:17500;domain=5;id=line-3",
      "trammel.server=010.1.0.3:17500;domain=5;id=line-3",
      "trammel.server=::1:17500;domain=5;id=line-3",
      "trammel.server=0.0.0.0:17500;domain=5;id=line-3",
      "trammel.server=239.255.0.1:7400;domain=5;id=line-3",
      "trammel.server=255.255.255.255:17500;domain=5;id=line-3",
      "trammel.server=10.1.0.3:;domain=5;id=line-3",
      "trammel.server=10.1.0.3:80;domain=5;id=line-3",
      "trammel.server=10.1.0.3:017500;domain=5;id=line-3",
      "trammel.server=10.1.0.3:83036;domain=5;id=line-3",
      "trammel.server=10.1.0.3:-1;domain=5;id=line-3",
      "trammel.server=10.1.0.3:17500;domain=;id=line-3",
      "trammel.server=10.1.0.3:17500;domain=233;id=line-3",
      "trammel.server=10.1.0.3:17500;domain=4294967301;id=line-3",
      "trammel.server=10.1.0.3:17500;domain=5;id=line 3",
      "trammel.server=10.1.0.3:17500;domain=5;id=line-3\n",
      "trammel.server=10.1.0.3:17500;domain=5;id=" + std::string(65, 'a'),
      "trammel.server=10.1.0.3:17500;domain=5;id=\x1b[31m",
      std::string("trammel.server=10.1.0.3\0:17500;domain=5;id=line-3", 49),
      std::string("trammel.server=10.1.0.3:17500;domain=5;id=line-3\0", 49),
      " trammel.server=10.1.0.3:17500;domain=5;id=line-3",
      std::string(1 << 20, 'a'),
  };
  for (const std::string& text : hostile)
    EXPECT_EQ(read_place(text), std::nullopt) << text.substr(0, 80);
}

TEST(Places, ServersOfOtherDomainsAreNotFound) {
  FoundPlaces found(6, false);
  found.heard(place_text(place()));
  EXPECT_TRUE(found.wait(kNoTime).empty());
}

TEST(Places, EachPlaceIsFoundOnce) {
  FoundPlaces found(5, false);
  found.heard(place_text(place()));
  found.heard(place_text(place(17502)));
  found.heard(place_text(place()));
  EXPECT_EQ(found.wait(kNoTime), (std::vector<HostPort>{{"10.1.0.3", 17500}, {"10.1.0.3", 17502}}));
}

TEST(Places, NoMoreThan64AreTaken) {
  FoundPlaces found(5, false);
  for (std::uint16_t port = 17500; port < 17565; ++port) found.heard(place_text(place(port)));
  const auto places = found.wait(milliseconds(600'000));  // it waits for no more
  ASSERT_EQ(places.size(), kMostPlaces);
  EXPECT_EQ(places.back().port, 17563);
}

TEST(Places, FromAnotherHostALoopbackAddressIsNoPlace) {
  const std::string here = place_text(place(17500, "127.0.0.1"));
  FoundPlaces far(5, true), near(5, false);
  far.heard(here);
  near.heard(here);
  EXPECT_TRUE(far.wait(kNoTime).empty());
  EXPECT_EQ(near.wait(kNoTime).size(), 1u);
}

TEST(Places, WithoutADiscoveryServerItIsSaidWhichWereAsked) {
  const auto found =
      look_for_places({{"127.0.0.1", 11811}, {"127.0.0.1", 11812}}, 5, milliseconds(10));
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().code, ErrorCode::kUnreachable);
  EXPECT_NE(found.error().message.find("127.0.0.1:11811, 127.0.0.1:11812"), std::string::npos)
      << found.error().message;
}

/// Fast DDS's own, as it is installed, by the shipped file on another port.
class DiscoveryServer {
 public:
  static constexpr const char* kProgram = "/usr/bin/fast-discovery-server";

  explicit DiscoveryServer(int number)
      : port_(static_cast<std::uint16_t>(test::own_ports() + number)),
        process_({kProgram, "-i", std::to_string(number), "-x",
                  folder_.write("discovery.xml", set_up(port_))}) {}
  [[nodiscard]] HostPort place() const { return {"127.0.0.1", port_}; }

 private:
  static std::string set_up(std::uint16_t port) {
    std::string text =
        read_text_file(TRAMMEL_SOURCE_DIR "/deploy/discovery-server.xml", 100'000).value();
    const std::string shipped = "<port>11811</port>";
    return text.replace(text.find(shipped), shipped.size(),
                        "<port>" + std::to_string(port) + "</port>");
  }

  test::TemporaryFolder folder_;
  std::uint16_t port_;
  test::Process process_;
};

TEST(Places, ServersAreFoundByARealDiscoveryServerAlsoWhereAnotherIsMissing) {
  if (!std::filesystem::exists(DiscoveryServer::kProgram)) GTEST_SKIP() << "needs fastdds-tools";
  const DiscoveryServer discovery(0);
  const std::vector<HostPort> both = {
      discovery.place(), {"127.0.0.1", static_cast<std::uint16_t>(test::own_ports() + 1)}};
  const auto first = announce_place(place(17500, "127.0.0.1", 5), both);
  const auto second = announce_place(place(17502, "127.0.0.1", 5), both);
  const auto other = announce_place(place(17504, "127.0.0.1", 6), both);
  ASSERT_TRUE(first && second && other);
  std::vector<HostPort> found;
  for (int look = 0; look < 30 && found.size() < 2; ++look) {  // they need a moment to be known
    found = look_for_places(both, 5, milliseconds(2000)).value_or(std::vector<HostPort>());
  }
  std::sort(found.begin(), found.end(),
            [](const HostPort& a, const HostPort& b) { return a.port < b.port; });
  EXPECT_EQ(found, (std::vector<HostPort>{{"127.0.0.1", 17500}, {"127.0.0.1", 17502}}));
}

}  // namespace
}  // namespace trammel::wire
