#include "server/compensate/what_was_measured.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>

#include "server/base/hash.h"
#include "server/base/units.h"
#include "server/compensate/model_file.h"
#include "server/compensate/model_notes.h"
#include "server/plan/plan.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using nlohmann::json;
using test::demand;

/// cell-7 that works in front of itself.
std::shared_ptr<const Cell> cell_in_front() {
  auto cell = std::make_shared<Cell>(*test::cell_7());
  cell->workspace = Workspace{{0.9, -1.2, 0.3}, {2.6, 1.2, 2.4}};
  return cell;
}

CompensatedModel trained(const std::shared_ptr<const Cell>& cell, const MeasurementBatch& batch,
                         const std::string& bias = "none") {
  TrainOptions options;
  options.bias = bias;
  return demand(train(cell, demand(check_against_cell(batch, *cell)), options));
}

MeasurementBatch as_measured(const VirtualRobot& robot, std::vector<PoseContext> poses,
                             std::uint64_t seed) {
  SimulateOptions options;
  options.seed = seed;
  MeasurementBatch batch = demand(simulate(robot, poses, options));
  batch.id = "virtual";
  return batch;
}

std::vector<PoseContext> from_one_side(const std::vector<PlannedPose>& plan, int side) {
  std::vector<PoseContext> poses;
  for (const PlannedPose& pose : plan) {
    poses.push_back(pose.context);
    if (side != 0) poses.back().direction.assign(pose.context.direction.size(), side);
  }
  return poses;
}

/// The shipped robot whose second gear has 0.1 mrad of play to each side.
VirtualRobot with_play(const std::shared_ptr<const Cell>& cell) {
  VirtualRobot robot = test::chapter_5_robot(cell);
  const Eigen::Index first =
      add_source(robot.truth, demand(make_error_source("backlash:2", *cell)));
  robot.truth.values(first) = 1e-4;
  return robot;
}

bool has_note(const CompensatedModel& model, const char* code) {
  for (const Note& note : notes_of(model))
    if (note.code == code) return true;
  return false;
}

TEST(WhatWasMeasured, APromiseFromOneSideOfPlayIsSaidToBeOfThatSideAndWouldBeWrongFromTheOther) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = with_play(cell);
  const Plan plan = demand(make_plan(cell, {80, 1}));
  const Plan fresh = demand(make_plan(cell, {40, 2}));
  const CompensatedModel model =
      trained(cell, as_measured(robot, from_one_side(plan.poses, -1), 1));
  EXPECT_EQ(one_sided(model.parts().measured), "from above");
  EXPECT_TRUE(has_note(model, kOneSide));
  const Evaluation same = model.evaluate(as_measured(robot, from_one_side(fresh.poses, -1), 3));
  const Evaluation other = model.evaluate(as_measured(robot, from_one_side(fresh.poses, 1), 3));
  EXPECT_GT(other.compensated.rms, 4 * same.compensated.rms);
  EXPECT_GT(same.in_domain, 20);
  EXPECT_EQ(other.in_domain, 0) << "that side was never measured";
}

TEST(WhatWasMeasured, APlanMeasuresBothSidesSoThatThePromiseCountsThePlay) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = with_play(cell);
  const CompensatedModel model = trained(
      cell, as_measured(robot, from_one_side(demand(make_plan(cell, {80, 1})).poses, 0), 1));
  EXPECT_EQ(words_of(model.parts().measured, *cell).sides, "every joint from both sides");
  EXPECT_FALSE(has_note(model, kOneSide));
  const Plan fresh = demand(make_plan(cell, {40, 2}));
  const double above =
      model.evaluate(as_measured(robot, from_one_side(fresh.poses, -1), 3)).compensated.rms;
  const double below =
      model.evaluate(as_measured(robot, from_one_side(fresh.poses, 1), 3)).compensated.rms;
  EXPECT_LT(std::max(above, below), 1.5 * std::min(above, below));
}

TEST(WhatWasMeasured, NamesTheJointsOfEachSide) {
  WhatWasMeasured measured;
  measured.approaches = {{30, 30}, {0, 60}, {0, 0}, {59, 1}};
  EXPECT_EQ(words_of(measured, *test::cell_7()).sides,
            "from both sides in joint 1, from above only in joint 2, from below only in joint 4, "
            "from a side that is not recorded in joint 3");
  EXPECT_EQ(one_sided(measured), "from above in joint 2, from below in joint 4");
  measured.approaches = {{0, 0}, {0, 0}};
  EXPECT_EQ(words_of(measured, *test::cell_7()).sides,
            "every joint from a side that is not recorded");
  EXPECT_EQ(one_sided(measured), "");
  EXPECT_EQ(one_sided(std::nullopt), "");
}

