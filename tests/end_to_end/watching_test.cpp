// A real daemon, watched over HTTP.
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <deque>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "server/base/text_file.h"
#include "tests/support/daemon.h"
#include "tests/support/http_client.h"
#include "tests/support/stopped_thread.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using std::chrono::seconds;
constexpr seconds kWatchingLimit{30};

class WatchingTest : public testing::Test {
 protected:
  void SetUp() override {
    write_config("");
    daemon_.start();
  }
  /// The daemon's file with more sections.
  void write_config(const std::string& more, const std::string& log = "log: {level: debug}\n") {
    if (original_.empty()) original_ = test::read_file(daemon_.config_path());
    std::string text = original_.substr(0, original_.find("log:"));
    ASSERT_TRUE(write_text_file(
        daemon_.config_path(), fmt::format("{}{}http: {{port: {}}}\n{}", text, log, port(), more)));
  }
  [[nodiscard]] std::uint16_t port() const {
    return static_cast<std::uint16_t>(daemon_.port() + 1);
  }
  [[nodiscard]] test::HttpAnswer get(const std::string& path) const {
    return test::http_get(port(), path);
  }
  /// The value of the first series that begins so; -1: there is none.
  [[nodiscard]] double metric(const std::string& beginning) const {
    const std::string text = "\n" + get("/metrics").body;
    const std::size_t at = text.find("\n" + beginning);
    if (at == std::string::npos) return -1;
    const std::size_t end = text.find('\n', at + 1);
    return std::stod(text.substr(text.rfind(' ', end) + 1));
  }

  std::string original_;
  test::Daemon daemon_;
};

TEST_F(WatchingTest, MetricsReadinessAndPagesFollowACellFromItsFirstBatchOn) {
  EXPECT_EQ(get("/healthz").code, 200);
  const auto dark = get("/readyz");
  EXPECT_EQ(dark.code, 503);
  EXPECT_EQ(nlohmann::json::parse(dark.body)["dark"][0]["state"], "untrained");

  auto session = client::Session::open(daemon_.session_options());
  ASSERT_TRUE(session) << session.error().message;
  client::CallContext context;
  context.cell = "cell-7";
  EXPECT_FALSE((*session)->predict_error(context, test::virtual_joints(1, 7)))
      << "there is no model";
  const auto job =
      (*session)->submit_measurements("cell-7", "lt-07", test::virtual_batch_csv(40, 1));
  ASSERT_TRUE(job) << job.error().message;
  ASSERT_TRUE((*session)->wait_for_job(*job, seconds(120), nullptr));
  ASSERT_TRUE((*session)->predict_error(context, test::virtual_joints(3, 7)));

  EXPECT_EQ(get("/readyz").code, 200) << get("/readyz").body;
  EXPECT_EQ(get("/readyz?cell=cell-7").code, 200);
  EXPECT_EQ(get("/readyz?cell=cell-9").code, 503);
  EXPECT_GE(metric("trammel_requests_total{operation=\"PredictError\",result=\"not_found\"}"), 1);
  EXPECT_GE(metric("trammel_requests_total{operation=\"PredictError\",result=\"ok\"}"), 1);
  EXPECT_GE(metric("trammel_request_seconds_count{operation=\"SubmitMeasurements\"}"), 1);
  EXPECT_EQ(metric("trammel_poses_asked_total{cell=\"cell-7\",domain=\"inside\"}") +
                metric("trammel_poses_asked_total{cell=\"cell-7\",domain=\"outside\"}"),
            3);
  EXPECT_EQ(metric("trammel_promised_stddev_mm_count{cell=\"cell-7\"}"), 3);
  EXPECT_GT(metric("trammel_promised_stddev_mm_sum{cell=\"cell-7\"}"), 0);
  EXPECT_EQ(metric("trammel_targets_left_total{cell=\"cell-7\"}"), 0);
  EXPECT_EQ(metric("trammel_jobs_ended_total{verdict=\"in_force\"}"), 1);
  EXPECT_EQ(metric("trammel_cell_ready{cell=\"cell-7\",state=\"served\"}"), 1);
  EXPECT_GT(metric("trammel_store_bytes"), 10000);
  EXPECT_NE(get("/").body.find("its check by"), std::string::npos) << get("/").body;
  EXPECT_NE(get("/cells/cell-7/models/1").body.find("lt-07"), std::string::npos);
  EXPECT_EQ(get("/nothing").code, 404);
  EXPECT_EQ(daemon_.stop(), 0) << daemon_.process().standard_error();
}

