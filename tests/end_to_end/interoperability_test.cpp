// A client of another maker's DDS, built from the same IDL, gets its answer.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "server/dds/dds_service.h"
#include "tests/dds/backend.h"
#include "tests/support/process.h"

namespace trammel {
namespace {

#ifdef TRAMMEL_CYCLONE_CLIENT

/// The environment of a Cyclone DDS client that looks for a server at this port. Without an index
/// it takes any free port: `auto` knows ten pairs of them in a domain of a host, which participants
/// of other tests may have.
std::string network(const DdsOptions& options) {
  return fmt::format(
      "CYCLONEDDS_URI=<CycloneDDS><Domain><General><Interfaces><NetworkInterface "
      "address=\"127.0.0.1\" "
      "multicast=\"false\"/></Interfaces><AllowMulticast>false</AllowMulticast></"
      "General><Discovery><ParticipantIndex>none</ParticipantIndex><Peers><Peer "
      "address=\"127.0.0.1:{}\"/></Peers></Discovery></Domain></CycloneDDS>",
      options.port);
}

/// Ports of the host, as long as it lives. One that somebody has already is taken, too.
class TakenPorts {
 public:
  TakenPorts(int first, int count) {
    for (int port = first; port < first + count; ++port) {
      sockaddr_in at{};
      at.sin_family = AF_INET;
      at.sin_port = htons(static_cast<std::uint16_t>(port));
      at.sin_addr.s_addr = htonl(INADDR_ANY);
      const int held = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
      static_cast<void>(::bind(held, reinterpret_cast<const sockaddr*>(&at), sizeof at));
      held_.push_back(held);
    }
  }
  TakenPorts(const TakenPorts&) = delete;
  TakenPorts& operator=(const TakenPorts&) = delete;
  ~TakenPorts() {
    for (const int held : held_) ::close(held);
  }

 private:
  std::vector<int> held_;
};

class Interoperability : public testing::Test {
 protected:
  void SetUp() override {
    const Status started = service_.start();
    ASSERT_TRUE(started) << started.error().message;
  }
  test::Finished run(const char* client, std::uint32_t domain, const char* limit_s) {
    return test::run(
        {"/usr/bin/env", network(options_), client, std::to_string(domain), "cell-7", limit_s});
  }

  test::Backend backend_;
  std::shared_ptr<const ServedModel> served_ = backend_.serve(7);
  const DdsOptions options_ = test::test_dds_options();
  DdsService service_{options_, *backend_.trainer, *backend_.store, backend_.registry};
};

TEST_F(Interoperability, ACycloneDdsClientGetsItsPredictionAndItsCorrection) {
  const test::Finished client = run(TRAMMEL_CYCLONE_CLIENT, options_.domain, "20");
  EXPECT_EQ(client.exit_code, 0) << client.err;
  EXPECT_EQ(client.out,
            fmt::format("server=server-a contract=2 cells=2\n"
                        "cell=cell-7 version=7\n"
                        "result=0 id=4711 ours=1 trace=trace-7 model={} version=7 items=1\n"
                        "dx_mm=0.700000\n"
                        "status=0 x_mm=-0.700 before_mm=0.700 after_mm=0.000\n",
                        served_->model.provenance().hash));
  const test::Finished stranger = run(TRAMMEL_CYCLONE_CLIENT, options_.domain + 65, "3");
  EXPECT_EQ(stranger.err, "cyclone_client: no ServiceStatus\n")
      << "it looked at the same port from another domain";
}

// It says that it leaves as Fast DDS does not, and leaves the partition of its replies to the next.
TEST_F(Interoperability,
       ACycloneDdsClientThatIsStartedAgainIsAnsweredInThePartitionThatTheFirstHasLeft) {
  for (int start = 0; start < 3; ++start) {
    const test::Finished client = run(TRAMMEL_CYCLONE_CLIENT, options_.domain, "5");
    EXPECT_EQ(client.exit_code, 0) << client.err;
  }
}

// With an index of `auto` it says "Failed to find a free participant index for domain 25".
TEST_F(Interoperability, ACycloneDdsClientIsAnsweredBesideAsManyParticipantsAsADomainHasIndices) {
  constexpr int kBase = 7400, kPerDomain = 250, kUnicast = 10, kPorts = 20;  // RTPS 2.3, 9.6.1.1
  const TakenPorts others(kBase + kPerDomain * static_cast<int>(options_.domain) + kUnicast,
                          kPorts);
  const test::Finished client = run(TRAMMEL_CYCLONE_CLIENT, options_.domain, "20");
  EXPECT_EQ(client.exit_code, 0) << client.err;
}

/// The server with ROS 2 nodes answered, too.
class Ros2 : public Interoperability {
 protected:
  Ros2() { service_.stop(); }
  void SetUp() override { ASSERT_TRUE(open_.start()); }

  static DdsOptions open_for_nodes(DdsOptions options) {
    options.ros2 = true;
    return options;
  }
  DdsService open_{open_for_nodes(options_), *backend_.trainer, *backend_.store, backend_.registry};
};

// The names are those of https://design.ros2.org/articles/topic_and_service_names.html: `rt/`
// before the topic, and `package::msg::dds_::Name_`.
TEST_F(Ros2, ANodeGetsItsPredictionAndItsCorrectionUnderTheNamesThatRos2Gives) {
  const test::Finished node = run(TRAMMEL_ROS2_NODE, options_.domain, "20");
  EXPECT_EQ(node.exit_code, 0) << node.err;
  EXPECT_EQ(
      node.out,
      "rt/trammel/predict_errors trammel_msgs::msg::dds_::PredictErrors_\n"
      "rt/trammel/correct_targets trammel_msgs::msg::dds_::CorrectTargets_\n"
      "id=node-1/1 server=server-a result=0 version=7 dx_m=0.0007000\n"
      "result=2: joint values: 6, needed 5\n"
      "id=node-1/3 result=0 status=0 joints=6 x_m=-0.000700 before_m=0.000700 after_m=0.000000\n");
}

TEST_F(Interoperability, ANodeHearsNothingUnlessTheServerIsToldSo) {
  const test::Finished node = run(TRAMMEL_ROS2_NODE, options_.domain, "3");
  EXPECT_EQ(node.err, "ros2_node: nobody subscribes to questions\n");
}

#endif

}  // namespace
}  // namespace trammel
