#include <gtest/gtest.h>

#include <algorithm>

#include "server/store/store.h"
#include "tests/support/daemon.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using client::JobStatus;

constexpr std::chrono::seconds kCrashLimit{120};
const client::CallContext kContext = [] {
  client::CallContext context;
  context.cell = "cell-7";
  return context;
}();
constexpr int kPosesFirst = 40;
constexpr int kPosesSecond = 300;

class CrashTest : public testing::Test {
 protected:
  void SetUp() override {
    daemon_.start();
    auto opened = client::Session::open(daemon_.session_options());
    ASSERT_TRUE(opened) << opened.error().message;
    session_ = std::move(*opened);
    const JobStatus first = train("first", first_csv_);
    ASSERT_TRUE(first.in_force) << first.what;
    first_id_ = model().id;
  }
  std::int64_t submit(const std::string& id, const std::string& csv) {
    const auto job = session_->submit_measurements("cell-7", id, csv);
    EXPECT_TRUE(job) << job.error().message;
    return job.value_or(0);
  }
  JobStatus wait_for(std::int64_t job,
                     const std::function<void(const JobStatus&)>& listener = nullptr) {
    const auto over = session_->wait_for_job(job, kCrashLimit, listener);
    EXPECT_TRUE(over) << over.error().message;
    return over.value_or(JobStatus{});
  }
  JobStatus train(const std::string& id, const std::string& csv) {
    return wait_for(submit(id, csv));
  }
  exchange::ModelInfo model() {
    const auto answer = session_->predict_error(kContext, test::virtual_joints(3, 7));
    EXPECT_TRUE(answer) << answer.error().message;
    return answer ? answer->model : exchange::ModelInfo{};
  }
  void crash_and_start() {
    daemon_.kill();
    daemon_.start();
  }
  /// The job in the store of a service that is not running.
  StoredJob stored(std::int64_t job) {
    return Store::open(daemon_.store_path()).value()->job(job).value();
  }
  /// The first model, or the second once it was put in force: nothing else ever answers.
  void expect_a_whole_model() {
    const exchange::ModelInfo now = model();
    if (now.version == 1) {
      EXPECT_EQ(now.id, first_id_);
    } else {
      EXPECT_EQ(now.version, 2);
      EXPECT_EQ(now.batch_id, "first+second");
    }
  }
  /// With the service stopped: everything accepted is there, and everything is finished.
  void expect_nothing_lost(std::int64_t second_job) {
    EXPECT_EQ(daemon_.stop(), 0);
    const auto store = Store::open(daemon_.store_path());
    ASSERT_TRUE(store) << store.error().message;
    EXPECT_EQ((*store)->batch("cell-7", "first")->csv, first_csv_);
    const auto second = (*store)->batch("cell-7", "second");
    ASSERT_TRUE(second) << second.error().message;
    EXPECT_EQ(second->csv, second_csv_);
    EXPECT_TRUE((*store)->unfinished_jobs()->empty());
    EXPECT_EQ((*store)->models("cell-7")->size(), 2u) << "the training of a job counts once";
    EXPECT_EQ((*store)->job(second_job)->model_version, 2);
  }

  const std::string first_csv_ = test::virtual_batch_csv(kPosesFirst, 1);
  const std::string second_csv_ = test::virtual_batch_csv(kPosesSecond, 2);
  test::Daemon daemon_;
  std::unique_ptr<client::Session> session_;
  std::string first_id_;
};

/// A moment of a retraining, as its watchers see it.
struct Moment {
  const char* name;
  std::string stage;
  double share;
  bool surely_unfinished;  ///< long before the model is stored

  [[nodiscard]] bool reached(const JobStatus& job) const {
    static const std::vector<std::string> order = {"queued", "training", "storing", "done"};
    const auto rank = [](const std::string& s) {
      return std::find(order.begin(), order.end(), s) - order.begin();
    };
    return rank(job.stage) > rank(stage) || (job.stage == stage && job.share >= share);
  }
};

class CrashMomentTest : public CrashTest, public testing::WithParamInterface<Moment> {};

TEST_P(CrashMomentTest, NoAcceptedBatchIsLostAndAWholeModelIsServed) {
  const std::int64_t job = submit("second", second_csv_);
  bool crashed = false;
  const JobStatus over = wait_for(job, [&](const JobStatus& status) {
    if (crashed || !GetParam().reached(status)) return;
    crashed = true;
    daemon_.kill();
    if (GetParam().surely_unfinished) {
      EXPECT_EQ(stored(job).state, JobState::kRunning)
          << "the crash came too late to show anything";
    }
    daemon_.start();
    expect_a_whole_model();
  });
  EXPECT_TRUE(crashed);
  EXPECT_EQ(over.stage, "done") << over.what;
  EXPECT_EQ(over.model_version, 2) << over.what;
  EXPECT_EQ(model().version, 2) << over.what;
  expect_nothing_lost(job);
}

INSTANTIATE_TEST_SUITE_P(Moments, CrashMomentTest,
                         testing::Values(Moment{"TrainingBegins", "training", 0, true},
                                         Moment{"BiasBegins", "training", 0.3, true},
                                         Moment{"BiasHalfDone", "training", 0.55, true},
                                         Moment{"BiasNearlyDone", "training", 0.8, false},
                                         Moment{"Storing", "storing", 0, false},
                                         Moment{"Done", "done", 0, false}),
                         [](const auto& moment) { return moment.param.name; });

TEST_F(CrashTest, ABatchIsSafeAsSoonAsItIsAcknowledged) {
  const std::int64_t job = submit("second", second_csv_);
  crash_and_start();
  expect_a_whole_model();
  EXPECT_EQ(wait_for(job).stage, "done");
  expect_nothing_lost(job);
}

TEST_F(CrashTest, AJobThatIsInterruptedTimeAndAgainFailsAndTheServiceGoesOn) {
  const std::int64_t job = submit("second", second_csv_);
  int interruptions = 0;
  const JobStatus over = wait_for(job, [&](const JobStatus& status) {
    if (status.stage != "training" || interruptions == 3) return;
    daemon_.kill();
    interruptions = stored(job).attempts;
    daemon_.start();
  });
  EXPECT_EQ(interruptions, 3);
  EXPECT_EQ(over.stage, "failed");
  EXPECT_NE(over.what.find("3 times"), std::string::npos) << over.what;
  EXPECT_EQ(model().id, first_id_);
  EXPECT_EQ(train("third", test::virtual_batch_csv(kPosesFirst, 3)).stage, "done");
}

}  // namespace
}  // namespace trammel
