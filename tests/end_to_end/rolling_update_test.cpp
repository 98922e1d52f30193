// An update that goes from server to server: programs of two schemas on one record. The newer ones
// are built for this test (tests/CMakeLists.txt).
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "server/base/text_file.h"
#include "tests/support/daemon.h"
#include "tests/support/postgres.h"
#include "tests/support/process.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using std::chrono::seconds;
constexpr seconds kLimit{180};

const std::string kOlder = test::trammeld_path(),
                  kNewer = TRAMMEL_BINARY_DIR "/tests/trammeld_next";

/// A server whose program may become another one.
class Server {
 public:
  Server(int number, const std::string& url) : files_(number) {
    std::string text = test::read_file(files_.config_path());
    const std::string own = "store: trammel.db";
    text.replace(text.find(own), own.size(), "store: '" + url + "'");
    EXPECT_TRUE(write_text_file(files_.config_path(), text));
  }
  [[nodiscard]] client::SessionOptions session_options() const { return files_.session_options(); }
  [[nodiscard]] std::vector<std::string> command_line(const std::string& program) const {
    auto line = files_.command_line();
    line.front() = program;
    return line;
  }
  void start(const std::string& program) {
    process_ = std::make_unique<test::Process>(command_line(program));
    EXPECT_TRUE(process_->wait_for_line("ready", kLimit)) << process_->standard_error();
  }
  void stop() {
    process_->signal(SIGTERM);
    EXPECT_EQ(process_->wait(kLimit), 0);
  }

 private:
  test::Daemon files_;
  std::unique_ptr<test::Process> process_;
};

class RollingUpdate : public testing::Test {
 protected:
  static std::unique_ptr<client::Session> session_with(const Server& daemon) {
    auto opened = client::Session::open(daemon.session_options());
    EXPECT_TRUE(opened) << sentence(opened.error());
    return std::move(*opened);
  }
  /// The version that a batch given to this server leads to.
  static int made_from(const Server& daemon, const std::string& batch, std::uint64_t seed) {
    const auto session = session_with(daemon);
    const auto job =
        session->submit_measurements("cell-7", batch, test::virtual_batch_csv(60, seed));
    EXPECT_TRUE(job) << sentence(job.error());
    const auto over = session->wait_for_job(job.value_or(0), kLimit, nullptr);
    EXPECT_TRUE(over) << sentence(over.error());
    return over ? over->model_version : 0;
  }
  static bool serves(const Server& daemon, int version) {
    const auto session = session_with(daemon);
    client::CallContext context;
    context.cell = "cell-7";
    const auto until = std::chrono::steady_clock::now() + kLimit;
    while (std::chrono::steady_clock::now() < until) {
      const auto answer = session->predict_error(context, test::virtual_joints(1, 7));
      if (answer && answer->model.version == version) return true;
    }
    return false;
  }
  /// The reason that this program gives where it does not start.
  static std::string why_not(const Server& server, const std::string& program) {
    const auto ended = test::run(server.command_line(program));
    EXPECT_EQ(ended.exit_code, 3) << ended.err;
    return ended.err;
  }
  void put_in_force(const Server& by, int version) {
    client::ChangeOptions forced;
    forced.force = true;
    const auto done = session_with(by)->activate("cell-7", version, forced);
    ASSERT_TRUE(done) << sentence(done.error());
    EXPECT_TRUE(serves(first_, version) && serves(second_, version)) << version;
  }

  test::Postgres database_;
  const std::string url_ = database_.new_store();
  Server first_{0, url_}, second_{1, url_};
};

TEST_F(RollingUpdate, GoesFromServerToServerWhileBothProgramsTakeChangesTrainAndServe) {
  EXPECT_NE(why_not(first_, kNewer).find("trammel store init"), std::string::npos)
      << "the record comes first";
  first_.start(kOlder);
  second_.start(kOlder);
  ASSERT_EQ(made_from(first_, "b1", 1), 1);
  ASSERT_TRUE(serves(second_, 1));

  const auto brought = test::run({TRAMMEL_BINARY_DIR "/tests/trammel_next", "store", "init", url_});
  ASSERT_EQ(brought.exit_code, 0) << brought.err;
  EXPECT_EQ(database_.sql(url_, "SELECT version, works_from FROM trammel_schema"), "5|4\n");
  EXPECT_EQ(made_from(second_, "b2", 2), 2) << "who was there before goes on";

  first_.stop();
  first_.start(kNewer);
  EXPECT_EQ(made_from(first_, "b3", 3), 3) << "the newer one";
  EXPECT_EQ(made_from(second_, "b4", 4), 4) << "beside the older one";
  put_in_force(first_, 2);
  put_in_force(second_, 1);
  second_.stop();
  second_.start(kOlder);
  EXPECT_TRUE(serves(second_, 1)) << "the older one may start again: the update is not over";

  second_.stop();
  second_.start(kNewer);
  EXPECT_EQ(made_from(second_, "b5", 5), 5);
  put_in_force(second_, 3);
  EXPECT_EQ(test::run({TRAMMEL_BINARY_DIR "/clients/trammel", "audit", "--store", url_}).exit_code,
            0);

  // What a release says after that which needs it: older ones are let in no more.
  database_.sql(url_, "UPDATE trammel_schema SET works_from = 5");
  first_.stop();
  EXPECT_NE(why_not(first_, kOlder).find("newer than this program's"), std::string::npos);
}

}  // namespace
}  // namespace trammel
