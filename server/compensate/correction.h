#pragma once

#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/robot/chain.h"

/// A target, and the command with which the tool lands on it.
namespace trammel {

enum class CorrectionStatus {
  kOk,
  kOutOfDomain,
  kJointLimit,
  kUnreachable,
  kSingular,
  kNotConverged,
  kRefused
};
/// The spelling in files and on the wire: `ok`, `out_of_domain`, ...
[[nodiscard]] std::string_view to_string(CorrectionStatus status);

/// A wanted pose of the tool, or the joints that a program commands.
struct Target {
  Pose X_BT = Pose::Identity();
  std::optional<JointVector> seed;  ///< joints near the wanted branch, rad
  std::optional<int> conf;          ///< or the branch, 0..7, see inverse_kinematics.h
  bool joint_target = false;        ///< X_BT is not set: the nominal pose at `seed` is wanted
  /// The approach of the arm, as in PoseContext; neutral where it is not known.
  std::vector<int> direction = {};
  std::optional<double> temperature = {};  ///< degrees Celsius
  std::optional<double> time = {};         ///< s
};

/// A corrected target. If its status is neither ok nor out of domain, it is not corrected and the
/// target pose is commanded. Expected errors are root mean squares of the true distance from the
/// target, without the instrument's noise; NaN if no joints bring the tool there. The standard
/// deviations before and after are both those at the target: a correction moves the joints by
/// milliradians, and a standard deviation changes over a length scale of the bias.
struct Correction {
  CorrectionStatus status = CorrectionStatus::kRefused;
  Pose X_BT_wanted = Pose::Identity();
  Pose X_BT_commanded = Pose::Identity();  ///< the command with which the tool lands on the target
  JointVector q;  ///< the controller's joints for it (nominal inverse kinematics), rad
  double error_before = kNothingToSay;  ///< m, to expect without correction
  double error_after =
      kNothingToSay;  ///< m, expected with the correction; equal to the one before if there is none
  double stddev = kNothingToSay;  ///< m, of the true position: root mean square of the three axes
  double measured_stddev =
      kNothingToSay;  ///< m, likewise for one measurement, with the instrument's noise
  /// rad, expected angle between the target orientation and the true one. If the model learned no
  /// orientations, it is the angle by the error sources.
  double turn_before = kNothingToSay;
  double turn_after = kNothingToSay;
  double left = 0;  ///< m, the remainder of the iteration; part of error_after
  int iterations = 0;
  std::string message;  ///< why not ok

  static constexpr double kNothingToSay = std::numeric_limits<double>::quiet_NaN();
};

struct CorrectOptions {
  double tolerance = 1e-7;  ///< m: a smaller step is the last
  int max_iterations = 10;
};

}  // namespace trammel
