#include "server/trainer/trainer.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <filesystem>
#include <new>
#include <thread>

#include "server/base/hash.h"
#include "server/compensate/model_file.h"
#include "server/plan/plan.h"
#include "server/report/health_json.h"
#include "server/simulate/simulate.h"
#include "server/tasks/check/check.h"
#include "server/tasks/train/extend.h"
#include "tests/support/demand.h"
#include "tests/support/from_rows.h"
#include "tests/support/refusal.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

constexpr std::chrono::seconds kLimit{60};

/// What the listeners heard, for waiting.
class Watch {
 public:
  void heard(const JobProgress& progress) {
    {
      const std::lock_guard lock(mutex_);
      reports_.push_back(progress);
    }
    changed_.notify_all();
  }
  /// The first report that `wanted` accepts; fails the test when none comes.
  template <typename Wanted>
  JobProgress wait_for(const Wanted& wanted) {
    std::unique_lock lock(mutex_);
    const auto found = [&] { return std::find_if(reports_.begin(), reports_.end(), wanted); };
    if (!changed_.wait_for(lock, kLimit, [&] { return found() != reports_.end(); })) {
      ADD_FAILURE() << "the awaited report did not come";
      return {};
    }
    return *found();
  }
  JobProgress wait_until_finished(std::int64_t job) {
    return wait_for([job](const JobProgress& p) {
      return p.job == job && (p.stage == JobStage::kDone || p.stage == JobStage::kFailed);
    });
  }
  /// How many reports came before that of its end.
  std::ptrdiff_t place_of_the_end(std::int64_t job) {
    const std::lock_guard lock(mutex_);
    return std::find_if(reports_.begin(), reports_.end(),
                        [job](const JobProgress& p) {
                          return p.job == job &&
                                 (p.stage == JobStage::kDone || p.stage == JobStage::kFailed);
                        }) -
           reports_.begin();
  }
  std::vector<JobStage> stages(std::int64_t job) {
    const std::lock_guard lock(mutex_);
    std::vector<JobStage> stages;
    for (const JobProgress& p : reports_) {
      if (p.job == job && (stages.empty() || stages.back() != p.stage)) stages.push_back(p.stage);
    }
    return stages;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<JobProgress> reports_;  // guarded by mutex_
};

class TrainerTest : public testing::Test {
 protected:
  TrainerTest() { open(); }

  void open() {
    auto opened = Store::open(folder_.file("trammel.db"));
    if (!opened) throw std::runtime_error(opened.error().message);
    store_ = std::move(*opened);
    registry_ = std::make_unique<ModelRegistry>();
    make_trainer();
  }
  void make_trainer(Trainer::ProgressListener first = nullptr) {
    trainer_ = std::make_unique<Trainer>(cells_, *store_, *registry_, options_);
    trainer_->set_listeners(
        [this, first](const JobProgress& progress) {
          watch_.heard(progress);
          if (first) first(progress);
        },
        [this](const ServedModel& model, bool in_force) {
          const std::lock_guard lock(models_mutex_);
          models_.emplace_back(model.version, in_force);
        });
  }
  void restart() {
    trainer_.reset();
    store_.reset();
    open();
  }
  std::string csv(const test::SmallBatch& batch = {}) const {
    return test::small_batch_csv(*cells_.at("cell-7"), batch);
  }
  std::int64_t submit(const std::string& id, const test::SmallBatch& batch = {}) {
    const auto job = trainer_->submit("cell-7", id, csv(batch), "client:" + id);
    EXPECT_TRUE(job) << job.error().message;
    return job.value_or(0);
  }
  JobProgress train(const std::string& id, const test::SmallBatch& batch = {}) {
    return watch_.wait_until_finished(submit(id, batch));
  }
  JobProgress retrain(const std::vector<std::string>& ids, const std::string& level = "",
                      const std::string& bias = "") {
    const auto job = trainer_->retrain("cell-7", ids, level, bias);
    EXPECT_TRUE(job) << job.error().message;
    return watch_.wait_until_finished(job.value_or(0));
  }
  void start() {
    const auto started = trainer_->start();
    ASSERT_TRUE(started) << started.error().message;
    EXPECT_TRUE(started->empty()) << started->front();
  }
  int in_force() const {
    const auto model = registry_->in_force("cell-7");
    return model ? model->version : 0;
  }
  std::vector<std::pair<int, bool>> models_heard() {
    const std::lock_guard lock(models_mutex_);
    return models_;
  }