/// Share of fresh poses of the same plan whose flange is near a measured place.
double share_near(const std::shared_ptr<const Cell>& cell, int poses, std::uint64_t seed) {
  const PhysicalModel physics = demand(make_physical_model(cell, {"base"}));
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const WhatWasMeasured measured = what_was_measured(physics, test::measured(robot, poses, seed));
  const Eigen::MatrixXd fresh = demand(plan_poses(*cell, {1000, seed + 100}));
  int near = 0;
  for (Eigen::Index i = 0; i < fresh.rows(); ++i)
    near += measured.is_near(cell->robot, fresh.row(i).transpose()) ? 1 : 0;
  return near / 1000.0;
}

TEST(WhatWasMeasured, FreshPosesOfTheSamePlanAreNear) {
  for (const auto& cell : {test::cell_7(), cell_in_front()}) {
    for (const int poses : {30, 60, 250}) {
      double share = 0;
      for (std::uint64_t seed = 1; seed <= 5; ++seed) share += share_near(cell, poses, seed) / 5;
      EXPECT_GE(share, poses < 60 ? 0.975 : 0.985)
          << poses << (cell->workspace ? " poses in front" : " poses all around");
    }
  }
}

TEST(WhatWasMeasured, FreshPosesOfAPlanOfFewAreInDomain) {
  for (const auto& cell : {test::cell_7(), cell_in_front()}) {
    const VirtualRobot robot = test::chapter_5_robot(cell);
    int inside = 0;
    for (std::uint64_t seed = 1; seed <= 5; ++seed)
      inside += trained(cell, test::measured(robot, 30, seed))
                    .evaluate(test::measured(robot, 200, seed + 50))
                    .in_domain;
    EXPECT_GE(inside / 1000.0, 0.96) << (cell->workspace ? "poses in front" : "poses all around");
  }
}

TEST(WhatWasMeasured, TheMarginOfTheRangesIsLargerOfFewPoses) {
  WhatWasMeasured measured;
  measured.flange_B.resize(3, 30);
  EXPECT_NEAR(measured.range_margin(), 0.1, 1e-9);
  measured.flange_B.resize(3, 250);
  EXPECT_NEAR(measured.range_margin(), 0.05, 1e-3);
  measured.flange_B.resize(3, 2);
  EXPECT_NEAR(measured.range_margin(), 0.1, 1e-9) << "however few";
}

/// Poses whose joints are each in the model's range, with the flange at least this far behind the
/// base, m.
std::vector<JointVector> behind(const CompensatedModel& model, double by) {
  JointRanges ranges;
  for (Eigen::Index j = 0; j < 6; ++j)
    ranges.emplace_back(model.parts().q_min(j), model.parts().q_max(j));
  std::vector<JointVector> poses;
  const Eigen::MatrixXd all = latin_hypercube(ranges, 4000, 9);
  for (Eigen::Index i = 0; i < all.rows(); ++i) {
    const JointVector q = all.row(i).transpose();
    if (model.cell().robot.flange_pose(q).translation().x() < -by) poses.push_back(q);
  }
  return poses;
}

TEST(WhatWasMeasured, PosesBehindARobotThatWasMeasuredInFrontAreOutOfDomainAndHeldOutOnesAreIn) {
  const auto cell = cell_in_front();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const CompensatedModel model = trained(cell, test::measured(robot, 80, 1));
  const Evaluation held_out = model.evaluate(test::measured(robot, 200, 2));
  EXPECT_GE(held_out.in_domain, 198);
  const std::vector<JointVector> poses = behind(model, 0.2);
  ASSERT_GT(poses.size(), 200u) << "each joint by itself is in its range there";
  int inside = 0;
  for (const JointVector& q : poses)
    inside += model.predict(q, "spindle", "spindle").in_domain ? 1 : 0;
  EXPECT_EQ(inside, 0);
}

/// Share of fresh poses behind the robot that are in domain, of a robot that was measured at
/// `poses` places in front.
double share_behind(int poses) {
  const auto cell = cell_in_front();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const PhysicalModel physics = demand(make_physical_model(cell, {"base"}));
  int inside = 0, all = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const WhatWasMeasured measured = what_was_measured(physics, test::measured(robot, poses, seed));
    const Eigen::MatrixXd q = latin_hypercube(cell->joint_ranges, 2000, seed);
    for (Eigen::Index i = 0; i < q.rows(); ++i) {
      const JointVector pose = q.row(i).transpose();
      if (cell->robot.flange_pose(pose).translation().x() > -0.2) continue;
      inside += measured.is_near(cell->robot, pose) ? 1 : 0;
      ++all;
    }
  }
  return static_cast<double>(inside) / all;
}

TEST(WhatWasMeasured, FewPosesInFrontMakeNoDomainBehindTheRobot) {
  EXPECT_EQ(share_behind(12), 0);
  EXPECT_EQ(share_behind(30), 0);
}

