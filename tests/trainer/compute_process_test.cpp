// Jobs that are computed in a process of their own: what a job makes is the same there, and what
// happens to that process happens to nobody else.
#include "server/trainer/compute/compute_process.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <signal.h>
#include <sqlite3.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>

#include "server/trainer/trainer.h"
#include "tests/support/computing_child.h"
#include "tests/support/demand.h"
#include "tests/support/faulty_disk.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

constexpr std::chrono::seconds kComputeProcessLimit{120};
constexpr const char* kSlowBias =
    "se * periodic + matern52 * linear + rational_quadratic + se(sincos)";

bool is_over(const JobProgress& progress) {
  return progress.stage == JobStage::kDone || progress.stage == JobStage::kFailed;
}

class ComputeProcessTest : public testing::Test {
 protected:
  ComputeProcessTest() {
    options_.compute.program = test::compute_program();
    open();
  }
  ~ComputeProcessTest() override { close(); }

  void open() {
    store_ = test::demand(Store::open(folder_.file("trammel.db")));
    registry_ = std::make_unique<ModelRegistry>();
    trainer_ = std::make_unique<Trainer>(cells_, *store_, *registry_, options_);
    trainer_->set_listeners([this](const JobProgress& progress) { heard(progress); }, nullptr);
  }
  void start() { static_cast<void>(test::demand(trainer_->start())); }
  void close() {
    trainer_.reset();
    store_.reset();
  }
  void open_anew() {
    close();
    open();
  }
  void heard(const JobProgress& progress) {
    std::function<void(const JobProgress&)> first;
    {
      const std::lock_guard lock(mutex_);
      reports_.push_back(progress);
      first = on_report_;
    }
    changed_.notify_all();
    if (first) first(progress);
  }
  /// The first report that `wanted` accepts.
  template <typename Wanted>
  JobProgress wait_for(const Wanted& wanted) {
    std::unique_lock lock(mutex_);
    const auto found = [&] { return std::find_if(reports_.begin(), reports_.end(), wanted); };
    if (!changed_.wait_for(lock, kComputeProcessLimit, [&] { return found() != reports_.end(); })) {
      ADD_FAILURE() << "the awaited report did not come";
      return {};
    }
    return *found();
  }
  JobProgress finished(std::int64_t job) {
    return wait_for([job](const JobProgress& p) { return p.job == job && is_over(p); });
  }
  std::string csv(const test::SmallBatch& batch = {}) {
    return test::small_batch_csv(*cells_.at("cell-7"), batch);
  }
  std::int64_t submit(const std::string& id, const test::SmallBatch& batch = {}) {
    return test::demand(trainer_->submit("cell-7", id, csv(batch), "client:" + id));
  }
  /// A training that takes longer than any test, and is computed by now.
  std::int64_t long_job() {
    finished(submit("large", {.poses = 900}));
    const std::int64_t job = test::demand(trainer_->retrain("cell-7", {"large"}, "", kSlowBias));
    wait_for([job](const JobProgress& p) {
      return p.job == job && p.stage == JobStage::kTraining && p.share > 0;
    });
    return job;
  }
  pid_t child() {
    const auto pid = test::computing_child(::getpid());
    if (!pid) throw std::runtime_error("nothing is computed");
    return *pid;
  }
  /// Sends the signal to each process that begins to compute the job.
  void whenever_computed(std::int64_t job, int signal, int most) {
    const std::lock_guard lock(mutex_);
    on_report_ = [job, signal, left = std::make_shared<int>(most)](const JobProgress& p) {
      if (p.job != job || p.stage != JobStage::kTraining || p.what.empty() || *left == 0) return;
      const auto pid = test::computing_child(::getpid());
      if (!pid) return;
      --*left;
      ::kill(*pid, signal);
    };
  }

  test::TemporaryFolder folder_;
  ServedCells cells_ = {{"cell-7", test::small_cell("cell-7")}};
  TrainerOptions options_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<JobProgress> reports_;                   // guarded by mutex_
  std::function<void(const JobProgress&)> on_report_;  // guarded by mutex_; called without it
  std::optional<test::FaultyDisk> disk_;
  std::unique_ptr<Store> store_;
  std::unique_ptr<ModelRegistry> registry_;
  std::unique_ptr<Trainer> trainer_;
};

/// What jobs of every kind make, without the times they were made at.
struct All {
  std::vector<std::string> hashes, messages;
  std::string findings;
};

