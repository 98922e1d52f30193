// Who waits for whom: while one cell's model is judged, or put in force, nobody else does. A
// listener holds either up.
#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <future>
#include <map>
#include <mutex>

#include "server/trainer/trainer.h"
#include "tests/support/demand.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

constexpr std::chrono::seconds kWaitingLimit{60};

/// A place that the first who comes by while it is shut waits at.
class Gate {
 public:
  void shut() {
    const std::lock_guard lock(mutex_);
    shut_ = true;
    waiting_ = 0;
  }
  void open() {
    {
      const std::lock_guard lock(mutex_);
      shut_ = false;
    }
    changed_.notify_all();
  }
  void pass() {
    std::unique_lock lock(mutex_);
    ++passed_;
    if (!shut_ || waiting_ > 0) return;
    ++waiting_;
    changed_.notify_all();
    changed_.wait(lock, [this] { return !shut_; });
  }
  [[nodiscard]] bool somebody_waits() {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, kWaitingLimit, [this] { return waiting_ > 0; });
  }
  [[nodiscard]] int passed() {
    const std::lock_guard lock(mutex_);
    return passed_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool shut_ = false;
  int waiting_ = 0, passed_ = 0;
};

class Waiting : public testing::Test {
 protected:
  Waiting() : store_(test::demand(Store::open(folder_.file("trammel.db")))) {
    trainer_ = std::make_unique<Trainer>(cells_, *store_, registry_, TrainerOptions{});
    trainer_->set_listeners([this](const JobProgress& progress) { heard(progress); },
                            [this](const ServedModel& model, bool) {
                              if (model.cell == "cell-7") publishing_.pass();
                            });
    static_cast<void>(test::demand(trainer_->start()));
  }
  ~Waiting() override {
    judging_.open();
    publishing_.open();
  }

  void heard(const JobProgress& progress) {
    if (progress.stage == JobStage::kStoring && progress.what == kJudging) judging_.pass();
    if (progress.stage != JobStage::kDone && progress.stage != JobStage::kFailed) return;
    const std::lock_guard lock(mutex_);
    finished_[progress.job] = progress;
    changed_.notify_all();
  }
  JobProgress finished(std::int64_t job) {
    std::unique_lock lock(mutex_);
    EXPECT_TRUE(changed_.wait_for(lock, kWaitingLimit, [&] { return finished_.contains(job); }));
    return finished_[job];
  }
  std::int64_t submit(const std::string& cell, const std::string& id, std::uint64_t seed = 1) {
    const std::string csv = test::small_batch_csv(*cells_.at(cell), {.poses = 120, .seed = seed});
    return test::demand(trainer_->submit(cell, id, csv, "client:" + id));
  }
  /// Two versions of each cell.
  void train_all() {
    for (const char* cell : {"cell-7", "cell-8"}) {
      ASSERT_TRUE(finished(submit(cell, "first")).in_force);
      ASSERT_EQ(finished(submit(cell, "second", 2)).model_version, 2);
    }
  }
  /// Whether `change` ends well while something else is held up; else that is let go.
  template <typename Change>
  bool ends(const Change& change) {
    auto done = std::async(std::launch::async, [&] { return change().has_value(); });
    const bool in_time = done.wait_for(kWaitingLimit) == std::future_status::ready;
    if (!in_time) {
      judging_.open();
      publishing_.open();
    }
    return done.get() && in_time;
  }

  test::TemporaryFolder folder_;
  ServedCells cells_ = {{"cell-7", test::small_cell("cell-7")},
                        {"cell-8", test::small_cell("cell-8")}};
  std::unique_ptr<Store> store_;
  ModelRegistry registry_;
  Gate judging_;
  Gate publishing_;  // of models of cell-7
  std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::int64_t, JobProgress> finished_;  // guarded by mutex_
  std::unique_ptr<Trainer> trainer_;
};

TEST_F(Waiting, AModelOfAnyCellCanBePutInForceWhileAnotherOneIsJudged) {
  train_all();
  judging_.shut();
  const std::int64_t third = submit("cell-7", "third", 3);
  ASSERT_TRUE(judging_.somebody_waits());
  EXPECT_TRUE(ends([&] { return trainer_->activate("cell-8", 2); }));
  EXPECT_EQ(registry_.in_force("cell-8")->version, 2);
  EXPECT_TRUE(ends([&] { return trainer_->rollback("cell-8"); }));
  EXPECT_EQ(registry_.in_force("cell-8")->version, 1);
  EXPECT_TRUE(ends([&] { return trainer_->activate("cell-7", 2); }))
      << "its own cell does not wait either";
  EXPECT_TRUE(ends([&] { return trainer_->progress(third); }));
  EXPECT_TRUE(ends([&] {
    return trainer_->submit("cell-8", "third",
                            test::small_batch_csv(*cells_.at("cell-8"), {.seed = 3}), "client:3");
  }));
  const int before = judging_.passed();
  judging_.open();
  EXPECT_EQ(finished(third).stage, JobStage::kDone);
  EXPECT_GT(judging_.passed(), before)
      << "what is in force has changed meanwhile: it is judged against that";
}

TEST_F(Waiting, AModelOfOneCellCanBePutInForceWhileThatOfAnotherIsPublished) {
  train_all();
  publishing_.shut();
  auto activated =
      std::async(std::launch::async, [&] { return trainer_->activate("cell-7", 2).has_value(); });
  ASSERT_TRUE(publishing_.somebody_waits());
  EXPECT_EQ(registry_.in_force("cell-7")->version, 2) << "it serves already";
  const bool other = ends([&] { return trainer_->activate("cell-8", 2); });
  EXPECT_TRUE(other);
  publishing_.open();
  EXPECT_TRUE(activated.get());
  EXPECT_EQ(registry_.in_force("cell-8")->version, 2);
}

}  // namespace
}  // namespace trammel
