// A client of another maker's DDS, built from the same IDL, gets its answer.
#include <gtest/gtest.h>

#include "server/dds/dds_service.h"
#include "tests/dds/backend.h"
#include "tests/support/process.h"

namespace trammel {
namespace {

#ifdef TRAMMEL_CYCLONE_CLIENT

TEST(Interoperability, ACycloneDdsClientGetsItsPrediction) {
  test::Backend backend;
  const auto served = backend.serve(7);
  const DdsOptions options = test::test_dds_options();
  DdsService service(options, *backend.trainer, *backend.store, backend.registry);
  const Status started = service.start();
  ASSERT_TRUE(started) << started.error().message;

  const std::string network = fmt::format(
      "CYCLONEDDS_URI=<CycloneDDS><Domain><General><Interfaces><NetworkInterface address=\"127.0.0.1\" "
      "multicast=\"false\"/></Interfaces><AllowMulticast>false</AllowMulticast></General><Discovery>"
      "<ParticipantIndex>auto</ParticipantIndex><Peers><Peer address=\"127.0.0.1:{}\"/></Peers></Discovery></Domain>"
      "</CycloneDDS>",
      options.port);
  const auto in_domain = [&](std::uint32_t domain, const char* limit_s) {
    return test::run({"/usr/bin/env", network, TRAMMEL_CYCLONE_CLIENT, std::to_string(domain), "cell-7", limit_s});
  };
  const test::Finished client = in_domain(options.domain, "20");
  EXPECT_EQ(client.exit_code, 0) << client.err;
  EXPECT_EQ(client.out, fmt::format("server=server-a contract=1 cells=2\n"
                                    "cell=cell-7 version=7\n"
                                    "result=0 id=4711 guid=c7 model={} version=7 items=1\n"
                                    "dx_mm=0.700000\n",
                                    served->model.provenance().hash));
  const test::Finished stranger = in_domain(options.domain + 65, "3");
  EXPECT_EQ(stranger.err, "cyclone_client: no ServiceStatus\n") << "it looked at the same port from another domain";
}

#endif

}  // namespace
}  // namespace trammel
