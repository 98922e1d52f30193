// The short form of tests/benchmarks/kills_benchmark.cpp.
#include "tests/support/killed_fleet.h"

#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

TEST(KilledFleet, LosesNothingMakesNothingTwiceAndGoesOn) {
  test::KillPlan plan;
  plan.kills = 10;
  plan.seed = 7;
  plan.longest_pause = std::chrono::milliseconds(1200);
  plan.quiet = std::chrono::seconds(1);
  plan.batches = 6;
  const test::TemporaryFolder folder;
  const std::string history = folder.file("history.jsonl");
  const test::KilledFleetOutcome outcome = test::kill_a_fleet(plan, history);
  const test::Finished checked = test::check_history(history);
  EXPECT_EQ(checked.exit_code, 0) << checked.out << checked.err;
  EXPECT_GT(outcome.predictions, 0);
  EXPECT_EQ(outcome.failed, 0);
  EXPECT_EQ(outcome.served_otherwise, 0) << "what is in force is served by all in the end";
  EXPECT_EQ(outcome.ended_by_themselves, 0) << "a server that waits for a processor does not hang";
  EXPECT_TRUE(outcome.trail_whole);
}

}  // namespace
}  // namespace trammel
