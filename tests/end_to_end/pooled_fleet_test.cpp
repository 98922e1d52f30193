// Servers whose record is behind a pooler that shares connections by transaction: a longer run, in
// which all of them change something all the time.
#include <gtest/gtest.h>

#include <chrono>
#include <set>
#include <thread>

#include "server/base/text_file.h"
#include "tests/support/daemon.h"
#include "tests/support/pooler.h"
#include "tests/support/postgres.h"
#include "tests/support/process.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using std::chrono::seconds;
constexpr seconds kPooledFleetLimit{300};
constexpr int kBatches = 4, kDecisions = 16;  // of each server; a decision is judged first

class PooledFleet : public testing::Test {
 protected:
  PooledFleet() {
    for (test::Daemon* daemon : {&first_, &second_}) {
      std::string text = test::read_file(daemon->config_path());
      const std::string own = "store: trammel.db";
      text.replace(text.find(own), own.size(), "store: '" + pooler_.through(direct_) + "'");
      EXPECT_TRUE(write_text_file(daemon->config_path(), text));
      daemon->start();
    }
  }
  static std::unique_ptr<client::Session> session_with(const test::Daemon& daemon) {
    auto opened = client::Session::open(daemon.session_options());
    EXPECT_TRUE(opened) << sentence(opened.error());
    return std::move(*opened);
  }
  /// Batches and decisions by way of this server, and the jobs that the batches are.
  std::set<std::int64_t> change_all_the_time(const test::Daemon& daemon, std::uint64_t seed) {
    const auto session = session_with(daemon);
    client::ChangeOptions forced;
    forced.force = true;
    std::set<std::int64_t> jobs;
    for (int i = 0; i < kDecisions; ++i) {
      if (i % (kDecisions / kBatches) == 0 && jobs.size() < std::size_t{kBatches}) {
        const auto job = session->submit_measurements(
            "cell-7", fmt::format("{}-{}", seed, i),
            test::virtual_batch_csv(40, 100 * seed + static_cast<std::uint64_t>(i)));
        EXPECT_TRUE(job) << sentence(job.error());
        jobs.insert(job.value_or(0));
      }
      const auto decided = session->activate("cell-7", 1 + i % 2, forced);
      EXPECT_TRUE(decided) << sentence(decided.error());
    }
    return jobs;
  }
  static int served(client::Session& session) {
    client::CallContext context;
    context.cell = "cell-7";
    const auto answer = session.predict_error(context, test::virtual_joints(1, 7));
    return answer ? answer->model.version : 0;
  }

  test::Postgres database_;
  const std::string direct_ = database_.new_store();
  test::Pooler pooler_{database_};
  test::Daemon first_{0}, second_{1};
};

TEST_F(PooledFleet, ChangesAllTheTimeAndLosesNothing) {
  const auto session = session_with(first_), other = session_with(second_);
  for (const std::uint64_t seed : {1, 2}) {
    const auto job = session->submit_measurements("cell-7", fmt::format("b{}", seed),
                                                  test::virtual_batch_csv(60, seed));
    ASSERT_TRUE(job) << sentence(job.error());
    ASSERT_TRUE(session->wait_for_job(*job, kPooledFleetLimit, nullptr));
  }
  std::set<std::int64_t> jobs, of_second;
  {
    const std::jthread one([&] { jobs = change_all_the_time(first_, 3); });
    const std::jthread two([&] { of_second = change_all_the_time(second_, 4); });
  }
  jobs.merge(of_second);
  EXPECT_EQ(jobs.size(), std::size_t{2 * kBatches});
  for (const std::int64_t job : jobs) {
    const auto over = session->wait_for_job(job, kPooledFleetLimit, nullptr);
    ASSERT_TRUE(over) << sentence(over.error());
    EXPECT_GT(over->model_version, 0) << over->what;
  }
  const auto in_force = [&] {
    return std::stoi(
        database_.sql(direct_, "SELECT version FROM activations ORDER BY number DESC LIMIT 1"));
  };
  const auto until = std::chrono::steady_clock::now() + seconds(20);
  while ((served(*session) != in_force() || served(*other) != in_force()) &&
         std::chrono::steady_clock::now() < until)
    continue;
  EXPECT_EQ(served(*session), in_force());
  EXPECT_EQ(served(*other), in_force());
  EXPECT_EQ(database_.sql(direct_, "SELECT count(*) FROM batches"),
            fmt::format("{}\n", 2 + 2 * kBatches));
  EXPECT_EQ(
      test::run({TRAMMEL_BINARY_DIR "/clients/trammel", "audit", "--store", direct_}).exit_code, 0);
}

}  // namespace
}  // namespace trammel
