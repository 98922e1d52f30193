#include "server/plan/travel.h"

#include <gtest/gtest.h>

#include <set>

#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

Plan planned(bool bidirectional, std::vector<std::string> payloads = {}) {
  Cell cell = *test::cell_7();
  cell.payloads["empty"] = Payload{};
  PlanOptions options{60, 3};
  options.bidirectional = bidirectional;
  options.payloads = payloads.empty() ? std::vector<std::string>{"spindle"} : payloads;
  return make_plan(std::make_shared<const Cell>(cell), options).value();
}

TEST(Travel, IsMuchShorterInOrderAndNoPoseIsLost) {
  const Chain robot = test::cell_7()->robot;
  const Plan plan = planned(false);
  const Plan ordered = ordered_for_travel(robot, plan);
  EXPECT_LT(travel_of(robot, ordered), 0.7 * travel_of(robot, plan));
  EXPECT_EQ(ordered.poses[0].id, plan.poses[0].id);
  std::set<std::string> before, after;
  for (const PlannedPose& pose : plan.poses) before.insert(pose.id);
  for (const PlannedPose& pose : ordered.poses) after.insert(pose.id);
  EXPECT_EQ(before, after);
  EXPECT_EQ(after.size(), 60u);
}

TEST(Travel, PosesFromBothSidesAndPosesOfOnePayloadStayTogether) {
  const Chain robot = test::cell_7()->robot;
  const Plan ordered = ordered_for_travel(robot, planned(true, {"spindle", "empty"}));
  int changes = 0;
  for (std::size_t i = 0; i < ordered.poses.size(); i += 2) {
    EXPECT_EQ(ordered.poses[i].context.q, ordered.poses[i + 1].context.q);
    if (i > 0 && ordered.poses[i].context.payload != ordered.poses[i - 1].context.payload)
      ++changes;
  }
  EXPECT_EQ(changes, 1);
}

TEST(Travel, AnEmptyPlanAndOneOfOnePoseStay) {
  const Chain robot = test::cell_7()->robot;
  EXPECT_TRUE(ordered_for_travel(robot, Plan{}).poses.empty());
  Plan one = planned(false);
  one.poses.resize(1);
  EXPECT_EQ(ordered_for_travel(robot, one).poses.size(), 1u);
}

}  // namespace
}  // namespace trammel
