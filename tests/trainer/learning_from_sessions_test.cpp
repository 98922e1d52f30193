#include <gtest/gtest.h>

#include "server/compensate/model_file.h"
#include "tests/support/demand.h"
#include "tests/support/learning_cell.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Day;
using test::LearningCell;
using test::measured_on;
using test::true_error;

/// cell-7 without a bias: what is asked here is what sessions do to the physics.
std::shared_ptr<const Cell> cell_of(const SessionRule& rule = {}) {
  auto cell = std::make_shared<Cell>(*test::cell_7());
  cell->model.bias = "none";
  cell->sessions = rule;
  cell->cell_yaml += rule.kind == SessionRule::Kind::kLast
                         ? fmt::format("sessions: {{last: {}}}\n", rule.count)
                         : "";
  return cell;
}

TEST(LearningFromSessions, ACellLearnsFromAllOfThem) {
  const auto cell = cell_of();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  LearningCell learning(cell);
  learning.submit(measured_on(robot, {.poses = 60, .seed = 1}));
  const double first = true_error(learning.model(), robot);
  for (std::uint64_t day = 2; day <= 4; ++day)
    learning.submit(measured_on(robot, {.poses = 60, .seed = day, .set_up_anew = true}));
  EXPECT_LT(true_error(learning.model(), robot), first);
  const CompensatedModel& newest = learning.version(4);
  EXPECT_EQ(newest.parts().sessions.size(), 4u);
  EXPECT_EQ(newest.provenance().batch_id, "day-1+day-2+day-3+day-4");
}

TEST(LearningFromSessions, OrFromTheLastOnes) {
  const auto cell = cell_of({SessionRule::Kind::kLast, 2});
  const VirtualRobot robot = test::chapter_5_robot(cell);
  LearningCell learning(cell);
  for (std::uint64_t day = 1; day <= 3; ++day)
    learning.submit(measured_on(robot, {.poses = 60, .seed = day, .set_up_anew = true}));
  const CompensatedModel& newest = learning.version(3);
  EXPECT_EQ(newest.provenance().batch_id, "day-2+day-3");
}

TEST(LearningFromSessions, AZeroThatWasLostGoesInForceAndIsDated) {
  const auto cell = cell_of();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const VirtualRobot after = test::with_zero_off(robot, 3, 1e-3);
  LearningCell learning(cell);
  learning.submit(measured_on(robot, {.poses = 200, .seed = 1}));
  const double before = true_error(learning.model(), after);
  const JobProgress end =
      learning.submit(measured_on(after, {.poses = 110, .seed = 2, .set_up_anew = true}));
  EXPECT_TRUE(end.in_force) << end.what;
  EXPECT_LT(true_error(learning.model(), after), 0.02 * before);
  ASSERT_EQ(learning.model().parts().changes.size(), 1u);
  EXPECT_EQ(learning.model().parts().sessions[learning.model().parts().changes.front().session].id,
            "day-2");
}

TEST(LearningFromSessions, AnImportedModelThatIsWorseIsPutInForceByForceOnly) {
  const auto cell = cell_of();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  LearningCell learning(cell), elsewhere(cell);
  learning.submit(measured_on(robot, {.poses = 200, .seed = 1}));
  elsewhere.submit(measured_on(robot, {.poses = 40, .seed = 2, .noise = 6}));
  const int version =
      test::demand(learning.trainer().import_model("cell-7", serialize(elsewhere.model())));
  const Status refused = learning.trainer().activate("cell-7", version);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("mm before (version 1)"), std::string::npos)
      << refused.error().message;
  EXPECT_NE(refused.error().next.find("--force"), std::string::npos);
  EXPECT_EQ(refused.error().field, "after_mm");
  ASSERT_TRUE(refused.error().value && refused.error().limit) << "the figures as data";
  EXPECT_GT(*refused.error().value, *refused.error().limit);
  EXPECT_EQ(learning.in_force(), 1);
  ASSERT_TRUE(learning.trainer().activate("cell-7", version, {}, true));
  EXPECT_EQ(learning.in_force(), version);
}

TEST(LearningFromSessions, AnOlderVersionThatIsWorseThanTheOneInForceIsPutInForceByForceOnly) {
  const auto cell = cell_of();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  LearningCell learning(cell);
  learning.submit(measured_on(robot, {.poses = 60, .seed = 1, .noise = 6}));
  const JobProgress newer = learning.submit(measured_on(robot, {.poses = 300, .seed = 2}));
  ASSERT_TRUE(newer.in_force) << newer.what;
  const Status refused = learning.trainer().activate("cell-7", 1);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().field, "after_mm");
  ASSERT_TRUE(refused.error().value && refused.error().limit) << "the figures as data";
  EXPECT_GT(*refused.error().value, *refused.error().limit);
  for (const char* part : {"worse than version 2, which is in force", "the newest is day-2"})
    EXPECT_NE(refused.error().message.find(part), std::string::npos) << refused.error().message;
  EXPECT_EQ(learning.in_force(), 2);
  ASSERT_TRUE(learning.trainer().activate("cell-7", 1, {}, true));
  EXPECT_EQ(learning.in_force(), 1);
  EXPECT_TRUE(learning.trainer().activate("cell-7", 2)) << "back to the better one needs no force";
}

TEST(LearningFromSessions, AnImportedModelThatIsBetterNeedsNoForce) {
  const auto cell = cell_of();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  LearningCell learning(cell), elsewhere(cell);
  learning.submit(measured_on(robot, {.poses = 120, .seed = 1, .noise = 3}));
  elsewhere.submit(measured_on(robot, {.poses = 300, .seed = 2}));
  const int version =
      test::demand(learning.trainer().import_model("cell-7", serialize(elsewhere.model())));
  EXPECT_TRUE(learning.trainer().activate("cell-7", version));
}

TEST(LearningFromSessions, AnImportedModelOfAFewPosesIsPutInForceByForceOnly) {
  const auto cell = cell_of();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  LearningCell learning(cell), elsewhere(cell);
  learning.submit(measured_on(robot, {.poses = 100, .seed = 1}));
  elsewhere.submit(measured_on(robot, {.poses = 6, .seed = 2, .corner = 0.2}));
  const int version =
      test::demand(learning.trainer().import_model("cell-7", serialize(elsewhere.version(1))));
  const Status refused = learning.trainer().activate("cell-7", version);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().next.find("--force"), std::string::npos);
  EXPECT_EQ(learning.in_force(), 1);
}

TEST(LearningFromSessions, AFirstBatchOfSeveralSetUpsIsJudgedInEachOfThem) {
  const auto cell = cell_of();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    MeasurementBatch all;
    for (int s = 0; s < 3; ++s) {
      const Day day{
          .poses = 60, .seed = 100 * seed + static_cast<std::uint64_t>(s), .set_up_anew = s < 2};
      MeasurementBatch part = measured_on(robot, day);
      for (Measurement& m : part.measurements) {
        m.session_id = fmt::format("set-up {}", s);
        m.pose_id = fmt::format("{}-{}", s, m.pose_id);
        all.measurements.push_back(m);
      }
    }
    LearningCell learning(cell);
    const JobProgress end = learning.submit(all);
    EXPECT_TRUE(end.in_force) << end.what;
    ASSERT_TRUE(end.outcome.before && end.outcome.after) << end.what;
    EXPECT_LT(*end.outcome.before, 0.05) << end.what;
    EXPECT_LT(*end.outcome.after, 1e-4) << end.what;
  }
}

}  // namespace
}  // namespace trammel
