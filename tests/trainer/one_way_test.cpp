// How often the text of a batch is read on its way: parsed, checked and split.
#include <gtest/gtest.h>

#include <map>
#include <mutex>

#include "tests/support/demand.h"
#include "tests/support/learning_cell.h"
#include "tests/support/small_cell.h"

namespace trammel {
namespace {

constexpr int kOnce = 1;
constexpr int kOnceEach = 2;  // when it is accepted, and when its turn comes: meanwhile the store
                              // alone has it

using Reads = std::map<std::string, int>;  // by batch id

class OneWay : public testing::Test {
 protected:
  OneWay() : cell_(test::small_cell("cell-7")), learning_(cell_, counting()) {}
  TrainerOptions counting() {
    TrainerOptions options;
    options.compute.reads = [this](const std::string& batch) {
      const std::lock_guard lock(mutex_);
      ++reads_[batch];
    };
    return options;
  }
  /// Since the last look.
  Reads seen() {
    const std::lock_guard lock(mutex_);
    return std::exchange(reads_, {});
  }
  JobProgress submit(const test::SmallBatch& batch, const std::string& name) {
    MeasurementBatch measured =
        test::demand(parse_batch_csv(test::small_batch_csv(*cell_, batch), name));
    static_cast<void>(seen());
    return learning_.submit(std::move(measured));
  }
  static int of(const Reads& all, const std::string& batch) {
    return all.contains(batch) ? all.at(batch) : 0;
  }

  std::mutex mutex_;
  Reads reads_;  // guarded by mutex_
  std::shared_ptr<const Cell> cell_;
  test::LearningCell learning_;
};

TEST_F(OneWay, ABatchIsReadOnceAsItIsAcceptedAndOnceOnItsWayToTheModelInForce) {
  const JobProgress first = submit({.poses = 120}, "a");
  ASSERT_TRUE(first.in_force) << first.what;
  EXPECT_EQ(of(seen(), "day-1"), kOnceEach);
}

TEST_F(OneWay, ABatchThatMeetsAModelInForceIsTooAndEachBatchThatJudgesIsOnce) {
  submit({.poses = 120}, "a");
  const JobProgress second = submit({.poses = 120, .noise = 10e-6, .seed = 2}, "b");
  ASSERT_EQ(second.stage, JobStage::kDone) << second.what;
  ASSERT_EQ(second.model_version, 2);
  const auto all = seen();
  EXPECT_EQ(of(all, "day-2"), kOnceEach);
  EXPECT_EQ(of(all, "day-1"), kOnce) << "it judges";
}

TEST_F(OneWay, BatchesThatAreTrainedAgainTogetherAreEachReadOnce) {
  submit({.poses = 120}, "a");
  submit({.poses = 120, .noise = 10e-6, .seed = 2}, "b");
  static_cast<void>(seen());
  const JobProgress again = learning_.finished(
      test::demand(learning_.trainer().retrain("cell-7", {"day-1", "day-2"}, "", "")));
  ASSERT_EQ(again.stage, JobStage::kDone) << again.what;
  const auto all = seen();
  EXPECT_EQ(of(all, "day-1"), kOnce);
  EXPECT_EQ(of(all, "day-2"), kOnce);
}

TEST_F(OneWay, ADiagnosisThatIsAppliedReadsItsBatchOnce) {
  submit({.poses = 120}, "a");
  static_cast<void>(seen());
  const JobProgress done =
      learning_.finished(test::demand(learning_.trainer().diagnose("cell-7", "day-1", "", true)));
  ASSERT_EQ(done.stage, JobStage::kDone) << done.what;
  EXPECT_EQ(of(seen(), "day-1"), kOnce);
}

TEST_F(OneWay, ABatchThatIsSentToBeDiagnosedIsReadAsItIsAcceptedAndOnItsTurn) {
  const std::string csv = test::small_batch_csv(*cell_, {.poses = 60});
  static_cast<void>(seen());
  const JobProgress done =
      learning_.finished(test::demand(learning_.trainer().diagnose("cell-7", "", csv, false)));
  ASSERT_EQ(done.stage, JobStage::kDone) << done.what;
  const auto all = seen();
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all.begin()->second, kOnceEach);
}

}  // namespace
}  // namespace trammel