TEST_F(WatchingTest, TwoHundredSlowConnectionsThatRenewThemselvesKeepNoWatcherFromItsAnswer) {
  const std::size_t threads = test::threads_of(daemon_.process().pid()).size();
  std::deque<test::OpenConnection> slow;
  for (int round = 0; round < 20; ++round) {
    for (int i = 0; i < 200; ++i) {
      slow.emplace_back(port()).send("GET /metr");
      if (slow.size() > 200) slow.pop_front();
    }
    for (const auto& one : slow) one.send("i");
    EXPECT_EQ(get("/healthz").code, 200) << round;
    EXPECT_EQ(nlohmann::json::parse(get("/readyz").body)["state"], "dark") << round;
    EXPECT_EQ(get("/metrics").code, 200) << round;
  }
  EXPECT_LE(test::threads_of(daemon_.process().pid()).size(), threads + 2);
  EXPECT_GE(metric("trammel_http_shed_total"), 1000) << "so many were slow at the same time";
  EXPECT_GT(metric("process_open_fds"), 0);
  EXPECT_LT(metric("process_open_fds"), 200);
}

TEST_F(WatchingTest, AWorkerThatHangsIsToldBeforeTheDaemonEnds) {
  pid_t status = 0;
  // A thread has its name some moments after the daemon is ready.
  for (const auto until = std::chrono::steady_clock::now() + kWatchingLimit;
       status == 0 && std::chrono::steady_clock::now() < until;) {
    for (const test::ThreadOf& thread : test::threads_of(daemon_.process().pid()))
      if (thread.name == "status") status = thread.id;
  }
  ASSERT_NE(status, 0);
  EXPECT_EQ(get("/healthz").code, 200);
  test::StoppedThread stopped(status);
  ASSERT_TRUE(stopped.is_stopped());
  bool told = false;
  const auto until = std::chrono::steady_clock::now() + kWatchingLimit;
  while (std::chrono::steady_clock::now() < until) {
    const auto health = get("/healthz");
    if (health.code == 0) break;  // it has ended
    if (health.code != 503 || health.body.find("\"status\"") == std::string::npos) continue;
    told = true;
    const auto ready = get("/readyz");
    if (ready.code != 0) {
      EXPECT_EQ(ready.code, 503);
    }
    break;
  }
  EXPECT_TRUE(told);
  EXPECT_TRUE(daemon_.process().wait_for_line("ends at once", kWatchingLimit))
      << daemon_.process().standard_error();
  stopped.bury();
  EXPECT_EQ(daemon_.process().wait(kWatchingLimit), 70);
}

TEST_F(WatchingTest, AReloadTakesOnWhatCanChangeAndAFileThatIsRefusedChangesNothing) {
  EXPECT_FALSE(daemon_.process().wait_for_line("\"event\"", std::chrono::milliseconds(1)));
  write_config("trainer: {queue_capacity: 3, max_poses: 4000}\n",
               "log: {level: debug, format: json}\n");
  daemon_.process().signal(SIGHUP);
  ASSERT_TRUE(daemon_.process().wait_for_line("\"event\":\"reloaded\"", kWatchingLimit))
      << daemon_.process().standard_error();
  const std::string said = daemon_.process().standard_error();
  EXPECT_NE(said.find("log: format, trainer: queue_capacity"), std::string::npos) << said;
  EXPECT_NE(said.find("trainer: max_poses changes with the next start only"), std::string::npos)
      << said;

  write_config("trainr: {}\n", "log: {level: wran, format: text}\n");
  daemon_.process().signal(SIGHUP);
  ASSERT_TRUE(daemon_.process().wait_for_line("everything stays as it was", kWatchingLimit));
  EXPECT_TRUE(daemon_.process().wait_for_line("did you mean warn", kWatchingLimit))
      << daemon_.process().standard_error();
  const std::string last = daemon_.process().standard_error();
  EXPECT_EQ(last.find('{', last.rfind('\n', last.size() - 2) + 1),
            last.rfind('\n', last.size() - 2) + 1)
      << "still JSON";
  EXPECT_EQ(get("/healthz").code, 200);
  EXPECT_EQ(daemon_.stop(), 0);
}

