#pragma once

#include <Eigen/Dense>
#include <array>
#include <string>
#include <vector>

/// A second, small simulation of a robot arm, for tests that hide an effect and search for it. It
/// shares no code with the server: it has its own kinematics, load and deflection. Lengths in mm,
/// angles in rad, masses in kg, forces in N, joints counted from 0.
namespace trammel::hidden {

constexpr int kJoints = 6;
using Joints = Eigen::Matrix<double, kJoints, 1>;

/// One row of the arm's table: Tz(d) Rz(theta) Tx(a) Rx(alpha), or with `parallel` Rz(theta) Tx(a)
/// Rx(alpha) Ry(beta).
struct Link {
  double theta = 0, d = 0, a = 0, alpha = 0, beta = 0;
  bool parallel = false;
};

struct Load {
  double mass_kg = 0;
  Eigen::Vector3d cog_mm = Eigen::Vector3d::Zero();  ///< in the flange
};

/// A gas spring or balancer at a joint: it pulls a pin on the link that follows towards a pin on
/// the link before.
struct Spring {
  double force_N = 0;         ///< with its pins `rest_mm` apart
  double stiffness_N_mm = 0;  ///< additional pull per mm beyond
  double rest_mm = 0;
  double fixed_mm = 0;   ///< from the axis to the pin that stays
  double moving_mm = 0;  ///< from the axis to the pin that moves
  double phase = 0;      ///< rad, between the pins at joint angle 0
};

/// A frame for each joint, all without motion.
[[nodiscard]] inline std::array<Eigen::Matrix4d, kJoints> still() {
  std::array<Eigen::Matrix4d, kJoints> frames;
  frames.fill(Eigen::Matrix4d::Identity());
  return frames;
}

/// The place of the tracker, in the world.
[[nodiscard]] inline Eigen::Vector3d tracker_stand_mm() { return {4200, -1800, 1300}; }

/// Everything that decides where the tool stands.
struct Arm {
  std::array<Link, kJoints> links;
  Eigen::Matrix4d base = Eigen::Matrix4d::Identity();       ///< world from base
  Eigen::Matrix4d tool = Eigen::Matrix4d::Identity();       ///< flange from tool
  std::array<Eigen::Matrix4d, kJoints> bearings = still();  ///< the place of each axis in its
                                                            ///< bearing
  Load load;
  Joints give = Joints::Zero();            ///< rad/Nmm, of each gearbox
  std::array<Load, kJoints> weights = {};  ///< of the links, each in the frame behind its link
  Spring spring;                           ///< at joint 2
  Eigen::Vector2d foot = {0, 0};           ///< rad/Nmm, how the base tilts about its x and y axes
  std::array<double, kJoints> flex = {};   ///< 1/(N mm2), 1/EI of each link in its middle; 0: rigid
};

/// The ABB IRB 6640 as its maker draws it, carrying nothing.
[[nodiscard]] Arm drawn_arm();

/// Tx Ty Tz Rz Ry Rx.
[[nodiscard]] Eigen::Matrix4d motion(const Eigen::Vector3d& shift_mm, double about_z,
                                     double about_y, double about_x);

/// Moment of load, links and spring about every joint axis, Nmm, in the loaded posture.
[[nodiscard]] Joints load_moments(const Arm& arm, const Joints& q);
/// World from tool, gearboxes and links having given way until moments and deflections agree.
[[nodiscard]] Eigen::Matrix4d tool_frame(const Arm& arm, const Joints& q);

/// The arm parameters that a calibration could change, as one vector: `x0`..`alpha0`,
/// `q1`..`alpha6`, `C1`..`C6`.
struct ArmParameter {
  std::string name;
  std::string group;  ///< base, geometry, compliance
  double unit = 1;    ///< mm, rad or rad/Nmm that it may reasonably be off by
};
[[nodiscard]] const std::vector<ArmParameter>& arm_parameters();
/// `arm` with `values` added to it, in the order of arm_parameters().
[[nodiscard]] Arm changed(Arm arm, const Eigen::VectorXd& values);

}  // namespace trammel::hidden