/// Where the region begins near the base its edge is nearer than the places are to each other.
TEST(WhatWasMeasured, PosesBeyondTheOutlineFromAboveAreOutOfDomain) {
  const auto cell = test::cell_7();
  MeasurementBatch batch = test::measured(test::chapter_5_robot(cell), 400, 1);
  std::erase_if(batch.measurements, [&](const Measurement& m) {
    return cell->robot.flange_pose(m.context.q).translation().x() < 0.3;
  });
  batch.measurements.resize(30);
  const WhatWasMeasured measured =
      what_was_measured(demand(make_physical_model(cell, {"base"})), batch);
  WhatWasMeasured before = measured;
  before.outline.resize(0);
  int behind = 0, in_reach = 0, inside = 0;
  const Eigen::MatrixXd fresh = demand(plan_poses(*cell, {2000, 5}));
  for (Eigen::Index i = 0; i < fresh.rows(); ++i) {
    const JointVector q = fresh.row(i).transpose();
    if (cell->robot.flange_pose(q).translation().x() > -0.3) continue;
    ++behind;
    in_reach += before.is_near(cell->robot, q) ? 1 : 0;
    inside += measured.is_near(cell->robot, q) ? 1 : 0;
  }
  ASSERT_GT(behind, 200);
  EXPECT_GT(in_reach, behind / 5) << "of distances alone";
  EXPECT_LT(inside, behind / 50);
}

TEST(WhatWasMeasured, ItsVolumeIsThatOfThePosesNotOfTheJointsRanges) {
  const auto cell = cell_in_front();
  const WhatWasMeasured measured =
      *trained(cell, test::measured(test::chapter_5_robot(cell), 80, 1)).parts().measured;
  EXPECT_TRUE((measured.lower.array() >= cell->workspace->lower.array() - 0.02).all())
      << measured.lower.transpose();
  EXPECT_TRUE((measured.upper.array() <= cell->workspace->upper.array() + 0.02).all())
      << measured.upper.transpose();
  EXPECT_LE(measured.volume, (measured.upper - measured.lower).prod());
  EXPECT_GT(measured.volume, 0.3 * (measured.upper - measured.lower).prod());
}

TEST(WhatWasMeasured, ReflectorsOfOnePoseAreNoNeighboursOfEachOther) {
  const auto cell = test::cell_7();
  const PhysicalModel physics = demand(make_physical_model(cell, {"base"}));
  MeasurementBatch batch = test::measured(test::chapter_5_robot(cell), 40, 1);
  const WhatWasMeasured once = what_was_measured(physics, batch);
  const auto rows = batch.measurements;
  for (int reflector = 0; reflector < 2; ++reflector)
    batch.measurements.insert(batch.measurements.end(), rows.begin(), rows.end());
  const WhatWasMeasured thrice = what_was_measured(physics, batch);
  EXPECT_EQ(thrice.reach, once.reach);
  EXPECT_EQ(thrice.flange_B, once.flange_B);
  EXPECT_EQ(thrice.poses, 120);
}

/// The file with `change` done to its content, its hash fitting again.
std::string changed(const std::string& text, const std::function<void(json& content)>& change) {
  json file = json::parse(text);
  change(file["content"]);
  file["hash"] = sha256_hex(file["content"].dump());
  return file.dump();
}

TEST(WhatWasMeasured, IsInTheModelFileAndAnOlderFileSaysThatItIsNotOnRecord) {
  const auto cell = cell_in_front();
  const CompensatedModel model =
      trained(cell, test::measured(test::chapter_5_robot(cell), 60, 1), "se");
  const CompensatedModel read = demand(deserialize(serialize(model), "m"));
  EXPECT_EQ(in_words(read.parts().measured, *cell), in_words(model.parts().measured, *cell));
  EXPECT_EQ(read.parts().measured->flange_B, model.parts().measured->flange_B);
  const CompensatedModel older = demand(deserialize(
      changed(serialize(model), [](json& content) { content.erase("measured"); }), "m"));
  EXPECT_TRUE(in_words(older.parts().measured, *cell).find("sides of approach: not on record") !=
              std::string::npos);
  for (const JointVector& q : behind(model, 0.2)) {
    const ErrorPrediction now = model.predict(q, "spindle", "spindle"),
                          before = older.predict(q, "spindle", "spindle");
    EXPECT_EQ(now.error_B, before.error_B) << "what the model answers does not depend on it";
    EXPECT_EQ(now.covariance_B, before.covariance_B);
  }
}

TEST(WhatWasMeasured, AFileOfAnotherArmsSidesIsRefused) {
  const auto cell = test::cell_7();
  const std::string text =
      serialize(trained(cell, test::measured(test::chapter_5_robot(cell), 40, 1)));
  EXPECT_FALSE(
      deserialize(changed(text, [](json& c) { c["measured"]["approaches"].erase(0); }), "m"));
  EXPECT_FALSE(deserialize(changed(text, [](json& c) { c["measured"]["reach_m"] = -1; }), "m"));
  EXPECT_FALSE(deserialize(changed(text, [](json& c) { c["measured"].erase("flange_m"); }), "m"));
  EXPECT_FALSE(
      deserialize(changed(text, [](json& c) { c["measured"]["outline_m"]["values"] = {1}; }), "m"));
}

}  // namespace
}  // namespace trammel
