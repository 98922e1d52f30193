#include "server/registry/model_registry.h"

#include <gtest/gtest.h>
#include <time.h>

#include <atomic>
#include <thread>

#include "tests/support/small_cell.h"

namespace trammel {
namespace {

std::shared_ptr<const ServedModel> served(const std::string& cell, int version) {
  return std::make_shared<const ServedModel>(
      ServedModel{cell, version, test::nominal_model(test::small_cell(cell), version)});
}

TEST(ModelRegistry, HasNothingInForceBeforeAnythingIsPublished) {
  const ModelRegistry registry;
  EXPECT_EQ(registry.in_force("cell-7"), nullptr);
  EXPECT_TRUE(registry.all().empty());
}

TEST(ModelRegistry, KeepsTheModelOfEachCellApart) {
  ModelRegistry registry;
  registry.publish(served("cell-8", 1));
  registry.publish(served("cell-7", 4));
  EXPECT_EQ(registry.in_force("cell-7")->version, 4);
  EXPECT_EQ(registry.in_force("cell-8")->version, 1);
  ASSERT_EQ(registry.all().size(), 2u);
  EXPECT_EQ(registry.all().front()->cell, "cell-7");
}

TEST(ModelRegistry, AReaderKeepsItsModelWhileAnotherIsPublished) {
  ModelRegistry registry;
  registry.publish(served("cell-7", 1));
  const auto mine = registry.in_force("cell-7");
  registry.publish(served("cell-7", 2));
  EXPECT_EQ(mine->version, 1);
  EXPECT_EQ(mine->model.provenance().training_poses, 1);
  EXPECT_EQ(registry.in_force("cell-7")->version, 2);
}

/// Processor time of this thread, s.
double processor_time() {
  timespec used{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
  return static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
}

TEST(ModelRegistry, AVersionThatIsInMemoryWhenItIsAnnouncedKeepsNobodyBusy) {
  ModelRegistry registry;
  registry.publish(served("cell-7", 1));
  registry.announce("cell-7", 1);
  const double before = processor_time();
  registry.load_for({}, std::chrono::milliseconds(200));
  EXPECT_LT(processor_time() - before, 0.1);
  EXPECT_EQ(registry.in_force("cell-7")->version, 1);
}

TEST(ModelRegistry, EveryReaderSeesAWholeModelWhileTheyAreSwapped) {
  ModelRegistry registry;
  const auto one = served("cell-7", 1);
  const auto two = served("cell-7", 2);
  registry.publish(one);
  std::atomic<int> torn = 0;
  std::atomic<long> reads = 0;
  {
    std::vector<std::jthread> readers;
    for (int i = 0; i < 2; ++i) {
      readers.emplace_back([&](const std::stop_token& stop) {
        while (!stop.stop_requested()) {
          const auto model = registry.in_force("cell-7");
          if (model->version != model->model.provenance().training_poses) ++torn;
          ++reads;
        }
      });
    }
    for (int i = 0; i < 1000 || reads < 1000; ++i) registry.publish(i % 2 == 0 ? two : one);
  }
  EXPECT_EQ(torn, 0);
}

}  // namespace
}  // namespace trammel
