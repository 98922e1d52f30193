#include "tests/support/heavy_arm.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "server/measurement/checked_batch.h"
#include "tests/support/demand.h"

namespace trammel::test {

namespace {

constexpr double kGive[hidden::kJoints] = {1e-10, 2.8e-10, 8e-10, 2e-9, 2.8e-9, 2.8e-9};  // rad/Nmm
// kg, and mm in the frame that follows each link: a 200 kg class arm, as dynamics papers list it.
constexpr double kMass[hidden::kJoints] = {350, 210, 240, 90, 45, 12};
constexpr double kCog[hidden::kJoints][3] = {{-120, 180, 30}, {-700, 60, 140}, {40, -90, 60},
                                             {15, 420, -25},  {-10, 20, 45},   {5, -8, -60}};
constexpr double kSpread = 0.25;

void draw_weights(hidden::Arm& arm, hidden::Random& random) {
  for (std::size_t i = 0; i < hidden::kJoints; ++i) {
    arm.weights[i].mass_kg = kMass[i] * std::exp(kSpread * hidden::normal(random));
    for (int k = 0; k < 3; ++k) arm.weights[i].cog_mm(k) = kCog[i][k] + 30 * hidden::normal(random);
  }
}

void draw_errors(hidden::Arm& arm, hidden::Random& random) {
  const auto& all = hidden::arm_parameters();
  Eigen::VectorXd errors = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(all.size()));
  for (std::size_t k = 0; k < all.size(); ++k) {
    errors(static_cast<Eigen::Index>(k)) =
        all[k].group == "compliance"
            ? kGive[all[k].name.at(1) - '1'] * std::exp(0.4 * hidden::normal(random))
            : 0.15 * all[k].unit * hidden::normal(random);
  }
  arm = hidden::changed(arm, errors);
}

MeasurementBatch with_noise(const HeavyArm& arm, std::vector<hidden::MeasuringPose> poses,
                            hidden::Random& random) {
  hidden::World world = arm.world;
  world.poses = std::move(poses);
  hidden::Frames frames = hidden::frames_at(world, world.poses, world.effects);
  for (Eigen::Matrix4d& frame : frames) {
    Eigen::Vector3d turn;
    for (Eigen::Index k = 0; k < 3; ++k) {
      frame(k, 3) += world.sigma_mm * hidden::normal(random);
      turn(k) = world.sigma_rad * hidden::normal(random);
    }
    const Eigen::Matrix4d turned =
        hidden::motion(Eigen::Vector3d::Zero(), turn.z(), turn.y(), turn.x());
    frame.block<3, 3>(0, 0) = (turned * frame).block<3, 3>(0, 0).eval();
  }
  return demand(check_against_cell(
                    demand(parse_batch_csv(hidden::batch_text(world, frames), "heavy.csv")),
                    *arm.cell))
      .rows();
}

}  // namespace

HeavyArm draw_heavy_arm(const HeavyArmSpec& spec) {
  hidden::Random random(spec.seed * 1013 + 7);
  HeavyArm heavy;
  hidden::World& world = heavy.world;
  world.arm = hidden::drawn_arm();
  draw_errors(world.arm, random);
  if (spec.links_weigh) draw_weights(world.arm, random);
  if (spec.balancer)
    world.arm.spring = {9000, 6, 700, 520, 310, std::numbers::pi - 0.2};  // some 3 kNm
  if (spec.soft_foot) world.arm.foot = {3e-11, 5e-11};
  world.sources = {"base", "geometry", "compliance"};
  hidden::Belief belief{{hidden::motion({100, 0, 150}, 0, -std::numbers::pi / 4, 0)}, {}};
  if (spec.payloads > 0) belief.loads.push_back({100, {40, -25, 140}});
  if (spec.payloads > 1) belief.loads.push_back({35, {-15, 20, 90}});
  world.tools = belief.tools;
  world.loads = belief.loads;
  if (spec.payloads == 0) belief.loads = world.loads = {{0, {0, 0, 0}}};
  heavy.cell = std::make_shared<const Cell>(demand(parse_cell(
      hidden::cell_text(world, belief, "calibration"), hidden::robot_text(), "heavy.yaml")));
  return heavy;
}

MeasurementBatch measured(const HeavyArm& arm, int poses, std::uint64_t seed, int payload) {
  hidden::Random random(seed * 7919 + 3);
  hidden::PosePlan plan;
  plan.count = poses;
  plan.constant_temperature = true;
  plan.loads = payload < 0 ? static_cast<int>(arm.world.loads.size()) : 1;
  std::vector<hidden::MeasuringPose> drawn = hidden::draw_poses(plan, random);
  for (hidden::MeasuringPose& pose : drawn) pose.load = payload < 0 ? pose.load : payload;
  return with_noise(arm, std::move(drawn), random);
}

MeasurementBatch measured_at(const HeavyArm& arm, std::vector<hidden::MeasuringPose> poses,
                             std::uint64_t seed) {
  hidden::Random random(seed);
  return with_noise(arm, std::move(poses), random);
}

}  // namespace trammel::test