/// Its server file names other cells while it serves.
class ReloadOfCellsTest : public testing::Test {
 protected:
  void SetUp() override {
    server_file_ = test::read_file(daemon_.config_path());
    cell_file_ = test::read_file(file("cell-7.yaml"));
    std::string cell_8 = cell_file_;
    cell_8.replace(cell_8.find("cell: cell-7"), 12, "cell: cell-8");
    ASSERT_TRUE(write_text_file(file("cell-8.yaml"), cell_8));
    daemon_.start();
    session_ = open_session();
    learn("cell-7", "lt-07");
  }
  [[nodiscard]] std::string file(const std::string& name) const {
    return std::filesystem::path(daemon_.config_path()).replace_filename(name);
  }
  [[nodiscard]] std::unique_ptr<client::Session> open_session() const {
    auto opened = client::Session::open(daemon_.session_options());
    EXPECT_TRUE(opened) << sentence(opened.error());
    return std::move(*opened);
  }
  void name_cells(const std::string& cells) {
    std::string text = server_file_;
    text.replace(text.find("[cell-7.yaml]"), 13, cells);
    ASSERT_TRUE(write_text_file(daemon_.config_path(), text));
  }
  /// The server file names these cells from now on; until the daemon says `line` of it.
  void reload(const std::string& cells, const std::string& line) {
    name_cells(cells);
    daemon_.process().signal(SIGHUP);
    ASSERT_TRUE(daemon_.process().wait_for_line(line, kWatchingLimit))
        << daemon_.process().standard_error();
  }
  void learn(const std::string& cell, const std::string& batch) {
    const auto job = session_->submit_measurements(cell, batch, test::virtual_batch_csv(40, 1));
    ASSERT_TRUE(job) << sentence(job.error());
    const auto over = session_->wait_for_job(*job, seconds(120), nullptr);
    ASSERT_TRUE(over) << sentence(over.error());
    ASSERT_EQ(over->stage, "done") << over->what;
  }
  /// The version of the model that answers; 0: none does.
  [[nodiscard]] static int version(client::Session& session, const std::string& cell) {
    client::CallContext context;
    context.cell = cell;
    const auto answer = session.predict_error(context, test::virtual_joints(3, 7));
    return answer ? answer->model.version : 0;
  }
  [[nodiscard]] std::string status() const {
    const auto said =
        test::run({TRAMMEL_BINARY_DIR "/clients/trammel", "status", "--port",
                   std::to_string(daemon_.port()), "--domain", std::to_string(daemon_.domain())});
    EXPECT_EQ(said.exit_code, 0) << said.err;
    return said.out;
  }

  std::string server_file_, cell_file_;
  test::Daemon daemon_;
  std::unique_ptr<client::Session> session_;
};

TEST_F(ReloadOfCellsTest, ANewCellIsServedAtOnceAndWhoAsksForTheOthersLosesNothing) {
  std::atomic<int> answered = 0, lost = 0;
  std::jthread asks([&, other = open_session()](const std::stop_token& stop) {
    while (!stop.stop_requested()) ++(version(*other, "cell-7") == 1 ? answered : lost);
  });
  EXPECT_EQ(status().find("cell-8"), std::string::npos);
  reload("[cell-7.yaml, cell-8.yaml]", "taken on: cells: cell-8");
  EXPECT_NE(status().find("cell-8"), std::string::npos) << status();
  EXPECT_EQ(version(*session_, "cell-8"), 0) << "there is no model";
  learn("cell-8", "lt-08");
  EXPECT_EQ(version(*session_, "cell-8"), 1);
  asks = {};
  EXPECT_GT(answered, 100);
  EXPECT_EQ(lost, 0);
  EXPECT_EQ(daemon_.stop(), 0);
}

TEST_F(ReloadOfCellsTest, ACellThatIsLeftOutIsServedUntilTheNextStartAndComesBackWithItsModel) {
  reload("[cell-8.yaml]", "cells: cell-7 (left out) changes with the next start only");
  ASSERT_TRUE(daemon_.process().wait_for_line("taken on: cells: cell-8", kWatchingLimit));
  EXPECT_EQ(version(*session_, "cell-7"), 1);
  EXPECT_EQ(daemon_.stop(), 0);
  daemon_.start();
  session_ = open_session();
  EXPECT_EQ(version(*session_, "cell-7"), 0);
  reload("[cell-8.yaml, cell-7.yaml]", "taken on: cells: cell-7");
  EXPECT_EQ(version(*session_, "cell-7"), 1);
  EXPECT_EQ(daemon_.stop(), 0);
}

