#pragma once

#include <string>
#include <vector>

#include "server/robot/cell.h"

/// The check whether a robot file is the controller's: joints and poses that the controller shows,
/// against the file's forward kinematics.
///
/// A model corrects positions against the robot file, but the controller solves a corrected pose
/// for joints with its own lengths. If the two arms differ, every corrected pose is off by the
/// difference, however well the model fits.
namespace trammel {

/// The poses that a controller shows for some joints.
struct ShownPoses {
  /// One possible meaning of the three angles. Makers differ: A B C, W P R, a rotation vector.
  struct Orientations {
    std::string meaning;     ///< `Rz(A) Ry(B) Rx(C)`
    std::vector<Matrix3> R;  ///< one a pose
  };
  std::vector<JointVector> q;              ///< rad (m), as shown
  std::vector<Vector3> p;                  ///< m
  std::vector<Orientations> orientations;  ///< their possible meanings; empty: none is shown
};

/// The result of the comparison.
struct RobotComparison {
  enum class Verdict { kConfirmed, kDiffers, kCannotTell };
  Verdict verdict = Verdict::kCannotTell;
  std::string why;  ///< one sentence
  int poses = 0;
  double position_rms = 0, position_max = 0;  ///< m, between shown and computed
  double rotation_rms = 0, rotation_max = 0;  ///< rad; 0 where no orientation is shown
  double position_limit = 0;  ///< m: the largest error that rounding of the shown numbers explains,
                              ///< at the worst pose
  std::string shown_as;  ///< `the flange in the robot's base`, `tool spindle in the cell's base`
  std::string angles;    ///< the meaning of the angles that was used
  std::vector<std::string> could_be;  ///< changes that would turn the file's arm into the
                                      ///< controller's, the likeliest first
};
[[nodiscard]] const char* to_text(RobotComparison::Verdict verdict);

/// Compares. The poses may belong to the flange or to a tool of the cell, in the robot's base or in
/// the cell's. If only a base and a tool of the controller's own would fit, the comparison cannot
/// tell, since these hide errors of the first and the last length. Refuses fewer than 3 poses, and
/// a number of joints other than the robot's.
[[nodiscard]] Result<RobotComparison> compare_robot(const Cell& cell, const ShownPoses& shown);

}  // namespace trammel
