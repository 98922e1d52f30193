#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "server/base/units.h"
#include "server/calibrate/calibrate.h"
#include "tests/support/calibrated.h"
#include "tests/support/demand.h"
#include "tests/support/hidden_files.h"
#include "tests/support/hidden_world.h"

// The arm of the second simulation on a rail that this file simulates: a curve in space, and a rack
// beside it.
namespace trammel {
namespace {

const double kNoise_mm = 0.013 * std::sqrt(3.0);
constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kTravel_mm = 4000;
constexpr double kPitch_mm = 31.4;
constexpr double kScale = 40e-6;
constexpr double kRack_mm = 0.025;
constexpr double kRackPhase = 0.8;

double aside_mm(double s_mm) { return 0.25 * std::sin(kTurn * s_mm / 4200 + 0.3); }
double up_mm(double s_mm) { return -0.3 * std::pow(std::sin(kTurn / 2 * s_mm / 4500), 2); }
double roll(double s_mm) { return 8e-5 * std::cos(kTurn * s_mm / 5000); }

/// The frame B, whose z runs along the rail and whose y is up, in the world.
Eigen::Matrix4d rail_frame() {
  Eigen::Matrix4d frame = Eigen::Matrix4d::Identity();
  frame.block<3, 3>(0, 0) << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  return frame;
}

/// Where the arm's foot stands when the controller says `said_mm`.
Eigen::Matrix4d foot(double said_mm) {
  const double s =
      said_mm * (1 + kScale) + kRack_mm * std::sin(kTurn * said_mm / kPitch_mm + kRackPhase);
  const double step = 1;
  const double aside_slope = (aside_mm(s + step) - aside_mm(s - step)) / (2 * step);
  const double up_slope = (up_mm(s + step) - up_mm(s - step)) / (2 * step);
  // Along the curve's tangent: about y as it goes aside, about x as it falls.
  const Eigen::Matrix4d on_rail =
      hidden::motion({aside_mm(s), up_mm(s), s}, 0, aside_slope, -up_slope);
  return rail_frame() * on_rail * hidden::motion({0, 0, 0}, roll(s), 0, 0) *
         hidden::motion({0, 0, 0}, 0, 0, -std::numbers::pi / 2);
}

struct ArmOnRail {
  hidden::World world;
  std::shared_ptr<const Cell> cell;
};

ArmOnRail arm_on_rail() {
  ArmOnRail on_rail;
  hidden::World& world = on_rail.world;
  world.arm = hidden::drawn_arm();
  world.arm.links[1].a += 0.4;
  world.arm.links[3].theta += 4e-4;
  world.arm.give = hidden::Joints::Constant(1e-9);
  world.sources = {"base"};
  const hidden::Belief belief{{hidden::motion({100, 0, 150}, 0, -std::numbers::pi / 4, 0)},
                              {{60, {40, -25, 140}}}};
  world.tools = belief.tools;
  world.loads = belief.loads;
  std::string robot = hidden::robot_text();
  const std::string joints = "joints:\n";
  robot.insert(robot.find(joints) + joints.size(),
               "  - {type: prismatic, theta_deg: 0, d_mm: 0, a_mm: 0, alpha_deg: -90, limits_mm: "
               "[0, 4000]}\n");
  std::string cell = hidden::cell_text(world, belief, "1dim");
  const std::string upright = "q_wxyz: [1, 0, 0, 0]";
  cell.replace(cell.find(upright), upright.size(), "q_wxyz: [0.5, 0.5, 0.5, 0.5]");
  on_rail.cell = std::make_shared<const Cell>(test::demand(parse_cell(cell, robot, "rail.yaml")));
  return on_rail;
}

MeasurementBatch measured(const ArmOnRail& arm, int count, std::uint64_t seed) {
  hidden::Random random(seed);
  MeasurementBatch batch;
  batch.id = "rail";
  for (const hidden::MeasuringPose& pose : hidden::draw_poses({.count = count}, random)) {
    const double said_mm = hidden::uniform(random, 0, kTravel_mm);
    hidden::World there = arm.world;
    there.arm.base = foot(said_mm);
    const Eigen::Matrix4d frame = hidden::frames_at(there, {pose}, {}).front();
    Measurement m;
    m.pose_id = std::to_string(pose.index);
    m.context.q.resize(7);
    m.context.q << from_mm(said_mm), pose.q;
    m.context.tool = "tool-1";
    m.context.payload = "load-1";
    m.context.index = pose.index;
    Vector3 turn;
    for (int k = 0; k < 3; ++k) {
      m.p_W(k) = from_mm(frame(k, 3) + 0.013 * hidden::normal(random));
      turn(k) = arm.world.sigma_rad * hidden::normal(random);
    }
    m.R_WT = rotation_exp(turn) * frame.block<3, 3>(0, 0);
    batch.measurements.push_back(m);
  }
  return batch;
}

double held_out(const CalibrationResult& result, const MeasurementBatch& batch) {
  double sum = 0;
  for (const Measurement& m : batch.measurements)
    sum += (m.p_W - result.model.pose_W(m.context).translation()).squaredNorm();
  return to_mm(std::sqrt(sum / static_cast<double>(batch.measurements.size()))) / kNoise_mm;
}

TEST(Rail, ScaleRackAndStraightnessAreTakenForWhatTheyAre) {
  const ArmOnRail arm = arm_on_rail();
  const MeasurementBatch batch = measured(arm, 600, 1);
  const MeasurementBatch fresh = measured(arm, 400, 2);
  const std::vector<std::string> all = {
      "base",         "geometry",           "compliance",
      "rail_scale:1", "rack_pitch:1@31.45", "rail_straightness:1"};
  const CalibrationResult found = test::demand(calibrate(arm.cell, all, batch, {}));
  EXPECT_LE(held_out(found, fresh), 1.05);
  for (std::size_t k = 3; k < all.size(); ++k) {
    std::vector<std::string> fewer = all;
    fewer.erase(fewer.begin() + static_cast<std::ptrdiff_t>(k));
    EXPECT_GE(held_out(test::demand(calibrate(arm.cell, fewer, batch, {})), fresh), 1.15)
        << "without " << all[k];
  }
  const std::pair<const char*, double> truth[] = {
      {"rail_scale1", kScale},
      {"pitch1", from_mm(kPitch_mm)},
      {"rack_sin1", from_mm(kRack_mm * std::cos(kRackPhase))},
      {"rack_cos1", from_mm(kRack_mm * std::sin(kRackPhase))}};
  for (const auto& [name, value] : truth) {
    const IdentifiedParameter& one = test::parameter(found, name);
    EXPECT_TRUE(one.identified) << name;
    EXPECT_NEAR(one.value, value, 2 * one.stddev) << name;
  }
}

}  // namespace
}  // namespace trammel
