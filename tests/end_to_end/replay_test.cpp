// Recorded calls of a service are asked again.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "server/base/text_file.h"
#include "tests/support/daemon.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using nlohmann::json;

constexpr std::chrono::seconds kReplayLimit{120};

class ReplayTest : public testing::Test {
 protected:
  void SetUp() override {
    const std::string text = test::read_file(daemon_.config_path());
    ASSERT_TRUE(write_text_file(
        daemon_.config_path(),
        text + fmt::format("record: {{folder: {}, max_mb: 8}}\n", folder_.file("records"))));
    daemon_.start();
    auto opened = client::Session::open(daemon_.session_options());
    ASSERT_TRUE(opened) << sentence(opened.error());
    session_ = std::move(*opened);
    for (const std::uint64_t seed : {1, 2}) {
      const auto job = session_->submit_measurements("cell-7", fmt::format("b{}", seed),
                                                     test::virtual_batch_csv(60, seed));
      ASSERT_TRUE(job) << sentence(job.error());
      ASSERT_TRUE(session_->wait_for_job(*job, kReplayLimit, nullptr));
    }
    ASSERT_TRUE(session_->activate("cell-7", 1));
    for (const int version : {1, 2}) {
      const auto model = session_->export_model("cell-7", version);
      ASSERT_TRUE(model) << sentence(model.error());
      folder_.write(model_file(version).filename(), *model);
    }
    ask();
    EXPECT_EQ(daemon_.stop(), 0);  // all is written
  }

  void ask() {
    client::CallContext context;
    context.cell = "cell-7";
    ASSERT_TRUE(session_->predict_error(context, test::virtual_joints(20, 7)));
    exchange::AskedTarget near, far;
    near.pose = {1800, 125, 1200, 0.7071067811865476, 0, 0.7071067811865476, 0};
    near.conf = 0;
    far.pose = {9000, 0, 0, 1, 0, 0, 0};
    far.conf = 0;
    ASSERT_TRUE(session_->correct_targets(context, {near, far}));
  }
  [[nodiscard]] std::filesystem::path model_file(int version) const {
    return folder_.file(fmt::format("cell-7-{}.model", version));
  }
  [[nodiscard]] test::Finished replay(int version, const std::string& records) const {
    return test::run({TRAMMEL_BINARY_DIR "/clients/trammel", "replay", "--model",
                      model_file(version), records, "--strict", "--json", "-"},
                     kReplayLimit);
  }
  [[nodiscard]] std::string only_record() const {
    std::string path;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.file("records")))
      path = entry.path();
    return path;
  }

  test::Daemon daemon_;
  test::TemporaryFolder folder_;
  std::unique_ptr<client::Session> session_;
};

TEST_F(ReplayTest, TheModelThatAnsweredAnswersTheSameAndAnotherOneDoesNot) {
  const auto same = replay(1, folder_.file("records"));
  ASSERT_EQ(same.exit_code, 0) << same.out << same.err;
  const json told = json::parse(same.out);
  EXPECT_EQ(told.at("requests"), 3) << "the first part of a list has 16 items";
  EXPECT_EQ(told.at("items"), 22);
  EXPECT_EQ(told.at("largest_mm"), 0.0);
  EXPECT_EQ(told.at("answered_by_another_model"), 0);
  const auto other = replay(2, folder_.file("records"));
  EXPECT_EQ(other.exit_code, 1) << other.out << other.err;
  const json differs = json::parse(other.out);
  EXPECT_GE(differs.at("different"), 20);
  EXPECT_EQ(differs.at("answered_by_another_model"), 3);
  EXPECT_GT(differs.at("largest_mm").get<double>(), 1e-3);
}

TEST_F(ReplayTest, ANumberThatWasChangedAfterwardsIsNamedAndHalfALastLineIsLeftOut) {
  const std::string path = only_record();
  std::string text = test::read_file(path);
  EXPECT_EQ(std::filesystem::status(path).permissions() & std::filesystem::perms::others_all,
            std::filesystem::perms::none);
  const std::size_t at = text.find("\"commanded_mm\":[") + 16;
  text.insert(at, "1");
  text += text.substr(0, text.size() / 3);
  const auto changed = replay(1, folder_.write("changed.jsonl", text));
  EXPECT_EQ(changed.exit_code, 1) << changed.out << changed.err;
  const json told = json::parse(changed.out);
  EXPECT_EQ(told.at("different"), 1);
  EXPECT_NE(told.at("largest").at(0).at("what").get<std::string>().find("row 3 item 1"),
            std::string::npos)
      << told.dump();
  ASSERT_EQ(told.at("half_lines").size(), 1u);
  EXPECT_TRUE(told.at("half_lines").at(0).get<std::string>().ends_with("changed.jsonl row 4"))
      << told.dump();
}

