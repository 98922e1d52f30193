// Two servers of the same cell on two hosts: the line between them is good or bad, with certificates or without, and
// cut.
#include <gtest/gtest.h>
#include <signal.h>

#include <array>
#include <memory>
#include <nlohmann/json.hpp>

#include "server/base/text_file.h"
#include "tests/support/daemon.h"
#include "tests/support/two_hosts.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using nlohmann::json;
using std::chrono::steady_clock;

constexpr std::chrono::seconds kLimit{120};
constexpr std::chrono::hours kUntilMended{1};

class ReplicasOnALine : public testing::Test {
 protected:
  explicit ReplicasOnALine(const test::LineFaults& faults = {}) : hosts_(faults) {
    for (std::size_t i = 0; i < 2; ++i) files_.at(i) = test::read_file(daemons_.at(i).config_path());
  }
  void SetUp() override {
    if (!hosts_.why_not().empty()) GTEST_SKIP() << hosts_.why_not();
  }

  [[nodiscard]] std::string place(std::size_t which) const {
    return fmt::format("{}:{}", hosts_.address(which), daemons_.at(which).port());
  }
  /// Gives a server its part; it knows the other one.
  void give(std::size_t which, const std::string& part) {
    const std::string text =
        fmt::format("{}replica: {{{}}}\ndds: {{address: {}, allow_network: true, peers: [\"{}\"], {}}}\n",
                    files_.at(which), part, hosts_.address(which), place(1 - which),
                    plant_.empty() ? "without_security: true" : "security: " + certificate(fmt::format("r{}", which)));
    ASSERT_TRUE(write_text_file(daemons_.at(which).config_path(), text));
  }
  void give_usual_parts(const std::string& more = "") {
    give(0, "role: writer" + more);
    give(1, fmt::format("role: follower, of: {}{}", daemons_.at(0).name(), more));
  }
  void start(std::size_t which) {
    running_.at(which) = std::make_unique<test::Process>(hosts_.on(which, daemons_.at(which).command_line()));
    ASSERT_TRUE(running_.at(which)->wait_for_line("ready", kLimit)) << running_.at(which)->standard_error();
  }
  void start_both() {
    for (const std::size_t which : {0, 1}) ASSERT_NO_FATAL_FAILURE(start(which));
  }
  /// As plant IT makes them: two servers, and an engineer's office.
  void make_certificates() {
    plant_ = folder_.file("plant");
    const std::string keys = TRAMMEL_SOURCE_DIR "/deploy/security/keys";
    ASSERT_EQ(test::run({keys, "init", plant_}).exit_code, 0);
    for (const char* name : {"r0", "r1"}) ASSERT_EQ(test::run({keys, "issue", plant_, "replica", name}).exit_code, 0);
    ASSERT_EQ(test::run({keys, "issue", plant_, "engineer", "office"}).exit_code, 0);
  }
  [[nodiscard]] std::string certificate(const std::string& name) const { return plant_ + "/participants/" + name; }

