// What a service goes on doing when its disk or its store is at fault.
#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <optional>

#include "server/base/hash.h"
#include "server/compensate/model_file.h"
#include "server/trainer/trainer.h"
#include "tests/support/demand.h"
#include "tests/support/faulty_disk.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

using test::demand;

constexpr std::chrono::seconds kFaultsLimit{60};

class TrainerFaults : public testing::Test {
 protected:
  void start(std::size_t budget = ModelRegistry::kNoLimit) {
    store_ = demand(Store::open(path_));
    registry_ = std::make_unique<ModelRegistry>(budget);
    trainer_ = std::make_unique<Trainer>(cells_, *store_, *registry_, TrainerOptions{});
    trainer_->set_listeners(
        [this](const JobProgress& progress) { tell([&] { reports_.push_back(progress); }); },
        [](const ServedModel&, bool) {},
        [this](const std::string& trouble, bool over) {
          tell([&] { troubles_.emplace_back(trouble, over); });
        });
    notices_ = demand(trainer_->start());
  }
  void stop() {
    trainer_.reset();
    registry_.reset();
    store_.reset();
  }
  template <typename Note>
  void tell(const Note& note) {
    const std::lock_guard lock(mutex_);
    note();
    changed_.notify_all();
  }
  template <typename Ready>
  bool wait_for(const Ready& ready) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, kFaultsLimit, ready);
  }
  bool waits_until(std::int64_t job, JobStage stage, const std::string& what = "") {
    return wait_for([&] {
      return std::any_of(reports_.begin(), reports_.end(), [&](const JobProgress& one) {
        return one.job == job && one.stage == stage && one.what.find(what) != std::string::npos;
      });
    });
  }
  bool hears(const std::string& part, bool over) {
    return wait_for([&] {
      return std::any_of(troubles_.begin(), troubles_.end(), [&](const auto& one) {
        return one.second == over && one.first.find(part) != std::string::npos;
      });
    });
  }
  Result<std::int64_t> submit(const std::string& id, std::uint64_t seed = 1) {
    return trainer_->submit(
        "cell-7", id, test::small_batch_csv(*cells_.at("cell-7"), {.seed = seed}), "client:" + id);
  }
  int served(const std::string& cell = "cell-7") {
    const auto model = registry_->in_force(cell);
    return model ? model->version : 0;
  }
  void damage(const std::string& which) {
    SQLite::Database(path_, SQLite::OPEN_READWRITE)
        .exec("UPDATE models SET content = 'damaged' WHERE " + which);
    std::filesystem::remove_all(path_ + ".models");
  }
  void add_models(const std::string& cell, int count) {
    const auto store = demand(Store::open(path_));
    for (int i = 1; i <= count; ++i)
      ASSERT_TRUE(store->add_model(cell, test::nominal_model(cells_.at(cell), i), 0, true, ""));
  }

  test::TemporaryFolder folder_;
  const std::string path_ = folder_.file("trammel.db");
  ServedCells cells_ = {{"cell-7", test::small_cell("cell-7")},
                        {"cell-8", test::small_cell("cell-8")}};
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<JobProgress> reports_;                    // guarded by mutex_
  std::vector<std::pair<std::string, bool>> troubles_;  // guarded by mutex_
  std::vector<std::string> notices_;
  std::optional<test::FaultyDisk> disk_;
  std::unique_ptr<Store> store_;
  std::unique_ptr<ModelRegistry> registry_;
  std::unique_ptr<Trainer> trainer_;
};

TEST_F(TrainerFaults, AJobThatTheDiskStoppedAndThoseBehindItAreDoneOnceThereIsRoom) {
  test::FaultyDisk& disk = disk_.emplace();
  start();
  std::vector<std::int64_t> jobs;
  disk.set_plan([](test::FaultyDisk::Call, const std::string&) { return SQLITE_OK; });
  for (const char* id : {"a", "b", "c"}) jobs.push_back(demand(submit(id, jobs.size() + 1)));
  disk.refuse_writing(SQLITE_FULL);
  const auto refused = submit("d", 9);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kBusy);
  EXPECT_TRUE(hears("cannot be written", false)) << "it is said";
  disk.work_again();
  for (const std::int64_t job : jobs) EXPECT_TRUE(waits_until(job, JobStage::kDone));
  EXPECT_TRUE(hears("cannot be written", true));
  EXPECT_TRUE(submit("d", 9));
  for (const JobProgress& one : reports_) EXPECT_NE(one.stage, JobStage::kFailed) << one.what;
}