TEST_F(ReplayTest, HalfALastLineAndAnEmptyFileAreSaid) {
  const auto replayed = [&](const std::string& name, const std::string& text) {
    return test::run({TRAMMEL_BINARY_DIR "/clients/trammel", "replay", "--model", model_file(1),
                      folder_.write(name, text)},
                     kReplayLimit);
  };
  const std::string text = test::read_file(only_record());
  const auto half = replayed("half.jsonl", text + text.substr(0, 100));
  EXPECT_EQ(half.exit_code, 0) << half.err;
  EXPECT_NE(half.out.find("half.jsonl row 4: the last line is half and is left out"),
            std::string::npos)
      << half.out;
  const auto empty = replayed("empty.jsonl", "");
  EXPECT_EQ(empty.out, "no requests recorded there\n");
  EXPECT_EQ(empty.exit_code, 0) << empty.err;
}

TEST_F(ReplayTest, AnotherDomainAnotherBranchAndAnErrorThatWasNotKnownAreDifferencesToo) {
  const std::string text = test::read_file(only_record());
  const auto differs = [&](const std::string& now, const std::string& then) {
    const std::size_t at = text.find(now);
    EXPECT_NE(at, std::string::npos) << now;
    const auto replayed =
        replay(1, folder_.write("then.jsonl", std::string(text).replace(at, now.size(), then)));
    EXPECT_EQ(replayed.exit_code, 1) << replayed.err;
    return json::parse(replayed.out).at("different");
  };
  EXPECT_EQ(differs("\"in_domain\":true", "\"in_domain\":false"), 1);
  EXPECT_EQ(differs("\"commanded_joints_rad\":[", "\"commanded_joints_rad\":[7,"), 1);
  EXPECT_EQ(differs("\"error_after_mm\":0.", "\"error_after_mm\":null,\"was\":0."), 1);
}

TEST_F(ReplayTest, ADamagedLineIsLeftOutAndSaidWithItsPlace) {
  std::string text = test::read_file(only_record());
  text.insert(text.find('\n') + 1, std::string(4096, '\0') + "\n");
  const auto replayed = replay(1, folder_.write("torn.jsonl", text));
  EXPECT_EQ(replayed.exit_code, 1) << replayed.out << replayed.err;
  const json told = json::parse(replayed.out);
  EXPECT_EQ(told.at("requests"), 3);
  EXPECT_EQ(told.at("different"), 0);
  EXPECT_EQ(told.at("damaged_lines"), 1);
  EXPECT_NE(told.at("first_damaged").get<std::string>().find("row 2"), std::string::npos)
      << told.dump();
}

TEST_F(ReplayTest, OfTheRecordsOfSeveralCellsThoseOfTheModelsCellAreAskedAgain) {
  std::string text = test::read_file(only_record());
  const auto make_other = [&] {
    const std::size_t at = text.find("\"cell-7\"");
    if (at != std::string::npos) text.replace(at, 8, "\"cell-8\"");
    return at != std::string::npos;
  };
  ASSERT_TRUE(make_other());
  const auto replayed = replay(1, folder_.write("both.jsonl", text));
  EXPECT_EQ(replayed.exit_code, 0) << replayed.out << replayed.err;
  const json told = json::parse(replayed.out);
  EXPECT_EQ(told.at("requests"), 2);
  EXPECT_EQ(told.at("other_cells"), json({"cell-8"}));
  while (make_other()) continue;
  const auto none = replay(1, folder_.write("other.jsonl", text));
  EXPECT_EQ(none.exit_code, 3) << none.out;
  EXPECT_NE(none.err.find("cell-8"), std::string::npos) << none.err;
}

TEST_F(ReplayTest, WhatIsNoRecordIsRefusedWithItsLine) {
  const auto refused = replay(1, folder_.write("no.jsonl", "{\"record\":1}\n"));
  EXPECT_EQ(refused.exit_code, 3) << refused.out;
  EXPECT_NE(refused.err.find("row 1"), std::string::npos) << refused.err;
}

}  // namespace
}  // namespace trammel
