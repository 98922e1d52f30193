// Cells that are shared out among servers: each server's list of cells says which are at home
// there, and a client that names all servers asks the right one by itself.
#include <gtest/gtest.h>

#include <filesystem>

#include "server/base/text_file.h"
#include "tests/support/daemon.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using std::chrono::seconds;
constexpr seconds kSeveralServersLimit{30};

class SeveralServersTest : public testing::Test {
 protected:
  void SetUp() override {
    rename_its_cell(second_, "cell-8");
    first_.start();
    second_.start();
    client::SessionOptions options = first_.session_options();
    options.server_ports = {first_.port(), second_.port()};
    auto opened = client::Session::open(options);
    ASSERT_TRUE(opened) << opened.error().message;
    session_ = std::move(*opened);
  }
  static void rename_its_cell(const test::Daemon& daemon, const std::string& name) {
    const std::string file =
        (std::filesystem::path(daemon.config_path()).parent_path() / "cell-7.yaml").string();
    std::string text = test::read_file(file);
    text.replace(text.find("cell: cell-7"), std::string("cell: cell-7").size(), "cell: " + name);
    ASSERT_TRUE(write_text_file(file, text));
  }
  void learn(const std::string& cell, const std::string& batch, std::uint64_t seed) {
    const auto job = session_->submit_measurements(cell, batch, test::virtual_batch_csv(60, seed));
    ASSERT_TRUE(job) << sentence(job.error());
    const auto over = session_->wait_for_job(*job, kSeveralServersLimit, nullptr);
    ASSERT_TRUE(over) << sentence(over.error());
    ASSERT_TRUE(over->in_force) << over->what;
  }
  [[nodiscard]] std::string batch_that_answers(const std::string& cell) {
    client::CallContext context;
    context.cell = cell;
    const auto answer = session_->predict_error(context, test::virtual_joints(3, 7));
    return answer ? answer->model.batch_id : sentence(answer.error());
  }

  test::Daemon first_{0}, second_{1};
  std::unique_ptr<client::Session> session_;
};

TEST_F(SeveralServersTest, EachCellsBatchesAndQuestionsReachTheServerThatHasIt) {
  learn("cell-7", "of-seven", 1);
  learn("cell-8", "of-eight", 2);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(batch_that_answers("cell-7"), "of-seven");
    EXPECT_EQ(batch_that_answers("cell-8"), "of-eight");
  }
  const auto batches = session_->batches("");
  ASSERT_TRUE(batches) << sentence(batches.error());
  EXPECT_EQ(batches->size(), 2U) << "of both servers, each once";
}

TEST_F(SeveralServersTest, StatusAnswersAtOnceAndNamesTheServerThatIsDown) {
  second_.kill();
  const std::string down = std::to_string(second_.port());
  const auto began = std::chrono::steady_clock::now();
  const test::Finished status = test::run({TRAMMEL_BINARY_DIR "/clients/trammel", "status",
                                           "--domain", std::to_string(first_.domain()), "--port",
                                           std::to_string(first_.port()), "--port", down});
  const auto took = std::chrono::steady_clock::now() - began;
  EXPECT_EQ(status.exit_code, 0) << status.err;
  EXPECT_LT(took, std::chrono::seconds(3)) << "each question waited a second for it";
  EXPECT_NE(status.out.find("not reachable: 127.0.0.1:" + down), std::string::npos) << status.out;
  EXPECT_NE(status.out.find("server " + first_.name()), std::string::npos) << status.out;
}

TEST_F(SeveralServersTest, OfTwoJobsWithOneNumberNoneIsTakenForTheOther) {
  const auto of_seven =
      session_->submit_measurements("cell-7", "of-seven", test::virtual_batch_csv(60, 1));
  ASSERT_TRUE(of_seven) << sentence(of_seven.error());
  const auto of_eight =
      session_->submit_measurements("cell-8", "of-eight", test::virtual_batch_csv(60, 2));
  ASSERT_TRUE(of_eight) << sentence(of_eight.error());
  ASSERT_EQ(*of_eight, *of_seven) << "every server counts its own jobs";
  const auto either = session_->wait_for_job(*of_eight, kSeveralServersLimit, nullptr);
  ASSERT_FALSE(either) << either->what;
  EXPECT_EQ(either.error().code, ErrorCode::kRefused) << sentence(either.error());
  client::SessionOptions options = first_.session_options();
  options.server_ports = {second_.port()};
  auto alone = client::Session::open(options);
  ASSERT_TRUE(alone) << sentence(alone.error());
  const auto over = (*alone)->wait_for_job(*of_eight, kSeveralServersLimit, nullptr);
  ASSERT_TRUE(over) << sentence(over.error());
  EXPECT_EQ(over->cell, "cell-8");
}

TEST_F(SeveralServersTest, AServerThatIsGoneTakesItsOwnCellsWithItAndNoOthers) {
  learn("cell-7", "of-seven", 1);
  second_.kill();
  EXPECT_EQ(batch_that_answers("cell-7"), "of-seven");
  const std::string said = batch_that_answers("cell-8");
  EXPECT_NE(said.find("cell-8"), std::string::npos) << said;
}

}  // namespace
}  // namespace trammel