class SameResults : public ComputeProcessTest {
 protected:
  All all_made() {
    start();
    finished(submit("a", {.poses = 120}));
    finished(submit("b", {.poses = 120, .noise = 10e-6, .seed = 2}));
    finished(test::demand(trainer_->retrain("cell-7", {"a", "b"}, "", "se + matern32")));
    finished(test::demand(trainer_->retrain("cell-7", {"a"}, "M0", "auto")));
    const std::int64_t diagnosis = test::demand(trainer_->diagnose("cell-7", "a", "", true));
    finished(diagnosis);
    finished(submit("strange", {.poses = 120, .noise = 3e-3, .seed = 5}));
    All all;
    const auto models = test::demand(store_->models("cell-7"));
    for (const StoredModel& model : models) all.hashes.push_back(model.hash);
    for (std::int64_t job = 1; job <= 6; ++job) all.messages.push_back(store_->job(job)->message);
    all.findings = store_->diagnosis(diagnosis)->findings;
    return all;
  }
};

TEST_F(SameResults, WhatIsComputedInAProcessOfItsOwnIsBitForBitWhatIsComputedHere) {
  const All apart = all_made();
  close();
  reports_.clear();
  std::filesystem::remove_all(folder_.path());
  std::filesystem::create_directories(folder_.path());
  options_.compute.program.clear();
  open();
  const All here = all_made();
  ASSERT_GE(apart.hashes.size(), 4u);
  EXPECT_EQ(apart.hashes, here.hashes);
  EXPECT_EQ(apart.messages, here.messages);
  EXPECT_TRUE(apart.findings == here.findings);
}

TEST_F(ComputeProcessTest, ACrashIsToldAndTheJobIsTriedAgain) {
  start();
  finished(submit("a", {.poses = 200}));
  const std::int64_t job = 2;
  whenever_computed(job, SIGKILL, 1);
  ASSERT_EQ(test::demand(trainer_->retrain("cell-7", {"a"}, "", "se + matern32")), job);
  const JobProgress told = wait_for([](const JobProgress& p) {
    return p.job == 2 && p.stage == JobStage::kQueued && !p.what.empty();
  });
  EXPECT_NE(told.what.find("signal 9"), std::string::npos) << told.what;
  EXPECT_EQ(finished(job).stage, JobStage::kDone);
  EXPECT_EQ(store_->job(job)->attempts, 2);
}

TEST_F(ComputeProcessTest, AJobThatCrashesThreeTimesFailsAndTheNextOneIsComputed) {
  start();
  finished(submit("a", {.poses = 200}));
  whenever_computed(2, SIGSEGV, 3);
  ASSERT_EQ(test::demand(trainer_->retrain("cell-7", {"a"}, "", "se + matern32")), 2);
  const JobProgress failed = finished(2);
  EXPECT_EQ(failed.stage, JobStage::kFailed);
  EXPECT_EQ(failed.outcome.verdict, JobVerdict::kBroken);
  EXPECT_EQ(failed.outcome.code, ErrorCode::kInternal);
  EXPECT_NE(failed.what.find("signal 11"), std::string::npos) << failed.what;
  const StoredJob stored = *store_->job(2);
  EXPECT_EQ(stored.state, JobState::kFailed);
  EXPECT_EQ(stored.attempts, 3);
  EXPECT_EQ(stored.outcome.verdict, JobVerdict::kBroken);
  EXPECT_EQ(finished(submit("b", {.seed = 2})).stage, JobStage::kDone);
}

TEST_F(ComputeProcessTest, WhatAProcessSaidBeforeItDiedIsInTheReasonWithoutEscapes) {
  options_.compute.program = {"/bin/sh", "-c",
                              "printf 'one\\ncheck \\033[31mfailed\\n' >&2; kill -ABRT $$"};
  open_anew();
  start();
  const JobProgress failed = finished(submit("a"));
  EXPECT_EQ(failed.outcome.verdict, JobVerdict::kBroken);
  EXPECT_NE(failed.what.find("signal 6"), std::string::npos) << failed.what;
  EXPECT_NE(failed.what.find("check ?[31mfailed"), std::string::npos) << failed.what;
}

TEST_F(ComputeProcessTest, AProcessThatAnswersNonsenseEndsItsJobAndNothingElse) {
  for (const char* nonsense :
       {"head -c 200000 /dev/zero >&3", "head -c 200000 /dev/urandom >&3",
        "printf '\\002\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0[]' >&3", "exit 0"}) {
    options_.compute.program = {"/bin/sh", "-c", nonsense};
    open_anew();
    start();
    const std::int64_t job =
        submit(std::string("a") + std::to_string(std::hash<std::string>()(nonsense)));
    EXPECT_EQ(finished(job).outcome.verdict, JobVerdict::kBroken) << nonsense;
  }
}

