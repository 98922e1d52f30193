// A service that other hosts reach: two hosts are two network namespaces with a line between them,
// good or bad.
#include <gtest/gtest.h>

#include <memory>

#include "server/base/text_file.h"
#include "tests/support/daemon.h"
#include "tests/support/two_hosts.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using std::chrono::seconds;
constexpr seconds kLimit{60};

class NetworkTest : public testing::Test {
 protected:
  explicit NetworkTest(const test::LineFaults& faults = {}) : hosts_(faults) {}

  void SetUp() override {
    if (!hosts_.why_not().empty()) GTEST_SKIP() << hosts_.why_not();
  }

  void start(const std::string& dds) {
    const std::string text = test::read_file(daemon_.config_path());
    ASSERT_TRUE(write_text_file(daemon_.config_path(),
                                fmt::format("{}dds: {{address: {}, allow_network: true, {}}}\n",
                                            text, hosts_.address(0), dds)));
    service_ = std::make_unique<test::Process>(hosts_.on(0, daemon_.command_line()));
    ASSERT_TRUE(service_->wait_for_line("ready", kLimit)) << service_->standard_error();
  }
  [[nodiscard]] std::vector<std::string> command(std::vector<std::string> words) const {
    words.insert(words.begin(), {TRAMMEL_BINARY_DIR "/clients/trammel"});
    words.insert(words.end(), {"--host", fmt::format("{}:{}", hosts_.address(0), daemon_.port()),
                               "--domain", std::to_string(daemon_.domain())});
    return hosts_.on(1, std::move(words));
  }
  /// A command of the other host.
  [[nodiscard]] test::Finished elsewhere(std::vector<std::string> words) const {
    return test::run(command(std::move(words)), kLimit);
  }

  test::TwoHosts hosts_;
  test::Daemon daemon_;
  test::TemporaryFolder folder_;
  std::unique_ptr<test::Process> service_;
};

TEST_F(NetworkTest, AnotherHostSubmitsABatchAndHasItsTargetsCorrected) {
  start("without_security: true");
  const std::string batch = folder_.write("batch.csv", test::virtual_batch_csv(120, 3));
  const auto submitted = elsewhere({"submit", "--cell", "cell-7", "--batch", batch, "--watch"});
  ASSERT_EQ(submitted.exit_code, 0) << submitted.out << submitted.err;
  const auto corrected = elsewhere({"correct", "--service", "--model", "cell-7",
                                    TRAMMEL_SOURCE_DIR "/config/drill-panel.csv", "-o",
                                    folder_.file("corrected.csv")});
  EXPECT_EQ(corrected.exit_code, 0) << corrected.out << corrected.err;
}

#ifdef TRAMMEL_CYCLONE_CLIENT
// As its maker ships it Cyclone DDS sends datagrams of up to 14720 bytes, which IP cuts into
// frames; ours are of 1400.
TEST_F(NetworkTest, ACycloneClientAsItsMakerShipsItIsAnsweredHoweverMuchItAsks) {
  start("without_security: true");
  const std::string batch = folder_.write("batch.csv", test::virtual_batch_csv(120, 3));
  const auto submitted = elsewhere({"submit", "--cell", "cell-7", "--batch", batch, "--watch"});
  ASSERT_EQ(submitted.exit_code, 0) << submitted.out << submitted.err;
  for (const char* sizes :
       {"", "<MaxMessageSize>65500B</MaxMessageSize><FragmentSize>65000B</FragmentSize>"}) {
    const std::string uri = fmt::format(
        "CYCLONEDDS_URI=<CycloneDDS><Domain><General><Interfaces><NetworkInterface address=\"{}\" "
        "multicast=\"false\"/></Interfaces><AllowMulticast>false</AllowMulticast>{}</"
        "General><Discovery><ParticipantIndex>none</ParticipantIndex><Peers><Peer "
        "address=\"{}:{}\"/></Peers></Discovery></Domain></CycloneDDS>",
        hosts_.address(1), sizes, hosts_.address(0), daemon_.port());
    for (const char* poses : {"100", "2000"}) {
      const auto client =
          test::run(hosts_.on(1, {"/usr/bin/env", uri, TRAMMEL_CYCLONE_CLIENT,
                                  std::to_string(daemon_.domain()), "cell-7", "10", poses}),
                    kLimit);
      EXPECT_EQ(client.exit_code, 0) << client.out << client.err;
      EXPECT_NE(client.out.find(fmt::format("items={}\n", poses)), std::string::npos)
          << client.out << client.err;
    }
  }
}
#endif

TEST_F(NetworkTest, AfterItsInterfaceWasGoneTheServiceAnswersAgain) {
  start("without_security: true");
  ASSERT_EQ(elsewhere({"status"}).exit_code, 0);
  ASSERT_TRUE(hosts_.set_interface(0, false));
  const auto cut = elsewhere({"status"});
  EXPECT_NE(cut.exit_code, 0) << cut.out << cut.err;
  ASSERT_TRUE(hosts_.set_interface(0, true));
  const auto again = elsewhere({"status"});
  EXPECT_EQ(again.exit_code, 0) << again.out << again.err;
}

