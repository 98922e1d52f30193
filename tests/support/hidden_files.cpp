#include "tests/support/hidden_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>

namespace trammel::hidden {

namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr int kLimitsDeg[kJoints][2] = {{-170, 170}, {-65, 85},   {-180, 70},
                                        {-300, 300}, {-120, 120}, {-360, 360}};

std::string pose_text(const Eigen::Matrix4d& frame) {
  const Eigen::Quaterniond turn(Eigen::Matrix3d(frame.block<3, 3>(0, 0)));
  return fmt::format(
      "{{xyz_mm: [{:.9g}, {:.9g}, {:.9g}], q_wxyz: [{:.12g}, {:.12g}, {:.12g}, {:.12g}]}}",
      frame(0, 3), frame(1, 3), frame(2, 3), turn.w(), turn.x(), turn.y(), turn.z());
}

std::string joined_files(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

std::string ranges_text(const std::string& name) {
  std::string text;
  int joint = 0;
  for (const auto& [lower, upper] : joint_ranges(name)) {
    if (lower == upper) return "";  // a joint that stands still has no range
    text += fmt::format("{}q{}: [{:.6g}, {:.6g}]", joint == 0 ? "" : ", ", joint + 1,
                        lower / kDegree, upper / kDegree);
    ++joint;
  }
  return "joint_ranges_deg: {" + text + "}\n";
}

}  // namespace

std::string robot_text() {
  std::string text = "version: 1\nname: hidden arm\njoints:\n";
  const Arm arm = drawn_arm();
  for (std::size_t i = 0; i < kJoints; ++i) {
    const Link& link = arm.links[i];
    const std::string along = link.parallel ? "hayati: true" : fmt::format("d_mm: {:.9g}", link.d);
    text += fmt::format(
        "  - {{theta_deg: {:.9g}, {}, a_mm: {:.9g}, alpha_deg: {:.9g}, limits_deg: [{}, {}]}}\n",
        link.theta / kDegree, along, link.a, link.alpha / kDegree, kLimitsDeg[i][0],
        kLimitsDeg[i][1]);
  }
  return text;
}

std::string cell_text(const World& world, const Belief& belief, const std::string& ranges) {
  std::string text = "version: 1\ncell: hidden\nrobot: robot.yaml\n";
  text += "base: {xyz_mm: [0, 0, 0], q_wxyz: [1, 0, 0, 0]}\ngravity: [0, 0, -1]\ntools:\n";
  for (std::size_t i = 0; i < belief.tools.size(); ++i) {
    text += fmt::format("  tool-{}: {}\n", i + 1, pose_text(belief.tools[i]));
  }
  text += "payloads:\n";
  for (std::size_t i = 0; i < belief.loads.size(); ++i) {
    const Load& load = belief.loads[i];
    text += fmt::format("  load-{}: {{mass_kg: {:.9g}, cog_mm: [{:.9g}, {:.9g}, {:.9g}]}}\n", i + 1,
                        load.mass_kg, load.cog_mm.x(), load.cog_mm.y(), load.cog_mm.z());
  }
  const Eigen::Vector3d stand = tracker_stand_mm();
  const std::string told =
      belief.knows_stand ? fmt::format(", xyz_mm: [{}, {}, {}]", stand.x(), stand.y(), stand.z())
                         : "";
  text += fmt::format("tracker: {{sigma_mm: {:.9g}, sigma_deg: {:.9g}{}}}\n", world.sigma_mm,
                      world.sigma_rad / kDegree, told);
  text += "model: {error_sources: [" + joined_files(world.sources) + "], bias: none}\n";
  return text + ranges_text(ranges);
}

std::string batch_text(const World& world, const Frames& measured) {
  std::string text = "pose_id";
  for (int j = 1; j <= kJoints; ++j) text += fmt::format(",q{}_deg", j);
  text += ",x_mm,y_mm,z_mm";
  if (world.orientation) text += ",qw,qx,qy,qz";
  text += ",time_s,temperature_c,tool_id,payload_id";
  for (int j = 1; j <= kJoints; ++j) text += fmt::format(",dir{}", j);
  const bool sets = training_poses(world).size() < world.poses.size();
  text += sets ? ",set\n" : "\n";
  for (std::size_t i = 0; i < world.poses.size(); ++i) {
    const MeasuringPose& pose = world.poses[i];
    const Eigen::Matrix4d& frame = measured[i];
    text += fmt::format("p{}", i + 1);
    for (int j = 0; j < kJoints; ++j) text += fmt::format(",{:.13g}", pose.q(j) / kDegree);
    for (int axis = 0; axis < 3; ++axis) text += fmt::format(",{:.10g}", frame(axis, 3));
    if (world.orientation) {
      const Eigen::Quaterniond turn(Eigen::Matrix3d(frame.block<3, 3>(0, 0)));
      text +=
          fmt::format(",{:.12g},{:.12g},{:.12g},{:.12g}", turn.w(), turn.x(), turn.y(), turn.z());
    }
    text += fmt::format(",{:.6f},{:.4f},tool-{},load-{}", pose.time_s, pose.temperature_c,
                        pose.tool + 1, pose.load + 1);
    for (const int direction : pose.direction) text += fmt::format(",{}", direction);
    text += sets ? (pose.validation ? ",validation\n" : ",train\n") : "\n";
  }
  return text;
}

}  // namespace trammel::hidden