  test::TemporaryFolder folder_;
  TrainerOptions options_;
  std::map<std::string, std::shared_ptr<const Cell>> cells_ = {
      {"cell-7", test::small_cell("cell-7")}};
  Watch watch_;
  std::mutex models_mutex_;
  std::vector<std::pair<int, bool>> models_;  // guarded by models_mutex_
  std::unique_ptr<Store> store_;
  std::unique_ptr<ModelRegistry> registry_;
  std::unique_ptr<Trainer> trainer_;
};

TEST_F(TrainerTest, MakesAnAcceptedBatchTheModelInForce) {
  start();
  const JobProgress done = train("lt-07");
  EXPECT_EQ(done.stage, JobStage::kDone) << done.what;
  EXPECT_TRUE(done.in_force) << done.what;
  EXPECT_EQ(done.model_version, 1);
  EXPECT_EQ(watch_.stages(done.job), (std::vector{JobStage::kQueued, JobStage::kTraining,
                                                  JobStage::kStoring, JobStage::kDone}));
  ASSERT_EQ(in_force(), 1);
  EXPECT_EQ(registry_->in_force("cell-7")->model.provenance().batch_id, "lt-07");
  EXPECT_EQ(models_heard(), (std::vector<std::pair<int, bool>>{{1, true}}));
  const auto stored = store_->job(done.job);
  EXPECT_EQ(stored->state, JobState::kDone);
  EXPECT_EQ(stored->message, done.what);
  const auto later = trainer_->progress(done.job);
  EXPECT_EQ(later->stage, JobStage::kDone);
  EXPECT_TRUE(later->in_force);
}

TEST_F(TrainerTest, ARetrainChoosesTheBiasItselfWhereAsked) {
  start();
  train("lt-07");
  const JobProgress chosen = retrain({"lt-07"}, "", "auto");
  EXPECT_EQ(chosen.stage, JobStage::kDone) << chosen.what;
  EXPECT_EQ(store_->model("cell-7", chosen.model_version)->parts().bias_choice->kernel, "none");
  const auto unknown = trainer_->retrain("cell-7", {"lt-07"}, "", "automatic");
  ASSERT_FALSE(unknown);
  EXPECT_EQ(refusal_of(unknown), Refusal("", {}, "bias").text("automatic"));
}

TEST_F(TrainerTest, StoresAWorseModelAndLeavesTheBetterOneInForce) {
  start();
  train("lt-07");
  const JobProgress worse = retrain({"lt-07"}, "M0");
  EXPECT_EQ(worse.stage, JobStage::kDone);
  EXPECT_FALSE(worse.in_force);
  EXPECT_EQ(worse.model_version, 2);
  EXPECT_NE(worse.what.find("not in force"), std::string::npos) << worse.what;
  EXPECT_NE(worse.what.find("version 1"), std::string::npos) << worse.what;
  EXPECT_EQ(in_force(), 1);
  EXPECT_EQ(*store_->version_in_force("cell-7"), 1);
  EXPECT_EQ(store_->models("cell-7")->size(), 2u);
  EXPECT_FALSE(trainer_->progress(worse.job)->in_force);
  EXPECT_EQ(models_heard().back(), std::pair(2, false));
}

TEST_F(TrainerTest, ANominalModelIsNotPutInForceAsTheFirstOfItsCell) {
  Cell nominal = *cells_.at("cell-7");
  nominal.model.error_sources.clear();
  cells_["cell-7"] = std::make_shared<const Cell>(std::move(nominal));
  make_trainer();
  start();
  const JobProgress done = train("lt-07");
  EXPECT_EQ(done.stage, JobStage::kDone) << done.what;
  EXPECT_FALSE(done.in_force) << done.what;
  EXPECT_EQ(in_force(), 0);
}

TEST_F(TrainerTest, ASubmitterWhoHoldsNothingOutIsJudgedAllTheSame) {
  start();
  test::SmallBatch all_train;
  all_train.set = "train";
  const JobProgress done = train("lt-07", all_train);
  EXPECT_TRUE(done.in_force) << done.what;
  EXPECT_EQ(registry_->in_force("cell-7")->model.provenance().training_poses, 32);
  EXPECT_EQ(registry_->in_force("cell-7")->model.parts().validation->poses, 8);
}

TEST_F(TrainerTest, ARowHeldOutOnceIsHeldOutInEveryTrainingOfItsBatch) {
  cells_["cell-7"] = test::small_cell("cell-7", "se");
  make_trainer();
  start();
  test::SmallBatch second;
  second.seed = 2;
  ASSERT_EQ(train("a").stage, JobStage::kDone);
  ASSERT_EQ(train("b", second).stage, JobStage::kDone);
  const JobProgress again = retrain({"a", "b"});
  ASSERT_EQ(again.stage, JobStage::kDone) << again.what;
  const auto trained_on = [this](int version) {
    return store_->model("cell-7", version)->parts().bias->q;
  };
  const Eigen::MatrixXd of_both = trained_on(3);
  ASSERT_EQ(of_both.rows(), 64);
  EXPECT_EQ(of_both.topRows(32), trained_on(1));
  EXPECT_EQ(of_both, trained_on(2))
      << "the training of the second batch learns from the first, too";
}

TEST_F(TrainerTest, TheSameRequestAgainIsTheSameJobHoweverManyWait) {
  options_.queue_capacity = 1;
  make_trainer();
  const auto first = trainer_->submit("cell-7", "lt-07", csv(), "client:1");
  const auto again = trainer_->submit("cell-7", "lt-07", csv(), "client:1");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(*again, *first);
  EXPECT_EQ(trainer_->queued_jobs(), 1);
  const auto other = trainer_->submit("cell-7", "lt-07", csv({.seed = 2}), "client:2");
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().code, ErrorCode::kConflict);
}

TEST_F(TrainerTest, HoweverManyJobsWaitABatchIsTakenAndOneMoreRequestIsNot) {
  options_.queue_capacity = 1;
  make_trainer();
  submit("lt-07");
  submit("lt-08", {.seed = 2});
  ASSERT_TRUE(trainer_->retrain("cell-7", {}, "", "")) << "what came with batches does not count";
  const auto again = trainer_->retrain("cell-7", {}, "", "");
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().code, ErrorCode::kBusy);
  EXPECT_EQ(again.error().limit, 1);
  EXPECT_EQ(trainer_->diagnose("cell-7", "", "", false).error().code, ErrorCode::kBusy);
  EXPECT_EQ(store_->unfinished_jobs()->size(), 3u);
  submit("lt-09", {.seed = 3});
  EXPECT_EQ(trainer_->queued_jobs(), 4);
}

TEST_F(TrainerTest, RefusedInputStoresNothing) {
  const std::string good = csv();
  EXPECT_EQ(trainer_->submit("cell-9", "a", good, "r").error().code, ErrorCode::kNotFound);
  EXPECT_FALSE(trainer_->submit("cell-7", "", good, "r"));
  for (const char* id : {"two\nlines", "\xff", "caf\xe9", "\x1b[2J", "\xc2\x9b", "\xe2\x80\xae"})
    EXPECT_FALSE(trainer_->submit("cell-7", id, good, "r")) << id;
  EXPECT_FALSE(trainer_->submit("cell-7", std::string(257, 'x'), good, "r"));
  EXPECT_FALSE(trainer_->submit("cell-7", "a", "no,batch\n1,2\n", "r"));
  std::string beyond = good;
  beyond.replace(beyond.find('\n') + 1, beyond.find(',', beyond.find('\n')) - beyond.find('\n') - 1,
                 "999.0");
  EXPECT_FALSE(trainer_->submit("cell-7", "a", beyond, "r"));
  EXPECT_TRUE(store_->batches("cell-7")->empty());
  EXPECT_TRUE(store_->unfinished_jobs()->empty());
}

TEST_F(TrainerTest, RefusesMorePosesThanItsLimit) {
  options_.max_poses = 50;
  make_trainer();
  const auto large = trainer_->submit("cell-7", "large", csv({.poses = 51}), "r");
  ASSERT_FALSE(large);
  EXPECT_EQ(large.error().code, ErrorCode::kTooLarge);
  submit("a");
  submit("b", {.seed = 2});
  EXPECT_EQ(trainer_->retrain("cell-7", {"a", "b"}, "", "").error().code, ErrorCode::kTooLarge);
  EXPECT_EQ(store_->unfinished_jobs()->size(), 2u);
}

