// A service that other hosts reach: two hosts are two network namespaces with a cable between them.
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <memory>

#include "server/base/text_file.h"
#include "tests/support/daemon.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using std::chrono::seconds;
constexpr seconds kLimit{60};

/// Two hosts, 10.88.N.1 and 10.88.N.2, that see each other and nobody else. They go with the test.
class TwoHosts {
 public:
  TwoHosts() {
    const auto number = std::to_string(::getpid() % 250);
    for (std::size_t i = 0; i < 2; ++i) {
      names_[i] = "trammel-" + std::to_string(::getpid()) + "-" + std::to_string(i);
      addresses_[i] = "10.88." + number + "." + std::to_string(i + 1);
    }
    made_ =
        ip({"netns", "add", names_[0]}) && ip({"netns", "add", names_[1]}) &&
        ip({"link", "add", "cable", "netns", names_[0], "type", "veth", "peer", "name", "cable", "netns", names_[1]});
    for (std::size_t i = 0; made_ && i < 2; ++i) {
      made_ = ip({"-n", names_[i], "addr", "add", addresses_[i] + "/24", "dev", "cable"}) &&
              ip({"-n", names_[i], "link", "set", "lo", "up"}) && set_cable(i, true);
    }
    made_ = made_ && wait_for_link();
  }
  ~TwoHosts() {
    for (const std::string& name : names_) static_cast<void>(ip({"netns", "del", name}));
  }
  TwoHosts(const TwoHosts&) = delete;
  TwoHosts& operator=(const TwoHosts&) = delete;

  [[nodiscard]] bool made() const { return made_; }
  [[nodiscard]] const std::string& address(std::size_t host) const { return addresses_.at(host); }
  [[nodiscard]] bool set_cable(std::size_t host, bool up) const {
    return ip({"-n", names_.at(host), "link", "set", "cable", up ? "up" : "down"});
  }
  /// Until both ends of the cable are up, and have noticed.
  [[nodiscard]] bool wait_for_link() const {
    for (int i = 0; i < 1000; ++i) {
      if (has_link()) return true;
    }
    return false;
  }
  /// The same command on that host.
  [[nodiscard]] std::vector<std::string> on(std::size_t host, std::vector<std::string> argv) const {
    argv.insert(argv.begin(), {"/usr/sbin/ip", "netns", "exec", names_.at(host)});
    return argv;
  }

 private:
  [[nodiscard]] bool has_link() const {
    return std::all_of(names_.begin(), names_.end(), [](const std::string& name) {
      const auto link = test::run({"/usr/sbin/ip", "-n", name, "link", "show", "cable"});
      return link.out.find("state UP") != std::string::npos;
    });
  }
  static bool ip(std::vector<std::string> words) {
    words.insert(words.begin(), "/usr/sbin/ip");
    return test::run(words).exit_code == 0;
  }

  std::array<std::string, 2> names_, addresses_;
  bool made_ = false;
};

class NetworkTest : public testing::Test {
 protected:
  void SetUp() override {
    if (::access("/usr/sbin/ip", X_OK) != 0 || !hosts_.made())
      GTEST_SKIP() << "network namespaces cannot be made here: that takes root, and iproute2";
  }

  void start(const std::string& dds) {
    const std::string text = test::read_file(daemon_.config_path());
    ASSERT_TRUE(write_text_file(daemon_.config_path(), fmt::format("{}dds: {{address: {}, allow_network: true, {}}}\n",
                                                                   text, hosts_.address(0), dds)));
    service_ = std::make_unique<test::Process>(hosts_.on(0, daemon_.command_line()));
    ASSERT_TRUE(service_->wait_for_line("ready", kLimit)) << service_->standard_error();
  }
  [[nodiscard]] std::vector<std::string> command(std::vector<std::string> words) const {
    words.insert(words.begin(), TRAMMEL_BINARY_DIR "/clients/trammel");
    words.insert(words.end(), {"--host", fmt::format("{}:{}", hosts_.address(0), daemon_.port()), "--domain",
                               std::to_string(daemon_.domain())});
    return hosts_.on(1, std::move(words));
  }
  /// A command of the other host.
  [[nodiscard]] test::Finished elsewhere(std::vector<std::string> words) const {
    return test::run(command(std::move(words)), kLimit);
  }

  TwoHosts hosts_;
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
                                    TRAMMEL_SOURCE_DIR "/config/drill-panel.csv", "-o", folder_.file("corrected.csv")});
  EXPECT_EQ(corrected.exit_code, 0) << corrected.out << corrected.err;
}

TEST_F(NetworkTest, AfterACutCableTheServiceAnswersAgain) {
  start("without_security: true");
  ASSERT_EQ(elsewhere({"status"}).exit_code, 0);
  ASSERT_TRUE(hosts_.set_cable(0, false));
  const auto cut = elsewhere({"status"});
  EXPECT_NE(cut.exit_code, 0) << cut.out << cut.err;
  ASSERT_TRUE(hosts_.set_cable(0, true));
  ASSERT_TRUE(hosts_.wait_for_link());
  const auto again = elsewhere({"status"});
  EXPECT_EQ(again.exit_code, 0) << again.out << again.err;
}

TEST_F(NetworkTest, WithCertificatesTheOtherHostIsServedAndWithoutItIsNot) {
  const std::string keys = TRAMMEL_SOURCE_DIR "/deploy/security/keys", plant = folder_.file("plant");
  ASSERT_EQ(test::run({keys, "init", plant}).exit_code, 0);
  ASSERT_EQ(test::run({keys, "issue", plant, "replica", "line-3"}).exit_code, 0);
  ASSERT_EQ(test::run({keys, "issue", plant, "observer", "office"}).exit_code, 0);
  start("security: " + plant + "/participants/line-3");
  const auto plain = elsewhere({"status", "--timeout", "3"});
  EXPECT_EQ(plain.exit_code, 4) << plain.out << plain.err;
  const auto known = elsewhere({"status", "--security", plant + "/participants/office"});
  EXPECT_EQ(known.exit_code, 0) << known.out << known.err;
  const auto forbidden = elsewhere({"rollback", "--cell", "cell-7", "--security", plant + "/participants/office"});
  EXPECT_EQ(forbidden.exit_code, 3) << forbidden.out << forbidden.err;
}

}  // namespace
}  // namespace trammel
