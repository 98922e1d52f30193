#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "trammel/result.h"

/// The types that predictions and corrections are made of, from a file or from a service.
namespace trammel::api {

/// Where a frame is. `X_BT` is the tool T seen from the robot's base B.
struct Pose {
  std::array<double, 3> xyz_mm{};  ///< position, mm
  std::array<double, 4> q_wxyz{
      1, 0, 0, 0};  ///< orientation: unit quaternion, Hamilton, active, scalar first
};

/// The circumstances that hold for all poses of a call.
struct Context {
  std::string tool;     ///< id in the cell file; empty: the cell's only one
  std::string payload;  ///< likewise
  std::vector<int>
      directions;  ///< from which each joint is approached: -1, 0, +1; empty: not known
  std::optional<double> temperature_c;  ///< degrees Celsius; empty: that of the training
};

/// The error to expect at one joint vector. All vectors are in B.
struct Prediction {
  Pose nominal;                      ///< X_BT: where the controller believes the tool to be
  Pose predicted;                    ///< X_BT: where it will be
  std::array<double, 3> error_mm{};  ///< predicted - nominal, mm
  std::array<double, 3>
      stddev_mm{};  ///< of one measurement of it, the instrument's noise included, mm
  std::array<double, 3> true_stddev_mm{};  ///< of the true error, mm
  std::array<double, 9> covariance_mm2{};  ///< 3 x 3 of one measurement, row by row, mm²
  std::array<double, 3> rotation_deg{};    ///< rotation vector from nominal to predicted, deg
  std::optional<std::array<double, 3>>
      rotation_stddev_deg;  ///< of one measured orientation, deg; empty: not learned
  bool in_domain = false;   ///< false: the learned bias is not fully taken
  double bias_share = 0;    ///< of the learned bias that is taken: 1 in domain, 0 well outside
};

/// A wanted pose of the tool, or joints whose nominal pose is wanted.
struct Target {
  std::optional<Pose> pose;  ///< X_BT; empty: the nominal pose at `joints_deg` is wanted
  std::vector<double>
      joints_deg;  ///< deg (of a rail mm): joints near the wanted branch; may be empty with `conf`
  std::optional<int>
      conf;  ///< branch 0..7: +4 wrist behind axis 1, +2 behind the lower arm, +1 joint 5 < 0
};

/// A corrected target. Only `ok` and `out_of_domain` are corrected; else the wanted pose is
/// commanded.
struct CorrectedTarget {
  std::string
      status;      ///< `ok out_of_domain joint_limit unreachable singular not_converged refused`
  Pose commanded;  ///< X_BT to command so that the tool lands on the wanted pose
  std::vector<double> joints_deg;  ///< the controller's joints for it, deg (of a rail mm)
  double error_before_mm =
      0;  ///< rms distance to expect without correction, mm; NaN: nothing to say
  double error_after_mm = 0;   ///< the same with it, mm
  double sigma_mm = 0;         ///< stddev of the true position, rms of the axes, mm
  double turn_before_deg = 0;  ///< orientation error to expect without correction, deg
  double turn_after_deg = 0;   ///< the same with it, deg
  int iterations = 0;          ///< of the correction
  std::string message;         ///< why it is not ok
};

/// A note that a user of a model should know, in the words of the command line and of the service.
struct Note {
  std::string code;      ///< for programs: `robot_not_confirmed`
  std::string severity;  ///< `info`; `warning`: figures mean less than they seem to; `stop`: a
                         ///< person must look first
  std::string text;      ///< for people
};

/// Which model answered.
struct ModelFacts {
  std::string id;          ///< first 12 characters of the hash
  std::string hash;        ///< SHA-256 of the model's content
  std::string cell;        ///< its cell
  std::string level;       ///< its error sources, joined by commas
  std::string batch;       ///< batch that it was trained on
  int training_poses = 0;  ///< how many it learned from
  int version = 0;         ///< of a service; 0: from a file
  bool in_force = false;   ///< of a service: whether its cell is served with it
  std::vector<Note>
      notes;  ///< the gravest first; in a service's list of versions only of the one in force
  std::vector<std::string> budget;  ///< where the millimetres come from, its first lines for
                                    ///< people; of a service: of the one in force, when listed
};

/// Told what is being done and which share of it is done, [0, 1]. Returns false to give up (kBusy).
using Progress = std::function<bool(const std::string& stage, double share)>;

}  // namespace trammel::api