TEST_F(ReloadOfCellsTest,
       ABrokenCellFileIsNamedAndChangesNothingAndAChangedOneComesWithTheNextStart) {
  ASSERT_TRUE(
      write_text_file(file("cell-9.yaml"), "version: 1\ncell: cell-9\nrobot: nowhere.yaml\n"));
  reload("[cell-7.yaml, cell-8.yaml, cell-9.yaml]", "everything stays as it was");
  EXPECT_TRUE(daemon_.process().wait_for_line("nowhere.yaml", kWatchingLimit))
      << daemon_.process().standard_error();
  EXPECT_EQ(status().find("cell-8"), std::string::npos);
  EXPECT_EQ(version(*session_, "cell-7"), 1);
  ASSERT_TRUE(write_text_file(file("cell-7.yaml"), cell_file_ + "# moved\n"));
  reload("[cell-7.yaml]", "cells: cell-7 (its file) changes with the next start only");
  EXPECT_EQ(version(*session_, "cell-7"), 1);
  EXPECT_EQ(daemon_.stop(), 0);
}

TEST_F(WatchingTest, ACellThatIsAddedWhileItServesHasItsPageItsReadinessAndItsFigures) {
  EXPECT_EQ(get("/cells/cell-8").code, 404);
  const std::filesystem::path server_file = daemon_.config_path();
  std::string cell =
      test::read_file(std::filesystem::path(server_file).replace_filename("cell-7.yaml"));
  cell.replace(cell.find("cell: cell-7"), 12, "cell: cell-8");
  ASSERT_TRUE(
      write_text_file(std::filesystem::path(server_file).replace_filename("cell-8.yaml"), cell));
  original_.replace(original_.find("[cell-7.yaml]"), 13, "[cell-7.yaml, cell-8.yaml]");
  write_config("");
  daemon_.process().signal(SIGHUP);
  ASSERT_TRUE(daemon_.process().wait_for_line("taken on: cells: cell-8", kWatchingLimit))
      << daemon_.process().standard_error();
  EXPECT_EQ(get("/cells/cell-8").code, 200);
  EXPECT_NE(get("/").body.find("cell-8"), std::string::npos);
  const auto ready = get("/readyz?cell=cell-8");
  EXPECT_EQ(ready.code, 503);
  EXPECT_NE(ready.body.find("untrained"), std::string::npos) << ready.body;
  EXPECT_EQ(metric("trammel_cell_ready{cell=\"cell-8\""), 0);
}

TEST_F(WatchingTest, InJsonEachFactIsALineThatSaysWhoAskedAndUnderWhichTrace) {
  EXPECT_EQ(daemon_.stop(), 0);
  write_config("", "log: {level: debug, format: json}\n");
  daemon_.start();
  auto session = client::Session::open(daemon_.session_options());
  ASSERT_TRUE(session) << session.error().message;
  EXPECT_FALSE((*session)->submit_measurements("cell-9", "b1", "q1_deg\n"));
  ASSERT_TRUE(daemon_.process().wait_for_line("request_refused", kWatchingLimit))
      << daemon_.process().standard_error();
  EXPECT_EQ(daemon_.stop(), 0);
  std::istringstream lines(daemon_.process().standard_error());
  bool refused = false;
  for (std::string line; std::getline(lines, line);) {
    const auto fact = nlohmann::json::parse(line, nullptr, false);
    ASSERT_TRUE(fact.is_object()) << line;
    EXPECT_TRUE(fact.contains("time") && fact.contains("level") && fact.contains("event")) << line;
    if (fact["event"] != "request_refused") continue;
    refused = true;
    EXPECT_EQ(fact["operation"], "SubmitMeasurements");
    EXPECT_EQ(fact["cell"], "cell-9");
    EXPECT_EQ(fact["result"], "not_found");
    EXPECT_EQ(fact["who"].get<std::string>().size(), 24u) << line;
    EXPECT_TRUE(fact["request"].get<std::string>().starts_with(fact["who"].get<std::string>()))
        << line;
    EXPECT_FALSE(fact["trace"].get<std::string>().empty()) << line;
  }
  EXPECT_TRUE(refused);
}