TEST_F(TrainerFaults, AServiceThatStartsOnAFullDiskServesAndLearnsOnceThereIsRoom) {
  test::FaultyDisk& disk = disk_.emplace();
  add_models("cell-7", 2);
  disk.refuse_writing(SQLITE_FULL);
  start();
  EXPECT_EQ(served(), 2);
  EXPECT_FALSE(submit("a"));
  disk.work_again();
  EXPECT_TRUE(hears("cannot be written", true)) << "it is tried again by itself";
  const auto job = submit("a");
  ASSERT_TRUE(job) << sentence(job.error());
  EXPECT_TRUE(waits_until(*job, JobStage::kDone));
}

TEST_F(TrainerFaults, WhereTheRightStoreIsPutBackItIsServedAndItsJobsAreDoneWithoutARestart) {
  add_models("cell-7", 2);
  {
    const auto store = demand(Store::open(path_));
    const std::string csv = test::small_batch_csv(*cells_.at("cell-7"), {});
    StoredJob job;
    job.cell = "cell-7";
    job.batch_ids = {"a"};
    ASSERT_TRUE(store->add_batch({"cell-7", "a", csv, sha256_hex(csv), "client:a", 1, 40}, job));
  }
  const std::string good = test::read_file(path_);
  std::ofstream(path_, std::ios::binary) << std::string(20'000, 'x');
  start();
  EXPECT_EQ(served(), 2);
  EXPECT_FALSE(submit("b", 2));
  std::ofstream(path_, std::ios::binary) << good;
  EXPECT_TRUE(hears("cannot be written", true));
  EXPECT_TRUE(waits_until(1, JobStage::kDone));
}

TEST_F(TrainerFaults, WhereTheModelInForceIsDamagedTheNewestGoodOneIsServedAndThatIsSaid) {
  add_models("cell-7", 3);
  add_models("cell-8", 1);
  damage("cell = 'cell-7' AND version > 1");
  start();
  EXPECT_EQ(served("cell-7"), 1);
  EXPECT_EQ(served("cell-8"), 1);
  ASSERT_EQ(notices_.size(), 1u);
  EXPECT_NE(notices_.front().find("cell-7: version 1 is served instead"), std::string::npos)
      << notices_.front();
  ASSERT_TRUE(trainer_->activate("cell-7", 1));
  EXPECT_TRUE(trainer_->activate("cell-8", 1));
}

TEST_F(TrainerFaults, ACellWithoutAnyGoodModelIsDarkAndTheOthersAreNot) {
  add_models("cell-7", 2);
  add_models("cell-8", 1);
  damage("cell = 'cell-7'");
  start();
  EXPECT_EQ(served("cell-7"), 0);
  EXPECT_EQ(served("cell-8"), 1);
  ASSERT_EQ(notices_.size(), 1u);
  EXPECT_NE(notices_.front().find("cell-7 is not served"), std::string::npos) << notices_.front();
}

TEST_F(TrainerFaults, ModelsThatDoNotFitTheMemoryAreLoadedAgainWhenTheyAreAskedFor) {
  add_models("cell-7", 2);
  add_models("cell-8", 1);
  start(1);  // byte: one model at a time
  for (int round = 0; round < 3; ++round) {
    EXPECT_EQ(served("cell-7"), 2);
    EXPECT_EQ(served("cell-8"), 1);
    EXPECT_EQ(registry_->all().size(), 1u);
    EXPECT_EQ(registry_->cells_served(), 2u);
  }
  // The keeper may have fetched it again by itself.
  const auto asked = registry_->ready("cell-7");
  EXPECT_TRUE(asked.comes || asked.model) << "who may not wait is told so";
}

TEST_F(TrainerFaults, ActivatingWhatIsServedPublishesNothing) {
  add_models("cell-7", 2);
  start();
  const auto before = registry_->in_force("cell-7");
  ASSERT_TRUE(trainer_->activate("cell-7", 2));
  EXPECT_EQ(registry_->in_force("cell-7"), before);
}

TEST_F(TrainerFaults, AChangeThatExpectsAnotherModelInForceIsRefusedAndARepeatedOneIsNot) {
  add_models("cell-7", 3);
  start();
  const ChangeId request{"robot-3:1", "activate 1", "", "", 3};
  ASSERT_TRUE(trainer_->activate("cell-7", 1, request));
  EXPECT_EQ(served(), 1);
  stop();
  start();
  EXPECT_TRUE(trainer_->activate("cell-7", 1, request)) << "it is done already";
  const auto other = trainer_->rollback("cell-7", {"robot-3:2", "rollback", "", "", 3});
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().code, ErrorCode::kConflict);
  EXPECT_EQ(demand(trainer_->rollback("cell-7", {"robot-3:3", "rollback", "", "", 1})), 3);
  stop();
  start();
  EXPECT_EQ(demand(trainer_->rollback("cell-7", {"robot-3:3", "rollback", "", "", 1})), 3);
  EXPECT_EQ(served(), 3) << "once";
}

}  // namespace
}  // namespace trammel