TEST_F(TrainerTest, RefusesToRetrainFromWhatItDoesNotHave) {
  EXPECT_EQ(trainer_->retrain("cell-7", {}, "", "").error().code, ErrorCode::kNotFound);
  submit("a");
  EXPECT_EQ(trainer_->retrain("cell-7", {"b"}, "", "").error().code, ErrorCode::kNotFound);
  EXPECT_FALSE(trainer_->retrain("cell-7", {"a", "a"}, "", ""));
  EXPECT_FALSE(trainer_->retrain("cell-7", {"a"}, "M1,no_such_cause", ""));
  EXPECT_FALSE(trainer_->retrain("cell-7", {"a"}, "", "no_such_kernel"));
  EXPECT_EQ(trainer_->retrain("cell-9", {}, "", "").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(store_->unfinished_jobs()->size(), 1u);
}

TEST_F(TrainerTest, WhatNoTrainingMayAskForIsRefusedWithTheLimitWhenItIsAskedFor) {
  submit("a");
  std::string kernel = "se", sources = "M1";
  for (int i = 0; i < 40; ++i) kernel += " + se";
  for (int i = 0; i < 600; ++i)
    sources += fmt::format(",gear_transmission:{}@{}", 1 + i % 6, 1 + i / 6);
  const auto refused_with = [this](const std::vector<std::string>& batches,
                                   const std::string& level, const std::string& bias) {
    const auto job = trainer_->retrain("cell-7", batches, level, bias);
    EXPECT_EQ(job ? ErrorCode::kInternal : job.error().code, ErrorCode::kTooLarge);
    return job ? 0 : job.error().limit.value_or(0);
  };
  EXPECT_EQ(refused_with({"a"}, "", kernel), 32);
  EXPECT_EQ(refused_with({"a"}, "", std::string(100'000, '(')), 1000);
  EXPECT_EQ(refused_with({"a"}, sources, ""), 4096);
  EXPECT_EQ(refused_with({"a"}, std::string(1'000'000, 'x'), ""), 4096);
  EXPECT_EQ(refused_with(std::vector<std::string>(1001, "a"), "", ""), 1000);
  EXPECT_EQ(store_->unfinished_jobs()->size(), 1u);
}

TEST_F(TrainerTest, RetrainsFromTheNewestBatchWhenNoneIsNamed) {
  submit("older");
  submit("newer", {.seed = 2});
  const auto job = trainer_->retrain("cell-7", {}, "", "");
  ASSERT_TRUE(job);
  EXPECT_EQ(store_->job(*job)->batch_ids, std::vector<std::string>{"newer"});
}

TEST_F(TrainerTest, AFailedTrainingSaysWhyAndTheNextOneGoesOn) {
  cells_["cell-7"] = test::small_cell("cell-7", "se");
  make_trainer();
  start();
  const JobProgress failed = train("tiny", {.poses = 5});
  EXPECT_EQ(failed.stage, JobStage::kFailed);
  EXPECT_FALSE(failed.what.empty());
  EXPECT_EQ(store_->job(failed.job)->state, JobState::kFailed);
  EXPECT_EQ(store_->job(failed.job)->message, failed.what);
  EXPECT_EQ(trainer_->progress(failed.job)->stage, JobStage::kFailed);
  EXPECT_EQ(train("lt-07").stage, JobStage::kDone);
}

TEST_F(TrainerTest, OutOfMemoryEndsTheTrainingAndNotTheService) {
  bool thrown = false;
  make_trainer([&thrown](const JobProgress& progress) {
    if (progress.stage != JobStage::kTraining || thrown) return;
    thrown = true;
    throw std::bad_alloc();
  });
  start();
  const JobProgress failed = train("a");
  EXPECT_EQ(failed.stage, JobStage::kFailed);
  EXPECT_NE(failed.what.find("bad_alloc"), std::string::npos) << failed.what;
  EXPECT_EQ(retrain({"a"}).stage, JobStage::kDone);
}

TEST_F(TrainerTest, StoppingGivesTheTrainingUpAndTheNextStartFinishesIt) {
  cells_["cell-7"] = test::small_cell("cell-7", "se");
  std::mutex mutex;
  std::condition_variable changed;
  bool stopping = false;
  make_trainer([&](const JobProgress& progress) {
    if (progress.stage != JobStage::kTraining) return;
    std::unique_lock lock(mutex);
    changed.wait_for(lock, kLimit, [&] { return stopping; });
  });
  start();
  const std::int64_t job = submit("lt-07", {.poses = 300});
  watch_.wait_for([](const JobProgress& p) { return p.stage == JobStage::kTraining; });
  {
    const std::lock_guard lock(mutex);
    stopping = true;
  }
  changed.notify_all();
  trainer_->stop();
  EXPECT_EQ(store_->job(job)->state, JobState::kQueued);
  EXPECT_EQ(store_->job(job)->attempts, 0) << "a stop is no crash";
  EXPECT_EQ(watch_.stages(job).back(), JobStage::kQueued);
  restart();
  start();
  EXPECT_EQ(watch_.wait_until_finished(job).stage, JobStage::kDone);
}

TEST_F(TrainerTest, TakesUpWhatACrashInterrupted) {
  const std::int64_t job = submit("lt-07");
  ASSERT_TRUE(store_->set_job_running(job));
  restart();
  start();
  EXPECT_EQ(watch_.wait_until_finished(job).stage, JobStage::kDone);
  EXPECT_EQ(in_force(), 1);
}

TEST_F(TrainerTest, AJobThatTookTheProcessDownThreeTimesIsNotTriedAgain) {
  const std::int64_t poison = submit("poison");
  const std::int64_t good = submit("good", {.seed = 2});
  for (int crash = 0; crash < 3; ++crash) ASSERT_TRUE(store_->set_job_running(poison));
  restart();
  const auto notices = trainer_->start();
  ASSERT_TRUE(notices);
  ASSERT_EQ(notices->size(), 1u);
  EXPECT_NE(notices->front().find("3 times"), std::string::npos) << notices->front();
  EXPECT_EQ(store_->job(poison)->state, JobState::kFailed);
  EXPECT_TRUE(store_->batch("cell-7", "poison")) << "the batch itself is kept";
  EXPECT_EQ(watch_.wait_until_finished(good).stage, JobStage::kDone);
}

TEST_F(TrainerTest, TakesUpMoreRequestsThanMayWaitNow) {
  submit("a");
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(trainer_->retrain("cell-7", {"a"}, "", ""));
  options_.queue_capacity = 1;
  restart();
  start();
  EXPECT_EQ(watch_.wait_until_finished(4).stage, JobStage::kDone);
}

TEST_F(TrainerTest, TheOutcomeOfAJobIsDataAndSurvivesARestart) {
  start();
  const JobProgress first = train("lt-07");
  const JobProgress worse = retrain({"lt-07"}, "M0");
  const JobProgress found =
      watch_.wait_until_finished(trainer_->diagnose("cell-7", "lt-07", "", false).value());
  EXPECT_EQ(first.outcome.verdict, JobVerdict::kInForce);
  EXPECT_GT(*first.outcome.before, 1e-3) << "nominal, m";
  EXPECT_LT(*first.outcome.after, 1e-4) << "m";
  EXPECT_FALSE(first.outcome.code);
  EXPECT_NE(worse.outcome.verdict, JobVerdict::kInForce);
  EXPECT_EQ(worse.outcome.next, "activate it if it is wanted");
  EXPECT_EQ(found.outcome.verdict, JobVerdict::kDiagnosed);
  EXPECT_FALSE(found.outcome.why.empty());
  restart();
  for (const JobProgress& heard : {first, worse, found}) {
    const JobOutcome stored = trainer_->progress(heard.job)->outcome;
    EXPECT_EQ(stored.verdict, heard.outcome.verdict);
    EXPECT_EQ(stored.before, heard.outcome.before);
    EXPECT_EQ(stored.after, heard.outcome.after);
    EXPECT_EQ(stored.limit, heard.outcome.limit);
    EXPECT_EQ(stored.why, heard.outcome.why);
    EXPECT_EQ(stored.next, heard.outcome.next);
  }
}

TEST_F(TrainerTest, AJobThatWaitsIsCancelledAtOnce) {
  const std::int64_t first = submit("a");
  const std::int64_t second = submit("b", {.seed = 2});
  ASSERT_TRUE(trainer_->cancel(first));
  EXPECT_EQ(trainer_->queued_jobs(), 1);
  EXPECT_EQ(store_->job(first)->state, JobState::kFailed);
  EXPECT_EQ(trainer_->progress(first)->outcome.verdict, JobVerdict::kCancelled);
  EXPECT_EQ(trainer_->cancel(first).error().code, ErrorCode::kConflict);
  EXPECT_EQ(trainer_->cancel(99).error().code, ErrorCode::kNotFound);
  start();
  EXPECT_EQ(watch_.wait_until_finished(second).stage, JobStage::kDone);
  EXPECT_EQ(retrain({"a"}).stage, JobStage::kDone) << "the batch is still there";
}

TEST_F(TrainerTest, TheCellsHaveTheirTurnsHoweverManyJobsOneOfThemHas) {
  cells_["cell-8"] = test::small_cell("cell-8");
  make_trainer();
  for (int i = 0; i < 5; ++i)
    submit(std::to_string(i), {.seed = static_cast<std::uint64_t>(i + 1)});
  const std::int64_t other =
      trainer_->submit("cell-8", "a", test::small_batch_csv(*cells_.at("cell-8"), {}), "client:a")
          .value();
  start();
  watch_.wait_until_finished(5);
  watch_.wait_until_finished(other);
  EXPECT_LT(watch_.place_of_the_end(other), watch_.place_of_the_end(2))
      << "one job of the other cell was before it";
  EXPECT_LT(watch_.place_of_the_end(1), watch_.place_of_the_end(2));
}

TEST_F(TrainerTest, AJobOfACellThatIsNotServedHereWaits) {
  const std::int64_t job = submit("lt-07");
  cells_ = {{"cell-8", test::small_cell("cell-8")}};
  restart();
  const auto notices = trainer_->start();
  ASSERT_TRUE(notices);
  EXPECT_EQ(notices->size(), 1u);
  EXPECT_EQ(store_->job(job)->state, JobState::kQueued);
  EXPECT_EQ(trainer_->queued_jobs(), 0);
}

TEST_F(TrainerTest, ACellThatIsAddedWhileItServesIsTrainedFromTheJobsThatWaitedForIt) {
  const std::int64_t job = submit("lt-07");
  const ServedCells added = cells_;
  cells_ = {{"cell-8", test::small_cell("cell-8")}};
  restart();
  ASSERT_TRUE(trainer_->start());
  const ServedCells& before = trainer_->cells();
  EXPECT_TRUE(trainer_->add_cells(added).empty());
  EXPECT_TRUE(trainer_->add_cells(added).empty()) << "a second time changes nothing";
  EXPECT_EQ(before.size(), 1u) << "whoever reads it still may";
  EXPECT_EQ(trainer_->cells().size(), 2u);
  EXPECT_TRUE(watch_.wait_until_finished(job).in_force);
  EXPECT_EQ(registry_->version_in_force("cell-7"), 1);
  EXPECT_TRUE(trainer_->submit(
      "cell-7", "lt-08", test::small_batch_csv(*added.at("cell-7"), {.seed = 2}), "client:2"));
}

TEST_F(TrainerTest, ServesWhatWasInForceAfterARestart) {
  start();
  train("lt-07");
  const std::string hash = registry_->in_force("cell-7")->model.provenance().hash;
  restart();
  EXPECT_EQ(in_force(), 0);
  start();
  ASSERT_EQ(in_force(), 1);
  EXPECT_EQ(registry_->in_force("cell-7")->model.provenance().hash, hash);
  EXPECT_EQ(models_heard().back(), std::pair(1, true));
}

TEST_F(TrainerTest, DoesNotServeAModelOfAnotherRobot) {
  start();
  train("lt-07");
  Cell changed = *cells_.at("cell-7");
  std::vector<Joint> joints;
  for (int i = 0; i < changed.robot.size(); ++i) joints.push_back(changed.robot.joint(i));
  joints[0].link.d += 0.1;
  changed.robot = Chain::make("longer", joints).value();
  cells_["cell-7"] = std::make_shared<const Cell>(std::move(changed));
  restart();
  const auto notices = trainer_->start();
  ASSERT_TRUE(notices);
  ASSERT_EQ(notices->size(), 1u);
  EXPECT_EQ(in_force(), 0);
  EXPECT_EQ(trainer_->activate("cell-7", 1).error().code, ErrorCode::kRefused);
}

TEST_F(TrainerTest, DoesNotServeAModelOfAToolThatHasChanged) {
  start();
  train("lt-07");
  Cell changed = *cells_.at("cell-7");
  changed.tools["probe"] = Pose::Identity();  // one more tool is no reason
  cells_["cell-7"] = std::make_shared<const Cell>(changed);
  restart();
  ASSERT_TRUE(trainer_->start());
  EXPECT_EQ(in_force(), 1);

  changed.tools.at("spindle")->translation().z() += 0.05;
  cells_["cell-7"] = std::make_shared<const Cell>(std::move(changed));
  restart();
  const auto notices = trainer_->start();
  ASSERT_TRUE(notices);
  ASSERT_EQ(notices->size(), 1u);
  EXPECT_NE(notices->front().find("other tools"), std::string::npos) << notices->front();
  EXPECT_EQ(in_force(), 0);
  EXPECT_EQ(trainer_->activate("cell-7", 1).error().code, ErrorCode::kRefused);
}

TEST_F(TrainerTest, RollsBackAndActivatesWhatIsThenServed) {
  start();
  train("a");
  train("b", {.noise = 15e-6, .seed = 2});
  if (in_force() != 2) {
    const auto activated = trainer_->activate("cell-7", 2);
    ASSERT_TRUE(activated) << activated.error().message;
  }
  const auto back = trainer_->rollback("cell-7");
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(*back, 1);
  EXPECT_EQ(in_force(), 1);
  EXPECT_EQ(trainer_->rollback("cell-7").error().code, ErrorCode::kNotFound);
  ASSERT_TRUE(trainer_->activate("cell-7", 2));
  EXPECT_EQ(in_force(), 2);
  EXPECT_EQ(*store_->version_in_force("cell-7"), 2);
  EXPECT_EQ(models_heard().back(), std::pair(2, true));
  EXPECT_EQ(trainer_->activate("cell-7", 3).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(in_force(), 2);
}

TEST_F(TrainerTest, WhereNoModelCanBeLoadedTheRecordOfTheOneInForceJudges) {
  start();
  train("first");
  for (const int version : {2, 3}) {
    train(std::to_string(version), {.seed = static_cast<std::uint64_t>(version)});
    ASSERT_TRUE(trainer_->activate("cell-7", version, {}, true));
  }
  SQLite::Database(folder_.file("trammel.db"), SQLite::OPEN_READWRITE)
      .exec("UPDATE models SET content = replace(content, '10', '11')");
  trainer_.reset();
  std::filesystem::remove_all(folder_.file("trammel.db.models"));
  restart();
  ASSERT_TRUE(trainer_->start());
  ASSERT_EQ(in_force(), 0);
  const JobProgress worse = train("fourth", {.noise = 3e-4, .seed = 4});
  EXPECT_FALSE(worse.in_force) << worse.what;
  EXPECT_NE(
      worse.what.find("version 3 had on its own, which is marked in force but cannot be loaded"),
      std::string::npos)
      << worse.what;
}

TEST_F(TrainerTest, ARollbackStepsPastWhatCannotBeLoaded) {
  start();
  train("first");
  for (const int version : {2, 3}) {
    train(std::to_string(version), {.seed = static_cast<std::uint64_t>(version)});
    ASSERT_TRUE(trainer_->activate("cell-7", version, {}, true));
  }
  SQLite::Database(folder_.file("trammel.db"), SQLite::OPEN_READWRITE)
      .exec("UPDATE models SET content = replace(content, '10', '11') WHERE version = 2");
  trainer_.reset();
  std::filesystem::remove_all(folder_.file("trammel.db.models"));
  restart();
  ASSERT_TRUE(trainer_->start());
  ASSERT_EQ(in_force(), 3);
  EXPECT_EQ(trainer_->rollback("cell-7").value(), 1);
  EXPECT_EQ(in_force(), 1);
  EXPECT_EQ(*store_->version_in_force("cell-7"), 1);
}

TEST_F(TrainerTest, ImportsAModelIntoTheHistoryButNotIntoForce) {
  start();
  train("lt-07");
  const std::string text = serialize(test::nominal_model(cells_.at("cell-7"), 7));
  const auto version = trainer_->import_model("cell-7", text);
  ASSERT_TRUE(version) << version.error().message;
  EXPECT_EQ(*version, 2);
  EXPECT_EQ(in_force(), 1);
  EXPECT_EQ(trainer_->import_model("cell-7", text).value(), 2) << "the same again is the same";
  EXPECT_EQ(trainer_->activate("cell-7", 2).error().code, ErrorCode::kRefused)
      << "it is worse on what was measured";
  EXPECT_EQ(in_force(), 1);
  EXPECT_TRUE(trainer_->activate("cell-7", 2, {}, true)) << "a person wants it all the same";
  EXPECT_EQ(in_force(), 2);
}

TEST_F(TrainerTest, RefusesToImportWhatIsNotOfTheCell) {
  start();
  EXPECT_FALSE(trainer_->import_model(
      "cell-7", serialize(test::nominal_model(test::small_cell("cell-8"), 7))));
  EXPECT_FALSE(trainer_->import_model("cell-7", "no model"));
  EXPECT_TRUE(store_->models("cell-7")->empty());
}

/// Joint 3 of the small cell oscillates, which its error sources do not know.
MeasurementBatch batch_of_an_oscillating_joint(const std::shared_ptr<const Cell>& cell,
                                               int poses = 120, std::uint64_t seed = 1) {
  VirtualRobot robot{
      make_physical_model(cell, {"base", "gear_transmission:3@2"}).value(), 20e-6, 60e-6, {}};
  robot.truth.values(0) = 1e-3;
  robot.truth.values.tail<2>() = Eigen::Vector2d(1e-4, 2e-4);
  return simulate(robot, plan_poses(*cell, {poses, seed}).value(), {}).value();
}
std::string csv_of_an_oscillating_joint(const std::shared_ptr<const Cell>& cell) {
  return to_csv(batch_of_an_oscillating_joint(cell));
}

TEST_F(TrainerTest, DiagnosesAStoredBatchAndKeepsWhatItFound) {
  start();
  train("lt-07");
  const auto job = trainer_->diagnose("cell-7", "", "", false);
  ASSERT_TRUE(job) << job.error().message;
  const JobProgress done = watch_.wait_until_finished(*job);
  EXPECT_EQ(done.stage, JobStage::kDone) << done.what;
  EXPECT_EQ(done.model_version, 0);
  EXPECT_NE(trainer_->diagnosis(*job)->findings.find("\"verdict\""), std::string::npos);
  EXPECT_NE(trainer_->diagnosis(*job)->page.find("</html>"), std::string::npos);
  EXPECT_EQ(store_->models("cell-7")->size(), 1u);
}

TEST_F(TrainerTest, PutsTheExtendedModelInForceBecauseItIsBetterAndKeepsWhatWasAdded) {
  start();
  const std::string oscillating = csv_of_an_oscillating_joint(cells_.at("cell-7"));
  watch_.wait_until_finished(trainer_->submit("cell-7", "lt-07", oscillating, "client:1").value());
  const auto job = trainer_->diagnose("cell-7", "lt-07", "", true);
  ASSERT_TRUE(job) << job.error().message;
  const JobProgress done = watch_.wait_until_finished(*job);
  ASSERT_EQ(done.stage, JobStage::kDone) << done.what;
  EXPECT_TRUE(done.in_force) << done.what << trainer_->diagnosis(*job)->findings;
  EXPECT_EQ(done.model_version, 2);
  const std::string level = registry_->in_force("cell-7")->model.provenance().level;
  EXPECT_TRUE(level.starts_with("base,")) << level;
  const JobProgress again = retrain({"lt-07"});
  EXPECT_EQ(store_->models("cell-7")->at(2).level, level) << again.what;
}

TEST_F(TrainerTest, WhereNoModelIsInForceItsOwnPosesAloneJudgeAnExtensionAsOnFiles) {
  start();
  const auto cell = cells_.at("cell-7");
  MeasurementBatch noisy = batch_of_an_oscillating_joint(cell, 60, 2);
  for (std::size_t i = 0; i < noisy.measurements.size(); ++i) {
    const auto k = static_cast<double>(i);
    noisy.measurements[i].p_W +=
        3e-3 * Vector3(std::sin(37 * k), std::cos(53 * k), std::sin(29 * k));
  }
  watch_.wait_until_finished(
      trainer_->submit("cell-7", "noisy", to_csv(noisy), "client:1").value());
  ASSERT_EQ(in_force(), 0) << "its model waits for a person";

  const std::string text = to_csv(batch_of_an_oscillating_joint(cell, 60, 1));
  const JobProgress done =
      watch_.wait_until_finished(trainer_->diagnose("cell-7", "", text, true).value());
  const CheckedBatch batch = test::demand(check_against_cell(
      test::demand(parse_batch_csv(text, "b.csv")), *cell, held_out_to_extend(options_.seed)));
  DiagnoseOptions options;
  options.seed = options_.seed;
  TrainOptions training;
  training.seed = options_.seed;
  const Applied on_files =
      test::demand(applied(cell, batch, test::demand(diagnose(cell, batch, options)), training));
  EXPECT_NE(on_files.why_not.find("12 poses are held out to judge by"), std::string::npos)
      << on_files.why_not;
  EXPECT_NE(done.what.find(on_files.why_not), std::string::npos)
      << done.what << "\non files: " << on_files.why_not;
}

TEST_F(TrainerTest, ACheckSaysWhatItSaysOnFilesWithTheNotesOfTheModelInForce) {
  start();
  train("lt-07");
  const auto cell = cells_.at("cell-7");
  const std::string text = csv({.poses = 20, .seed = 2});
  const std::int64_t job = trainer_->check("cell-7", "", text, {}).value();
  const JobProgress done = watch_.wait_until_finished(job);
  ASSERT_EQ(done.stage, JobStage::kDone) << done.what;
  const CheckedBatch batch =
      test::demand(check_against_cell(test::demand(parse_batch_csv(text, "b.csv")), *cell));
  const CompensatedModel& model = registry_->in_force("cell-7")->model;
  const auto on_files =
      check_json(test::demand(check_robot(model, *cell, batch, {})), batch, model);
  const auto told = nlohmann::ordered_json::parse(trainer_->diagnosis(job)->findings);
  ASSERT_FALSE(on_files["notes"].empty()) << "nobody has confirmed the robot file";
  for (const auto& [key, value] : on_files.items()) EXPECT_TRUE(told.contains(key)) << key;
  for (const char* key : {"verdict", "why", "notes", "tolerance_mm", "rms_mm", "model"})
    EXPECT_EQ(told[key], on_files[key]) << key;
}

TEST_F(TrainerTest, APoseHeldOutThatFitsNeitherModelDoesNotJudgeAnExtensionAndIsNamed) {
  start();
  MeasurementBatch batch = batch_of_an_oscillating_joint(cells_.at("cell-7"));
  const MeasurementBatch drawn =
      test::with_held_out(batch, options_.validation_share, options_.seed);
  const auto held_out =
      std::find_if(drawn.measurements.begin(), drawn.measurements.end(),
                   [](const Measurement& m) { return m.set == MeasurementSet::kValidation; });
  Measurement& bad =
      batch.measurements.at(static_cast<std::size_t>(held_out - drawn.measurements.begin()));
  bad.p_W.z() += 0.02;
  watch_.wait_until_finished(
      trainer_->submit("cell-7", "lt-07", to_csv(batch), "client:1").value());
  const JobProgress done =
      watch_.wait_until_finished(trainer_->diagnose("cell-7", "lt-07", "", true).value());
  EXPECT_TRUE(done.in_force) << "one pose 20 mm off decided: " << done.what;
  EXPECT_NE(done.what.find("judged without " + bad.pose_id), std::string::npos) << done.what;
}

TEST_F(TrainerTest, WhatTheModelInForceHasAlreadyIsNotFoundAgain) {
  start();
  const std::string oscillating = csv_of_an_oscillating_joint(cells_.at("cell-7"));
  watch_.wait_until_finished(trainer_->submit("cell-7", "lt-07", oscillating, "client:1").value());
  const JobProgress first =
      watch_.wait_until_finished(trainer_->diagnose("cell-7", "lt-07", "", true).value());
  ASSERT_TRUE(first.in_force) << first.what;
  EXPECT_NE(first.what.find("better beyond chance"), std::string::npos) << first.what;
  EXPECT_NE(first.what.find("(version 1)"), std::string::npos) << first.what;
  const JobProgress again =
      watch_.wait_until_finished(trainer_->diagnose("cell-7", "lt-07", "", true).value());
  EXPECT_FALSE(again.in_force);
  EXPECT_NE(again.what.find("nothing applied"), std::string::npos) << again.what;
  EXPECT_NE(again.what.find("version 2 stays in force"), std::string::npos) << again.what;
  EXPECT_EQ(in_force(), 2);
  EXPECT_EQ(store_->models("cell-7")->size(), 2u);
}

TEST_F(TrainerTest, ADiagnosisThatNamesNothingAppliesNothing) {
  start();
  train("lt-07");
  const JobProgress done =
      watch_.wait_until_finished(trainer_->diagnose("cell-7", "lt-07", "", true).value());
  EXPECT_EQ(done.stage, JobStage::kDone) << done.what;
  EXPECT_NE(done.what.find("nothing applied"), std::string::npos) << done.what;
  EXPECT_EQ(in_force(), 1);
  EXPECT_EQ(store_->models("cell-7")->size(), 1u);
}

TEST_F(TrainerTest, DiagnosesABatchThatIsSentWithoutStoringItAsOne) {
  start();
  const auto job = trainer_->diagnose("cell-7", "", csv(), false);
  ASSERT_TRUE(job) << job.error().message;
  EXPECT_EQ(watch_.wait_until_finished(*job).stage, JobStage::kDone);
  EXPECT_TRUE(store_->batches("cell-7")->empty());
  EXPECT_FALSE(trainer_->diagnose("cell-7", "", "q1_deg\n1\n", false));
  EXPECT_EQ(trainer_->diagnose("cell-7", "lt-99", "", false).error().code, ErrorCode::kNotFound);
}

TEST_F(TrainerTest, ABatchThatNothingExplainsIsKeptApartUntilItIsReleased) {
  start();
  train("lt-07");
  test::SmallBatch noisy;
  noisy.noise = 2e-3;
  noisy.seed = 5;
  const JobProgress refused = train("lt-08", noisy);
  EXPECT_EQ(refused.stage, JobStage::kFailed);
  EXPECT_NE(refused.what.find("quarantine"), std::string::npos) << refused.what;
  ASSERT_EQ(trainer_->quarantined("")->size(), 1u);
  EXPECT_EQ(trainer_->quarantined("cell-7")->front().id, "lt-08");
  EXPECT_EQ(in_force(), 1);

  const auto again = trainer_->retrain("cell-7", {"lt-07", "lt-08"}, "", "");
  ASSERT_FALSE(again);
  EXPECT_EQ(refusal_of(again), Refusal("", {}, "batch").text("lt-08"));
  ASSERT_TRUE(trainer_->release("cell-7", "lt-08"));
  EXPECT_TRUE(trainer_->quarantined("")->empty());
  EXPECT_EQ(retrain({"lt-08"}).stage, JobStage::kDone);
}

TEST_F(TrainerTest, ABatchStaysInQuarantineWhereTheTrainingThatWasToReleaseItIsRefused) {
  options_.queue_capacity = 1;
  make_trainer();
  submit("lt-07");
  ASSERT_TRUE(store_->set_quarantine("cell-7", "lt-07", "another tool"));
  const auto released = [this](const std::vector<std::string>& ids, const std::string& level,
                               const std::string& bias) {
    const auto job = trainer_->retrain("cell-7", ids, level, bias, Trainer::Quarantine::kReleased);
    EXPECT_EQ(trainer_->quarantined("")->size(), 1u) << "asking releases nothing";
    return job;
  };
  EXPECT_FALSE(released({"lt-07"}, "M9", ""));
  EXPECT_FALSE(released({"lt-07"}, "", "automatic"));
  EXPECT_FALSE(released({"lt-07", "lt-99"}, "", ""));
  EXPECT_FALSE(released({"lt-07", "lt-07"}, "", ""));
  EXPECT_FALSE(released({}, "", "")) << "which one is good must be said";
  submit("lt-08", {.seed = 2});
  ASSERT_TRUE(trainer_->retrain("cell-7", {"lt-08"}, "", ""));
  const auto busy = released({"lt-07"}, "", "");
  ASSERT_FALSE(busy);
  EXPECT_EQ(busy.error().code, ErrorCode::kBusy);
  options_.queue_capacity = 2;
  make_trainer();
  EXPECT_TRUE(released({"lt-07"}, "", ""));
}

TEST_F(TrainerTest, ABatchStaysInQuarantineWhereItsModelIsJudgedAndFoundNotBetter) {
  start();
  train("lt-07", {.poses = 200});
  const JobProgress kept_out = train("lt-08", {.poses = 200, .noise = 2e-3, .seed = 5});
  ASSERT_EQ(trainer_->quarantined("")->size(), 1u) << kept_out.what;
  const auto job = trainer_->retrain("cell-7", {"lt-08"}, "", "", Trainer::Quarantine::kReleased);
  ASSERT_TRUE(job) << job.error().message;
  const JobProgress done = watch_.wait_until_finished(*job);
  EXPECT_FALSE(done.in_force) << done.what;
  EXPECT_NE(done.what.find("lt-08 stays there"), std::string::npos) << done.what;
  EXPECT_EQ(trainer_->quarantined("")->size(), 1u);
  ASSERT_FALSE(trainer_->activate("cell-7", done.model_version))
      << "it is worse on what was measured";
  ASSERT_TRUE(trainer_->activate("cell-7", done.model_version, {}, true))
      << "a person may know better";
  EXPECT_TRUE(trainer_->quarantined("")->empty());
}

TEST_F(TrainerTest, AModelOfOldMeasurementsIsAsOldAsTheyAre) {
  const std::int64_t yesterday = 1'600'000'000;
  const auto stored = [&](const std::string& id, std::int64_t accepted_at,
                          const std::string& text) {
    StoredJob job;
    job.cell = "cell-7";
    job.batch_ids = {id};
    const auto added =
        store_->add_batch({"cell-7", id, text, sha256_hex(text), id, accepted_at, 40}, job);
    ASSERT_TRUE(added) << added.error().message;
    ASSERT_TRUE(store_->set_job_failed(added->id, "not by itself"));
  };
  std::string timed = csv({.seed = 3});
  int row = 0;
  std::string with_time;
  for (std::size_t at = 0; at < timed.size();) {
    const std::size_t end = timed.find('\n', at);
    with_time += timed.substr(at, end - at) +
                 (row == 0 ? ",time_s\n" : fmt::format(",{}\n", 1'500'000'000 + row));
    at = end + 1;
    ++row;
  }
  stored("old", yesterday, csv());
  stored("older", yesterday - 1000, csv({.seed = 2}));
  stored("timed", yesterday, with_time);
  start();
  const auto measured_at = [this](const JobProgress& done) {
    EXPECT_EQ(done.stage, JobStage::kDone) << done.what;
    return store_->model("cell-7", done.model_version)->provenance().measured_at.value_or(0);
  };
  EXPECT_EQ(measured_at(retrain({"older"})), yesterday - 1000)
      << "when it was received, not when it was trained";
  EXPECT_EQ(measured_at(retrain({"old", "older"})), yesterday) << "the newest of several";
  EXPECT_EQ(measured_at(retrain({"timed"})), 1'500'000'000 + row - 1)
      << "when it was measured, where it says so";
  const std::string exported = serialize(store_->model("cell-7", 1).value());
  ASSERT_TRUE(trainer_->activate("cell-7", 1));
  EXPECT_EQ(registry_->in_force("cell-7")->model.provenance().measured_at, yesterday - 1000);
  EXPECT_EQ(trainer_->import_model("cell-7", exported).value_or(0), 1);
  EXPECT_EQ(store_->models("cell-7")->front().measured_at, yesterday - 1000);
}

TEST_F(TrainerTest, JobsAreListedWithWhatBecameOfThemAndWhen) {
  start();
  train("lt-07");
  test::SmallBatch noisy;
  noisy.noise = 2e-3;
  noisy.seed = 5;
  const JobProgress refused = train("lt-08", noisy);
  trainer_->stop();
  const std::int64_t waiting = submit("lt-09", {.seed = 7});
  const auto jobs = trainer_->jobs("");
  ASSERT_TRUE(jobs) << jobs.error().message;
  ASSERT_EQ(jobs->size(), 3u);
  EXPECT_EQ(jobs->at(0).progress.stage, JobStage::kDone);
  EXPECT_TRUE(jobs->at(0).progress.in_force);
  EXPECT_TRUE(jobs->at(0).asked.started_at && jobs->at(0).asked.finished_at);
  EXPECT_EQ(jobs->at(1).progress.stage, JobStage::kFailed);
  EXPECT_EQ(jobs->at(1).progress.what, refused.what);
  EXPECT_EQ(jobs->at(2).progress.job, waiting);
  EXPECT_EQ(jobs->at(2).progress.stage, JobStage::kQueued);
  EXPECT_EQ(jobs->at(2).asked.batch_ids, std::vector<std::string>{"lt-09"});
  EXPECT_FALSE(jobs->at(2).asked.started_at);
}

/// The same batch with orientations, under a wxyz header in that order or in xyzw.
std::string with_orientations(const std::string& csv, const Cell& cell, bool in_xyzw_order) {
  auto batch = parse_batch_csv(csv, "batch.csv");
  EXPECT_TRUE(batch);
  for (Measurement& m : batch->measurements) {
    const Eigen::Quaterniond q(
        (cell.robot.flange_pose(m.context.q) * *cell.tools.begin()->second).linear());
    m.R_WT = in_xyzw_order ? Eigen::Quaterniond(q.x(), q.y(), q.z(), q.w()).toRotationMatrix()
                           : q.toRotationMatrix();
  }
  return to_csv(*batch);
}

TEST_F(TrainerTest, OrientationsInAnotherOrderBecomeNoModelNeitherFirstNorLater) {
  start();
  const Cell& cell = *cells_.at("cell-7");
  const auto trained = [&](const std::string& id, std::uint64_t seed, bool in_xyzw_order) {
    const auto job = trainer_->submit(
        "cell-7", id, with_orientations(csv({.seed = seed}), cell, in_xyzw_order), id);
    EXPECT_TRUE(job) << job.error().message;
    return watch_.wait_until_finished(job.value_or(0));
  };
  const JobProgress first = trained("lt-07", 1, true);
  EXPECT_EQ(first.stage, JobStage::kFailed);
  EXPECT_NE(first.what.find("read as xyzw they would fit to 0."), std::string::npos) << first.what;
  EXPECT_EQ(in_force(), 0);
  const JobProgress good = trained("lt-08", 2, false);
  EXPECT_EQ(good.stage, JobStage::kDone);
  ASSERT_EQ(in_force(), 1) << good.what;
  const JobProgress later = trained("lt-09", 3, true);
  EXPECT_EQ(later.stage, JobStage::kFailed);
  EXPECT_NE(later.what.find("quarantine"), std::string::npos) << later.what;
  EXPECT_NE(later.what.find("xyzw order? another tool frame?"), std::string::npos) << later.what;
  EXPECT_EQ(trainer_->quarantined("cell-7")->back().id, "lt-09");
  EXPECT_EQ(in_force(), 1);
}

TEST_F(TrainerTest, ABatchOfATrackerThatWasSetUpElsewhereIsLearnedFromAndSaysSo) {
  start();
  train("lt-07");
  test::SmallBatch elsewhere;
  elsewhere.base_shift = 0.5;
  elsewhere.seed = 5;
  const JobProgress done = train("lt-08", elsewhere);
  EXPECT_EQ(done.stage, JobStage::kDone) << done.what;
  EXPECT_TRUE(done.in_force) << done.what;
  EXPECT_NE(done.what.find("stands elsewhere"), std::string::npos) << done.what;
}

TEST_F(TrainerTest, AnUnknownJobIsNotFound) {
  EXPECT_EQ(trainer_->progress(77).error().code, ErrorCode::kNotFound);
}

}  // namespace
}  // namespace trammel
