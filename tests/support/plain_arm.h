#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"

/// Arms with lengths that are written here, independent of the project's kinematics. They equal
/// their drawing except for their zeros.
namespace trammel::test {

/// m and rad. The second axis of an arm whose second and third axes are parallel has d 0.
struct PlainLink {
  double theta = 0, d = 0, a = 0, alpha = 0;
};
struct PlainArm {
  std::string file;  ///< of models/
  std::vector<PlainLink> links;
};
/// Seven axes: KUKA LBR iiwa 7.
[[nodiscard]] PlainArm iiwa();
/// Six axes: ABB IRB 120.
[[nodiscard]] PlainArm irb120();

/// m: the tool's point in the flange, as the model has it.
[[nodiscard]] Vector3 plain_tool();

/// The measurement of the arm, with 0.013 mm and 0.05 mrad of noise per axis.
struct PlainCheck {
  std::vector<JointVector> poses;
  JointVector zeros;  ///< rad, by which the joints are off
  bool orientation = true;
  Eigen::Isometry3d X_WB = Eigen::Isometry3d::Identity();
  Vector3 tool = plain_tool();
  std::uint64_t seed = 7;
};
[[nodiscard]] MeasurementBatch measured(const PlainArm& arm, const PlainCheck& check);

/// On 100 poses, base and geometry identified. `tool` is the point in the flange, m.
[[nodiscard]] CompensatedModel trained(const PlainArm& arm, const Vector3& tool = plain_tool());

/// Elbow postures for one flange pose of a seven-axis arm: the third joint turns from -60 to 60
/// degrees. `like`: a posture with that flange pose.
[[nodiscard]] std::vector<JointVector> elbows(const PlainArm& arm, int count,
                                              const JointVector& like);
[[nodiscard]] std::vector<JointVector> elbows(const PlainArm& arm, int count = 14);

}  // namespace trammel::test