TEST_F(WatchingTest, ARealPrometheusScrapesTheDaemonAndTakesTheShippedRules) {
  if (test::run({"/bin/sh", "-c", "command -v prometheus"}).exit_code != 0)
    GTEST_SKIP() << "Prometheus is not there (package prometheus)";
  const test::TemporaryFolder folder;
  const std::string shipped = TRAMMEL_SOURCE_DIR "/deploy/watching/";
  folder.write("alerts.yml", test::read_file(shipped + "alerts.yml"));
  std::string config = test::read_file(shipped + "prometheus.yml");
  config.replace(config.rfind("9464"), 4, std::to_string(port()));
  config.replace(config.find("15s"), 3, "1s");
  folder.write("prometheus.yml", config);
  const auto listens = static_cast<std::uint16_t>(port() + 1);
  test::Process prometheus({"/usr/bin/env", "prometheus",
                            "--config.file=" + folder.file("prometheus.yml"),
                            "--storage.tsdb.path=" + folder.file("data"),
                            fmt::format("--web.listen-address=127.0.0.1:{}", listens)});
  const auto answer = [&](const std::string& query) {
    const auto body = nlohmann::json::parse(
        test::http_get(listens, "/api/v1/query?query=" + query).body, nullptr, false);
    return body.is_object() ? body["data"]["result"] : nlohmann::json::array();
  };
  const auto until = std::chrono::steady_clock::now() + seconds(60);
  while (answer("trammel_cell_ready").empty() && std::chrono::steady_clock::now() < until) continue;
  const auto ready = answer("trammel_cell_ready");
  ASSERT_EQ(ready.size(), 1u) << prometheus.standard_error();
  EXPECT_EQ(ready[0]["metric"]["state"], "untrained");
  EXPECT_EQ(ready[0]["value"][1], "0");
  EXPECT_EQ(answer("up")[0]["value"][1], "1");
  const std::string rules = test::http_get(listens, "/api/v1/rules").body;
  EXPECT_NE(rules.find("TrammelCellIsDark"), std::string::npos) << rules;
}

/// Where a manager of services listens.
class ManagerSocket {
 public:
  ManagerSocket()
      : path_(folder_.file("notify")), socket_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un to{};
    to.sun_family = AF_UNIX;
    path_.copy(to.sun_path, sizeof(to.sun_path) - 1);
    EXPECT_EQ(::bind(socket_, reinterpret_cast<const sockaddr*>(&to), sizeof(to)), 0);
  }
  ~ManagerSocket() { ::close(socket_); }
  ManagerSocket(const ManagerSocket&) = delete;
  ManagerSocket& operator=(const ManagerSocket&) = delete;

  /// Until it hears something with this in it.
  [[nodiscard]] bool hears(const std::string& what) {
    const auto until = std::chrono::steady_clock::now() + kWatchingLimit;
    while (std::chrono::steady_clock::now() < until) {
      pollfd look{socket_, POLLIN, 0};
      if (::poll(&look, 1, 200) <= 0) continue;
      std::array<char, 4096> text{};
      const ssize_t size = ::recv(socket_, text.data(), text.size(), 0);
      if (size > 0 &&
          std::string(text.data(), static_cast<std::size_t>(size)).find(what) != std::string::npos)
        return true;
    }
    return false;
  }
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  test::TemporaryFolder folder_;
  const std::string path_;
  const int socket_;
};

TEST(ServiceManagerTest, ItIsToldWhatTheDaemonDoesFromItsStartToItsEnd) {
  ManagerSocket manager;
  test::Daemon daemon;
  std::vector<std::string> command = {"/usr/bin/env", "NOTIFY_SOCKET=" + manager.path(),
                                      "WATCHDOG_USEC=1500000"};
  for (const std::string& word : daemon.command_line()) command.push_back(word);
  test::Process process(command);
  EXPECT_TRUE(manager.hears("READY=1"));
  EXPECT_TRUE(manager.hears("WATCHDOG=1"));
  process.signal(SIGHUP);
  EXPECT_TRUE(manager.hears("RELOADING=1"));
  EXPECT_TRUE(manager.hears("READY=1"));
  process.signal(SIGTERM);
  EXPECT_TRUE(manager.hears("STOPPING=1"));
  EXPECT_EQ(process.wait(kWatchingLimit), 0) << process.standard_error();
}