TEST_F(ComputeProcessTest, AProcessThatStandsStillIsEndedAndTold) {
  start();
  const std::int64_t job = long_job();
  const test::Watched watched(child());
  ::kill(child(), SIGSTOP);
  const JobProgress told = wait_for([job](const JobProgress& p) {
    return p.job == job && p.stage == JobStage::kQueued && !p.what.empty();
  });
  EXPECT_NE(told.what.find("hung"), std::string::npos) << told.what;
  EXPECT_TRUE(watched.ends(kComputeProcessLimit));
  ASSERT_TRUE(trainer_->cancel(job));
  EXPECT_EQ(finished(job).outcome.verdict, JobVerdict::kCancelled);
}

TEST_F(ComputeProcessTest, AProcessThatNeverBeginsIsEndedToo) {
  options_.compute.program = {"/bin/sleep", "1000"};
  open_anew();
  start();
  const JobProgress failed = finished(submit("a"));
  EXPECT_EQ(failed.outcome.verdict, JobVerdict::kBroken);
  EXPECT_NE(failed.what.find("hung"), std::string::npos) << failed.what;
}

TEST_F(ComputeProcessTest, AJobThatAsksForMoreMemoryThanItMayHaveFailsWithTheLimit) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer's own memory cannot be limited";
#endif
  options_.compute.memory_mb = 64;
  open_anew();
  start();
  finished(submit("large", {.poses = 900}));
  const JobProgress failed =
      finished(test::demand(trainer_->retrain("cell-7", {"large"}, "", "se + joint_map")));
  EXPECT_EQ(failed.stage, JobStage::kFailed);
  EXPECT_EQ(failed.outcome.verdict, JobVerdict::kOverLimit) << failed.what;
  EXPECT_EQ(failed.outcome.code, ErrorCode::kTooLarge);
  EXPECT_NE(failed.outcome.why.find("64 MiB"), std::string::npos) << failed.outcome.why;
  EXPECT_FALSE(failed.outcome.next.empty());
  EXPECT_EQ(store_->job(failed.job)->attempts, 1) << "it would do so again";
  EXPECT_EQ(finished(submit("small", {.seed = 2})).stage, JobStage::kDone);
}

TEST_F(ComputeProcessTest, AJobThatTakesMoreProcessorTimeThanItMayFailsWithTheLimit) {
  options_.compute.cpu_s = 2;
  open_anew();
  start();
  const JobProgress failed = finished(long_job());
  EXPECT_EQ(failed.outcome.verdict, JobVerdict::kOverLimit) << failed.what;
  EXPECT_EQ(failed.outcome.code, ErrorCode::kTooLarge);
  EXPECT_GT(*failed.outcome.processor_time, 2);
  EXPECT_GT(*failed.outcome.peak_memory, 1 << 20);
}

TEST_F(ComputeProcessTest, AJobThatRunsIsCancelledAndItsProcessEnds) {
  start();
  const std::int64_t job = long_job();
  const test::Watched watched(child());
  ASSERT_TRUE(trainer_->cancel(job));
  const JobProgress cancelled = finished(job);
  EXPECT_TRUE(watched.ends(kComputeProcessLimit));
  EXPECT_EQ(cancelled.outcome.verdict, JobVerdict::kCancelled);
  EXPECT_EQ(store_->job(job)->state, JobState::kFailed);
  EXPECT_EQ(trainer_->cancel(job).error().code, ErrorCode::kConflict);
  EXPECT_EQ(finished(submit("b", {.seed = 2})).stage, JobStage::kDone);
}

TEST_F(ComputeProcessTest, StoppingEndsTheProcessAndTheJobWaitsForTheNextStart) {
  start();
  const std::int64_t job = long_job();
  const test::Watched watched(child());
  trainer_->stop();
  EXPECT_TRUE(watched.ends(std::chrono::milliseconds(0))) << "it is gone before stop() returns";
  EXPECT_EQ(store_->job(job)->state, JobState::kQueued);
  EXPECT_EQ(store_->job(job)->attempts, 0) << "a stop is no crash";
  {
    const std::lock_guard lock(mutex_);
    reports_.clear();
  }
  open_anew();
  start();
  wait_for([job](const JobProgress& p) {
    return p.job == job && p.stage == JobStage::kTraining && p.share > 0;
  });
  ASSERT_TRUE(trainer_->cancel(job));
}

TEST_F(ComputeProcessTest, AStoppedProcessDoesNotKeepTheTrainerFromStopping) {
  start();
  long_job();
  ::kill(child(), SIGSTOP);
  trainer_->stop();
  EXPECT_FALSE(test::computing_child(::getpid()));
}