  /// A command on the host of a server that names this server alone.
  [[nodiscard]] test::Finished ask(std::size_t which, std::vector<std::string> words) const {
    words.insert(words.begin(), {TRAMMEL_BINARY_DIR "/clients/trammel"});
    words.insert(words.end(), {"--host", place(which), "--domain", std::to_string(daemons_.at(which).domain())});
    if (!plant_.empty()) words.insert(words.end(), {"--security", certificate("office")});
    return test::run(hosts_.on(which, std::move(words)), kLimit);
  }
  void learn(std::size_t which, const std::string& batch, std::uint64_t seed) {
    const std::string file = folder_.write(batch + ".csv", test::virtual_batch_csv(60, seed));
    const auto done = ask(which, {"submit", "--cell", "cell-7", "--batch", file, "--id", batch, "--watch"});
    ASSERT_TRUE(done.exit_code == 0 || done.exit_code == 1) << done.out << done.err;  // 1: it was no better
  }
  /// What a server says of its own part; null: it does not answer.
  [[nodiscard]] json part(std::size_t which) const {
    const auto said = ask(which, {"status", "--json", "-"});
    const json all = json::parse(said.out, nullptr, false);
    return all.is_object() && !all.at("servers").empty() ? all.at("servers").at(0).at("replica") : json();
  }
  [[nodiscard]] bool wait_until(const std::function<bool(const json& first, const json& second)>& holds) const {
    for (const auto until = steady_clock::now() + kLimit; steady_clock::now() < until;) {
      const json first = part(0), second = part(1);
      if (first.is_object() && second.is_object() && holds(first, second)) return true;
    }
    return false;
  }
  [[nodiscard]] bool wait_until_it_writes(std::size_t which) const {
    for (const auto until = steady_clock::now() + kLimit; steady_clock::now() < until;)
      if (const json its = part(which); its.is_object() && its.at("role") == "writer") return true;
    return false;
  }
  static std::string hash_of(const json& part) { return part.at("cells").at(0).at("hash"); }
  /// Both serve the same model, by the same decisions.
  static bool same(const json& first, const json& second) {
    return first.at("epoch") == second.at("epoch") && hash_of(first) == hash_of(second) &&
           first.at("cells").at(0).at("version") > 0;
  }
  [[nodiscard]] std::string batches_at(std::size_t which) const {
    return ask(which, {"batches", "--cell", "cell-7", "--json", "-"}).out;
  }
  /// The model that a server answers with, by the batch that it learned from last, or what it says instead.
  [[nodiscard]] test::Finished correct_at(std::size_t which) const {
    return ask(which, {"correct", "--service", "--model", "cell-7", TRAMMEL_SOURCE_DIR "/config/drill-panel.csv", "-o",
                       folder_.file(fmt::format("at{}.csv", which))});
  }
  [[nodiscard]] std::string corrected_at(std::size_t which) const {
    const auto done = correct_at(which);
    EXPECT_EQ(done.exit_code, 0) << done.out << done.err;
    return test::read_file(folder_.file(fmt::format("at{}.csv", which)));
  }
  /// Everything that was said so far on the standard error of both servers.
  [[nodiscard]] std::string said() const {
    return running_.at(0)->standard_error() + "\n-- the second one:\n" + running_.at(1)->standard_error();
  }

  test::TwoHosts hosts_;
  std::array<test::Daemon, 2> daemons_{test::Daemon(0), test::Daemon(1)};
  std::array<std::string, 2> files_;
  std::array<std::unique_ptr<test::Process>, 2> running_;
  test::TemporaryFolder folder_;
  std::string plant_;  // the folder of the certificates; empty: none
};

TEST_F(ReplicasOnALine, WithCertificatesTheFollowerHasModelAndBatchAndWritesWhenItIsToldTo) {
  ASSERT_NO_FATAL_FAILURE(make_certificates());
  give_usual_parts(", batches_to_followers: true, copy_timeout_s: 30");
  ASSERT_NO_FATAL_FAILURE(start_both());
  ASSERT_TRUE(wait_until([&](const json&, const json& b) { return b.at("follows") == daemons_.at(0).name(); }))
      << said();
  ASSERT_NO_FATAL_FAILURE(learn(0, "lt-1", 1));
  EXPECT_NE(batches_at(1).find("lt-1"), std::string::npos) << "its receipt came before the copy\n" << said();
  ASSERT_TRUE(wait_until(same)) << said();
  EXPECT_EQ(corrected_at(0), corrected_at(1));

  running_.at(0)->signal(SIGKILL);
  ASSERT_TRUE(running_.at(0)->wait(kLimit));
  EXPECT_EQ(correct_at(1).exit_code, 0);
  give(1, "role: writer");
  running_.at(1)->signal(SIGHUP);
  ASSERT_TRUE(wait_until_it_writes(1)) << running_.at(1)->standard_error();
  ASSERT_NO_FATAL_FAILURE(learn(1, "lt-2", 2));
  ASSERT_NO_FATAL_FAILURE(start(0));  // its file still says that it writes
  EXPECT_TRUE(wait_until([](const json& a, const json& b) {
    return same(a, b) && a.at("role") == "follower" && b.at("role") == "writer";
  })) << said();
}