TEST(SupervisedReloadTest, ASupervisorPassesTheRequestOnAndGoesOnSupervising) {
  const test::Daemon daemon;
  std::vector<std::string> command = {TRAMMEL_SOURCE_DIR "/deploy/supervise"};
  for (const std::string& word : daemon.command_line()) command.push_back(word);
  test::Process supervisor(command);
  ASSERT_TRUE(supervisor.wait_for_line("ready", kWatchingLimit)) << supervisor.standard_error();
  supervisor.signal(SIGHUP);
  EXPECT_TRUE(supervisor.wait_for_line("read again", kWatchingLimit))
      << supervisor.standard_error();
  supervisor.signal(SIGTERM);
  EXPECT_EQ(supervisor.wait(kWatchingLimit), 0) << supervisor.standard_error();
  EXPECT_NE(supervisor.standard_error().find("after SIGTERM; not started again"),
            std::string::npos);
}

TEST(DaemonCheckTest, TheCellsThatWouldGoDarkAreNamedAlsoWhileTheServiceRuns) {
  test::Daemon daemon;
  daemon.start();
  {
    auto session = client::Session::open(daemon.session_options());
    ASSERT_TRUE(session) << session.error().message;
    const auto job =
        (*session)->submit_measurements("cell-7", "lt-07", test::virtual_batch_csv(40, 1));
    ASSERT_TRUE(job) << job.error().message;
    ASSERT_TRUE((*session)->wait_for_job(*job, seconds(120), nullptr));
  }
  std::vector<std::string> command = daemon.command_line();
  command.emplace_back("--check");
  EXPECT_EQ(test::run(command).exit_code, 0);
  const std::string cell_file =
      std::filesystem::path(daemon.config_path()).replace_filename("cell-7.yaml");
  std::string cell = test::read_file(cell_file);
  const std::string tool = "xyz_mm: [100, 0, 150]";
  ASSERT_NE(cell.find(tool), std::string::npos) << cell;
  cell.replace(cell.find(tool), tool.size(), "xyz_mm: [140, 0, 150]");
  ASSERT_TRUE(write_text_file(cell_file, cell));
  const test::Finished checked = test::run(command);
  EXPECT_EQ(checked.exit_code, 1) << checked.err;
  EXPECT_NE(checked.err.find("cell cell-7 would go dark"), std::string::npos) << checked.err;
  EXPECT_EQ(daemon.stop(), 0);
}

TEST(DaemonBackupTest, ACopyThatIsMadeWhileTheDaemonServesServesTheSameModelElsewhere) {
  test::Daemon daemon;
  daemon.start();
  const auto answer = [&daemon]() -> std::string {
    auto session = client::Session::open(daemon.session_options());
    EXPECT_TRUE(session) << session.error().message;
    const auto text = (*session)->export_model("cell-7", 0);
    EXPECT_TRUE(text) << text.error().message;
    return text.value_or("");
  };
  {
    auto session = client::Session::open(daemon.session_options());
    ASSERT_TRUE(session) << session.error().message;
    const auto job =
        (*session)->submit_measurements("cell-7", "lt-07", test::virtual_batch_csv(40, 1));
    ASSERT_TRUE(job) << job.error().message;
    ASSERT_TRUE((*session)->wait_for_job(*job, seconds(120), nullptr));
  }
  const std::string before = answer();
  const test::TemporaryFolder folder;
  const test::Finished copied =
      test::run({TRAMMEL_BINARY_DIR "/clients/trammel", "backup", "--store", daemon.store_path(),
                 "-o", folder.file("copy.db"), "--json", "-"});
  ASSERT_EQ(copied.exit_code, 0) << copied.err;
  EXPECT_EQ(nlohmann::json::parse(copied.out)["models"], 1);
  EXPECT_EQ(test::run({TRAMMEL_BINARY_DIR "/clients/trammel", "backup", "--check",
                       folder.file("copy.db")})
                .exit_code,
            0);
  EXPECT_EQ(answer(), before) << "it serves on";
  EXPECT_EQ(daemon.stop(), 0);
  std::filesystem::remove_all(daemon.store_path() + ".models");
  std::filesystem::remove(daemon.store_path());
  std::filesystem::rename(folder.file("copy.db"), daemon.store_path());
  daemon.start();
  EXPECT_EQ(answer(), before) << "bit for bit";
  EXPECT_EQ(daemon.stop(), 0);
}

}  // namespace
}  // namespace trammel