TEST_F(ComputeProcessTest, TheProcessInheritsNothingAndStandsBehindOthers) {
  const int leaked = ::open("/dev/null", O_RDONLY);  // as a library opens it: without O_CLOEXEC
  sigset_t some, before;
  ::sigemptyset(&some);
  ::sigaddset(&some, SIGTERM);
  ::pthread_sigmask(SIG_BLOCK, &some, &before);  // inherited by the trainer's thread
  start();
  ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
  const std::int64_t job = long_job();
  const pid_t pid = child();
  const test::Watched watched(pid);
  EXPECT_EQ(watched.descriptors(), (std::vector{0, 1, 2, 3}));
  EXPECT_EQ(watched.status("SigBlk"), "0000000000000000");
  EXPECT_EQ(std::stoull(watched.status("SigIgn"), nullptr, 16) & 0x7FFFFFFF, 0u)
      << "but the C library's own two";
  EXPECT_EQ(watched.status("Threads"), "1");
  EXPECT_EQ(::getpgid(pid), pid) << "a terminal's Ctrl-C is for the service";
  EXPECT_GT(::getpriority(PRIO_PROCESS, static_cast<id_t>(pid)), 0);
  EXPECT_EQ(::sched_getscheduler(pid), SCHED_BATCH);
  ::close(leaked);
  ASSERT_TRUE(trainer_->cancel(job));
}

TEST_F(ComputeProcessTest, AThousandBatchesAreTakenWhileATrainingRuns) {
  start();
  const std::int64_t job = long_job();
  const std::string text = csv({.poses = 12, .seed = 3});
  for (int i = 0; i < 1000; ++i) {
    const auto taken =
        trainer_->submit("cell-7", std::to_string(i), text, "client:" + std::to_string(i));
    ASSERT_TRUE(taken) << sentence(taken.error());
  }
  EXPECT_EQ(trainer_->queued_jobs(), 1000);
  EXPECT_EQ(store_->batches("cell-7")->size(), 1001u);
  EXPECT_EQ(trainer_->progress(job)->stage, JobStage::kTraining) << "the training goes on";
  trainer_->stop();
  EXPECT_EQ(store_->unfinished_jobs()->size(), 1001u);
}

TEST_F(ComputeProcessTest, WhatTheDiskHasNoRoomForIsStoredWhenThereIs) {
  close();
  disk_.emplace();
  open();
  start();
  const JobProgress first = finished(submit("a", {.poses = 200}));
  ASSERT_TRUE(first.in_force) << first.what;
  std::promise<void> full;
  {
    const std::lock_guard lock(mutex_);
    on_report_ = [is_full = full.get_future().share()](const JobProgress& p) {
      if (p.job == 2 && p.stage == JobStage::kTraining) is_full.wait();
    };
  }
  ASSERT_EQ(test::demand(trainer_->retrain("cell-7", {"a"}, "", "se + matern32")), 2);
  ASSERT_EQ(test::demand(trainer_->retrain("cell-7", {"a"}, "", "se")), 3);
  wait_for([](const JobProgress& p) { return p.job == 2 && p.stage == JobStage::kTraining; });
  disk_->refuse_writing(SQLITE_FULL);
  full.set_value();
  const JobProgress waits =
      wait_for([](const JobProgress& p) { return p.what.starts_with("waits for the disk"); });
  EXPECT_EQ(waits.job, 2);
  EXPECT_EQ(registry_->in_force("cell-7")->version, 1) << "it serves";
  EXPECT_FALSE(trainer_->submit("cell-7", "b", csv({.seed = 2}), "client:b"))
      << "not accepted where it is not stored";
  disk_->work_again();
  for (const std::int64_t job : {2, 3}) {
    EXPECT_EQ(finished(job).stage, JobStage::kDone) << "nothing accepted is lost";
    EXPECT_EQ(store_->job(job)->state, JobState::kDone);
    EXPECT_EQ(store_->job(job)->attempts, 1) << "it was trained once";
  }
  EXPECT_EQ(store_->models("cell-7")->size(), 3u);
  EXPECT_EQ(finished(submit("b", {.seed = 2})).stage, JobStage::kDone);
}

TEST_F(ComputeProcessTest, AJobThatIsCancelledWhileTheDiskIsFullIsCancelledOnceThereIsRoom) {
  close();
  disk_.emplace();
  open();
  start();
  const std::int64_t job = long_job();
  disk_->refuse_writing(SQLITE_FULL);
  ASSERT_TRUE(trainer_->cancel(job));
  wait_for([](const JobProgress& p) { return p.what.starts_with("waits for the disk"); });
  disk_->work_again();
  EXPECT_EQ(finished(job).outcome.verdict, JobVerdict::kCancelled);
  EXPECT_EQ(store_->job(job)->outcome.verdict, JobVerdict::kCancelled);
}

}  // namespace
}  // namespace trammel
