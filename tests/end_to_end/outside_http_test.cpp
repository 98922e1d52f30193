// Programs that know nothing of ours ask a real daemon over HTTPS: curl, and Python's own library.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "server/base/hash.h"
#include "server/base/text_file.h"
#include "tests/support/daemon.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

class OutsideHttp : public testing::Test {
 protected:
  /// Starts the daemon with a certificate of its own and a token for each role. `dds`: more of its
  /// file.
  void start(const std::string& dds = "") {
    const std::string key = folder_.file("key.pem"), certificate = folder_.file("cert.pem");
    const test::Finished made = test::run(
        {"/usr/bin/openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt",
         "ec_paramgen_curve:prime256v1", "-nodes", "-keyout", key, "-out", certificate, "-days",
         "2", "-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1"});
    ASSERT_EQ(made.exit_code, 0) << made.err;
    std::ofstream tokens(folder_.file("tokens"));
    nlohmann::json by_role;
    for (const std::string role : {"observer", "cam", "metrologist", "engineer"}) {
      by_role[role] = "token of " + role;
      tokens << "one-" << role << " " << role << " " << sha256_hex("token of " + role) << "\n";
    }
    tokens.close();
    for (const std::string& secret : {key, folder_.file("tokens")}) ::chmod(secret.c_str(), 0600);
    const std::uint16_t port = static_cast<std::uint16_t>(daemon_.port() + 1);
    ASSERT_TRUE(write_text_file(
        daemon_.config_path(),
        fmt::format("{}{}http: {{port: {}, api: true, tokens: {}, certificate: {}, key: {}}}\n",
                    test::read_file(daemon_.config_path()), dds, port, folder_.file("tokens"),
                    certificate, key)));
    daemon_.start();
    folder_.write("settings.json",
                  nlohmann::json{{"url", fmt::format("https://127.0.0.1:{}/api/v1", port)},
                                 {"ca", certificate},
                                 {"tokens", by_role},
                                 {"trammel",
                                  {TRAMMEL_BINARY_DIR "/clients/trammel", "--service", "--port",
                                   std::to_string(daemon_.port()), "--domain",
                                   std::to_string(daemon_.domain())}},
                                 {"batches",
                                  {folder_.write("b1.csv", test::virtual_batch_csv(60, 1)),
                                   folder_.write("b2.csv", test::virtual_batch_csv(60, 2))}},
                                 {"programs", TRAMMEL_SOURCE_DIR "/tests/clients/programs"},
                                 {"folder", folder_.path()}}
                      .dump());
  }
  void expect_good(const char* task) {
    const test::Finished client =
        test::run({"/usr/bin/python3", TRAMMEL_SOURCE_DIR "/tests/gateway/outside_client.py", task,
                   folder_.file("settings.json")},
                  std::chrono::seconds(240));
    EXPECT_EQ(client.exit_code, 0) << client.out << client.err;
  }

  test::TemporaryFolder folder_;
  test::Daemon daemon_;
};

TEST_F(OutsideHttp, MeasuresCorrectsAndChangesVersionsByRoles) {
  start();
  expect_good("work");
}

TEST_F(OutsideHttp, ProgramsOfEveryDialectComeBackAsTheCommandLineWritesThem) {
  start();
  expect_good("dialects");
}

TEST_F(OutsideHttp, EveryMistakeHasItsCodeAndWords) {
  start();
  expect_good("mistakes");
}

TEST_F(OutsideHttp, OneClientThatAsksForMuchKeepsNobodyWaiting) {
  start();
  expect_good("limits");
}

TEST_F(OutsideHttp, AFullQueueIsToldAndNothingIsLost) {
  start("dds: {queued_requests: 2}\n");
  expect_good("full");
}

}  // namespace
}  // namespace trammel