TEST_F(ReplicasOnALine, WithoutACertificateAServerIsNeitherFollowedNorHasItBatches) {
  give_usual_parts(", batches_to_followers: true, copy_timeout_s: 1");
  ASSERT_NO_FATAL_FAILURE(start(1));  // a plain follower
  ASSERT_NO_FATAL_FAILURE(make_certificates());
  give(0, "role: writer, batches_to_followers: true, copy_timeout_s: 1");
  ASSERT_NO_FATAL_FAILURE(start(0));
  ASSERT_NO_FATAL_FAILURE(learn(0, "lt-1", 1));
  EXPECT_TRUE(running_.at(1)->wait_for_line("no server writes", kLimit)) << said();
  plant_.clear();
  const auto its_own = ask(1, {"models", "--cell", "cell-7", "--json", "-"});
  EXPECT_EQ(its_own.exit_code, 0) << its_own.err;
  EXPECT_EQ(json::parse(its_own.out).at("models"), json::array()) << its_own.out;
  EXPECT_EQ(batches_at(1).find("lt-1"), std::string::npos);
}

TEST_F(ReplicasOnALine, BothWriteWhileTheLineIsCutThenOneStopsAndNothingIsLost) {
  give_usual_parts();
  ASSERT_NO_FATAL_FAILURE(start_both());
  ASSERT_NO_FATAL_FAILURE(learn(0, "before", 1));
  ASSERT_TRUE(wait_until(same)) << said();

  hosts_.cut_for(kUntilMended);
  give(1, "role: writer");
  running_.at(1)->signal(SIGHUP);
  ASSERT_TRUE(wait_until_it_writes(1)) << running_.at(1)->standard_error();
  ASSERT_TRUE(wait_until_it_writes(0)) << running_.at(0)->standard_error();
  ASSERT_NO_FATAL_FAILURE(learn(0, "here", 2));
  ASSERT_NO_FATAL_FAILURE(learn(1, "there", 3));
  hosts_.cut_for(std::chrono::milliseconds(0));

  EXPECT_TRUE(running_.at(0)->wait_for_line("two servers write", kLimit)) << "who stops says why\n" << said();
  EXPECT_TRUE(wait_until([](const json& a, const json& b) {
    return same(a, b) && a.at("role") == "follower" && b.at("role") == "writer";
  })) << said();
  EXPECT_NE(batches_at(0).find("here"), std::string::npos);
  EXPECT_NE(batches_at(1).find("there"), std::string::npos);
}

TEST_F(ReplicasOnALine, AServerFileThatWasCopiedWithItsNameIsSaidOnBothHosts) {
  std::string& second = files_.at(1);
  second.replace(second.find(daemons_.at(1).name()), daemons_.at(1).name().size(), daemons_.at(0).name());
  for (const std::size_t which : {0, 1}) give(which, "role: writer");
  ASSERT_NO_FATAL_FAILURE(start_both());
  const std::string words = fmt::format("another server is called {} too", daemons_.at(0).name());
  for (const auto& server : running_) EXPECT_TRUE(server->wait_for_line(words, kLimit)) << said();
  running_.at(1)->signal(SIGTERM);
  EXPECT_EQ(running_.at(1)->wait(kLimit), 0);
  EXPECT_TRUE(running_.at(0)->wait_for_line("over: " + words, kLimit)) << said();
}

/// A line that loses every twentieth frame, holds each back for 50 ms and lets them overtake each other.
class ReplicasOnABadLine : public ReplicasOnALine {
 protected:
  ReplicasOnABadLine() : ReplicasOnALine({0.05, std::chrono::milliseconds(50), std::chrono::milliseconds(20)}) {}
};

TEST_F(ReplicasOnABadLine, WhileItIsCutTheFollowerServesTheModelThatItHasAndThenTheWriters) {
  give_usual_parts();
  ASSERT_NO_FATAL_FAILURE(start_both());
  ASSERT_NO_FATAL_FAILURE(learn(0, "lt-1", 1));
  ASSERT_NO_FATAL_FAILURE(learn(0, "lt-2", 2));
  ASSERT_EQ(ask(0, {"activate", "--model", "cell-7@2"}).exit_code, 0);
  ASSERT_TRUE(wait_until(same)) << said();
  const std::string second = corrected_at(0);

  hosts_.cut_for(kUntilMended);
  ASSERT_EQ(ask(0, {"activate", "--model", "cell-7@1"}).exit_code, 0);
  const std::string first = corrected_at(0);
  ASSERT_NE(first, second);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(corrected_at(1), second);
  hosts_.cut_for(std::chrono::milliseconds(0));

  ASSERT_TRUE(wait_until(same)) << said();
  EXPECT_EQ(corrected_at(1), first);
}

}  // namespace
}  // namespace trammel
