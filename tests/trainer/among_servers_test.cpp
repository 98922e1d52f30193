// What a trainer does where another server has the same record: what it reads of it, and when it
// takes a job.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <map>
#include <mutex>

#include "server/base/hash.h"
#include "server/store/store_describe.h"
#include "server/trainer/trainer.h"
#include "tests/support/demand.h"
#include "tests/support/postgres.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

using test::demand;

constexpr std::chrono::seconds kLimit{60};

/// A trainer of cell-7, and another server of the same record, played by the test.
class AmongServers : public testing::Test {
 protected:
  static void SetUpTestSuite() { test::Postgres::of_program(); }
  AmongServers() {
    postgres_.write_down(url_);
    other_ = open("other");
    own_ = open("own");
    TrainerOptions options;
    options.self = ServerSelf::here("0.1.0", true, true);
    trainer_ = std::make_unique<Trainer>(cells_, *own_, registry_, options);
    trainer_->set_listeners([this](const JobProgress& progress) { heard(progress); }, nullptr);
  }
  std::unique_ptr<Store> open(const std::string& server) {
    auto store = demand(Store::open(url_, folder_.file(server)));
    store->works_as(server);
    return store;
  }
  /// By the other server.
  std::int64_t submit(const std::string& cell, const std::string& id) {
    const std::string csv = test::small_batch_csv(*cells_.at("cell-7"), {.seed = ++seed_});
    StoredJob job;
    job.cell = cell;
    job.batch_ids = {id};
    return demand(other_->add_batch(
                      {cell, id, csv, sha256_hex(csv), "client:" + id, 1700000000, 40}, job))
        .id;
  }
  void heard(const JobProgress& progress) {
    if (progress.stage != JobStage::kDone && progress.stage != JobStage::kFailed) return;
    const std::lock_guard lock(mutex_);
    finished_[progress.job] = progress;
    changed_.notify_all();
  }
  bool is_finished(std::int64_t job) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, kLimit, [&] { return finished_.contains(job); });
  }
  static std::ptrdiff_t count(const std::vector<std::string>& asked, const std::string& part) {
    return std::count_if(asked.begin(), asked.end(), [&](const std::string& one) {
      return one.find(part) != std::string::npos;
    });
  }

  test::Postgres& postgres_ = test::Postgres::of_program();
  const std::string url_ = postgres_.new_store();
  test::TemporaryFolder folder_;
  const ServedCells cells_ = {{"cell-7", test::small_cell("cell-7")}};
  std::unique_ptr<Store> other_, own_;
  ModelRegistry registry_;
  std::uint64_t seed_ = 0;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::int64_t, JobProgress> finished_;  // guarded by mutex_
  std::unique_ptr<Trainer> trainer_;
};

TEST_F(AmongServers, JobsOfCellsThatAreNotServedHereAreNotReadWhateverChanges) {
  for (int i = 0; i < 30; ++i) submit("cell-9", std::to_string(i));
  static_cast<void>(demand(trainer_->start()));
  ASSERT_TRUE(is_finished(submit("cell-7", "first"))) << "it has taken up what there was";
  static_cast<void>(postgres_.asked());
  ASSERT_TRUE(is_finished(submit("cell-7", "second")));
  EXPECT_LT(count(postgres_.asked(), "LEFT JOIN job_outcomes"), 30);
}

TEST_F(AmongServers, OfACellThatAnotherServerWorksForOneJobIsTriedAndTheOthersWaitUntilThatIsOver) {
  std::vector<std::int64_t> jobs;
  for (int i = 0; i < 20; ++i) jobs.push_back(submit("cell-7", std::to_string(i)));
  ASSERT_TRUE(other_->set_job_running(jobs.front()));
  static_cast<void>(demand(trainer_->take_up()));
  static_cast<void>(postgres_.asked());
  static_cast<void>(demand(trainer_->start()));
  while (trainer_->queued_jobs() > 0) continue;
  EXPECT_LT(
      count(postgres_.asked(), "job_claims JOIN jobs ON jobs.id = job_claims.job WHERE jobs.cell"),
      10)
      << "it asked whether the cell is free";
  ASSERT_TRUE(other_->set_job_failed(jobs.front(), "over"));
  for (const std::int64_t job : jobs) EXPECT_TRUE(is_finished(job));
}

TEST_F(AmongServers, AJobOfACellThatTheRecordDescribesOtherwiseNowIsLeftToOthersAtOnce) {
  static_cast<void>(demand(trainer_->take_up()));
  ServerSelf self = trainer_->self();
  self.host = "another";
  self.cells["cell-7"].files.robot = "another";
  ASSERT_TRUE(other_->tell_presence(self));
  const std::int64_t job = submit("cell-7", "first");
  std::atomic<bool> begun = false, is_apart = false;
  // It begins, and hears only then that the record goes by other files.
  trainer_->set_listeners(
      [&](const JobProgress& progress) {
        if (progress.stage != JobStage::kTraining || begun.exchange(true)) return;
        EXPECT_TRUE(describe_cell(url_, "cell-7", "other", "anna"));
        const auto until = std::chrono::steady_clock::now() + kLimit;
        while (!trainer_->cell_troubles().contains("cell-7") &&
               std::chrono::steady_clock::now() < until)
          continue;
        is_apart = true;
      },
      nullptr);
  static_cast<void>(demand(trainer_->start()));
  const auto until = std::chrono::steady_clock::now() + kLimit;
  while (!is_apart || demand(other_->job(job)).state != JobState::kQueued)
    ASSERT_LT(std::chrono::steady_clock::now(), until);
  EXPECT_EQ(demand(other_->job(job)).attempts, 0) << "it was not the job's fault";
  EXPECT_TRUE(other_->set_job_running(job)) << "nobody waits for the end of a lease";
}

}  // namespace
}  // namespace trammel