TEST_F(NetworkTest, WithCertificatesTheOtherHostIsServedAndWithoutItIsNot) {
  const std::string keys = TRAMMEL_SOURCE_DIR "/deploy/security/keys",
                    plant = folder_.file("plant");
  ASSERT_EQ(test::run({keys, "init", plant}).exit_code, 0);
  ASSERT_EQ(test::run({keys, "issue", plant, "server", "line-3"}).exit_code, 0);
  ASSERT_EQ(test::run({keys, "issue", plant, "observer", "office"}).exit_code, 0);
  start("security: " + plant + "/participants/line-3");
  const auto plain = elsewhere({"status", "--timeout", "3"});
  EXPECT_EQ(plain.exit_code, 4) << plain.out << plain.err;
  const auto known = elsewhere({"status", "--security", plant + "/participants/office"});
  EXPECT_EQ(known.exit_code, 0) << known.out << known.err;
  const auto forbidden =
      elsewhere({"rollback", "--cell", "cell-7", "--security", plant + "/participants/office"});
  EXPECT_EQ(forbidden.exit_code, 3) << forbidden.out << forbidden.err;
}

TEST_F(NetworkTest, WhatSomebodyOnTheLineSendsAgainHappensOnce) {
  const std::string keys = TRAMMEL_SOURCE_DIR "/deploy/security/keys",
                    plant = folder_.file("plant");
  ASSERT_EQ(test::run({keys, "init", plant}).exit_code, 0);
  ASSERT_EQ(test::run({keys, "issue", plant, "server", "line-3"}).exit_code, 0);
  ASSERT_EQ(test::run({keys, "issue", plant, "engineer", "office"}).exit_code, 0);
  start("security: " + plant + "/participants/line-3");
  const std::string office = plant + "/participants/office";
  for (const char* id : {"first", "second"}) {
    const std::string batch =
        folder_.write(std::string(id) + ".csv", test::virtual_batch_csv(80, id[0]));
    const auto submitted = elsewhere({"submit", "--cell", "cell-7", "--batch", batch, "--id", id,
                                      "--watch", "--security", office});
    ASSERT_EQ(submitted.exit_code, 0) << submitted.out << submitted.err;
  }
  const auto changes = [&] {
    return elsewhere({"audit", "--cell", "cell-7", "--security", office, "--json", "-"}).out;
  };
  const std::string before = changes();
  ASSERT_NE(before.find("second"), std::string::npos) << before;
  for (int i = 0; i < 3; ++i) EXPECT_GT(hosts_.repeat_from(1), 100U);
  EXPECT_EQ(changes(), before);
  EXPECT_EQ(elsewhere({"status", "--security", office}).exit_code, 0);
}

/// Holes beside each other on the shipped panel.
std::string many_targets(int count) {
  std::string text = "hole,x_mm,y_mm,z_mm,qw,qx,qy,qz,conf\n";
  for (int i = 0; i < count; ++i)
    text += fmt::format("{},1800,{:.3f},{:.3f},0.7071067811865476,0,0.7071067811865476,0,0\n", i,
                        -250 + 500.0 * i / count, 800.0 + i % 1000);
  return text;
}

/// A line that loses every twentieth frame, holds each back for 50 ms and lets them overtake each
/// other.
class BadLineTest : public NetworkTest {
 protected:
  BadLineTest()
      : NetworkTest({0.05, std::chrono::milliseconds(50), std::chrono::milliseconds(20)}) {}

  /// A model is learned from a batch that comes over the line.
  void learn() {
    const std::string batch = folder_.write("batch.csv", test::virtual_batch_csv(120, 3));
    const auto submitted = elsewhere({"submit", "--cell", "cell-7", "--batch", batch, "--watch"});
    ASSERT_EQ(submitted.exit_code, 0) << submitted.out << submitted.err;
    const auto fetched =
        elsewhere({"export", "--model", "cell-7", "-o", folder_.file("cell.model")});
    ASSERT_EQ(fetched.exit_code, 0) << fetched.out << fetched.err;
  }
  /// The program as this host corrects it with the model's file.
  [[nodiscard]] std::string corrected_here(const std::string& program) const {
    const auto done =
        test::run({TRAMMEL_BINARY_DIR "/clients/trammel", "correct", "--model",
                   folder_.file("cell.model"), program, "-o", folder_.file("here.csv")});
    EXPECT_EQ(done.exit_code, 0) << done.out << done.err;
    return test::read_file(folder_.file("here.csv"));
  }
  [[nodiscard]] std::vector<std::string> correct(const std::string& program) const {
    return {"correct",   "--service", "--model", "cell-7", program, "-o", folder_.file("there.csv"),
            "--timeout", "20"};
  }
};

TEST_F(BadLineTest, EveryAnswerOverItIsTheRightOne) {
  start("without_security: true");
  learn();
  const std::string program = TRAMMEL_SOURCE_DIR "/config/drill-panel.csv",
                    wanted = corrected_here(program);
  for (int i = 0; i < 5; ++i) {
    const auto corrected = elsewhere(correct(program));
    ASSERT_EQ(corrected.exit_code, 0) << corrected.out << corrected.err;
    EXPECT_EQ(test::read_file(folder_.file("there.csv")), wanted);
  }
}

TEST_F(BadLineTest, ALongProgramOutlastsACutOfFiveSeconds) {
  start("without_security: true");
  learn();
  const std::string program = folder_.write("long.csv", many_targets(3000)),
                    wanted = corrected_here(program);
  const std::uint64_t before = hosts_.carried();
  test::Process correcting(command(correct(program)));
  hosts_.wait_until_carried(before + 200);  // some parts are answered
  hosts_.cut_for(seconds(5));
  EXPECT_EQ(correcting.wait(kLimit), 0) << correcting.standard_error();
  EXPECT_EQ(test::read_file(folder_.file("there.csv")), wanted);
}

}  // namespace
}  // namespace trammel
