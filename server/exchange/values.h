#pragma once

#include <array>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

/// The values of a prediction and of a correction in people's units, and the one table of their
/// figures. Lengths are mm and angles deg; vectors and covariances are in B, the robot's base.
namespace trammel::exchange {

/// Where a frame is. `X_BT` is the tool T seen from the robot's base B.
struct Pose {
  std::array<double, 3> xyz_mm{};  ///< position, mm
  std::array<double, 4> q_wxyz{
      1, 0, 0, 0};  ///< orientation: unit quaternion, Hamilton, active, scalar first
};

/// The error to expect at one joint vector. All vectors are in B.
struct Prediction {
  Pose nominal;                      ///< X_BT: where the controller believes the tool to be
  Pose predicted;                    ///< X_BT: where it will be
  std::array<double, 3> error_mm{};  ///< predicted - nominal, mm
  std::array<double, 3>
      stddev_mm{};  ///< mm, of one measurement of the position, with the instrument's noise
  std::array<double, 3> true_stddev_mm{};  ///< of the true error, mm
  std::array<double, 9> covariance_mm2{};  ///< 3 x 3 of one measurement, row by row, mm²
  std::array<double, 3> rotation_deg{};    ///< rotation vector from nominal to predicted, deg
  std::optional<std::array<double, 3>>
      rotation_stddev_deg;  ///< of one measured orientation, deg; empty: not learned
  bool in_domain = false;   ///< false: the learned bias is not fully taken
  double bias_share = 0;    ///< of the learned bias that is taken: 1 in domain, 0 well outside
};

/// A corrected target. Only `ok` and `out_of_domain` are corrected; else the wanted pose is
/// commanded.
struct CorrectedTarget {
  std::string
      status;      ///< `ok out_of_domain joint_limit unreachable singular not_converged refused`
  Pose commanded;  ///< X_BT to command so that the tool lands on the wanted pose
  std::vector<double> joints_deg;  ///< the controller's joints for it, deg (of a rail mm)
  double error_before_mm = 0;    ///< rms distance to expect without correction, mm; NaN: not known
  double error_after_mm = 0;     ///< mm, with the correction
  double sigma_mm = 0;           ///< stddev of the true position, rms of the axes, mm
  double sigma_measured_mm = 0;  ///< the same of one measurement, the instrument's noise included
  double turn_before_deg = 0;    ///< orientation error to expect without correction, deg
  double turn_after_deg = 0;     ///< deg, with the correction
  int iterations = 0;            ///< of the correction
  std::string message;           ///< why it is not ok
};

/// The place of a figure in a table (CSV) of answers.
enum class Place {
  kNowhere,     ///< neither in tables nor in JSON
  kJsonOnly,    ///< in JSON
  kInFront,     ///< before the name of the model; in JSON, too
  kBehind,      ///< after it; in JSON, too
  kCovariance,  ///< last, where covariances are asked for; in JSON, too
  kOrientation  ///< last, where orientations are asked for; in JSON, too
};

/// One figure of an answer.
template <typename Answer, typename Value>
struct Figure {
  const char* name;      ///< in Python; of a pose also in JSON
  Value Answer::*value;  ///< in the answer
  const char* columns;  ///< names of its numbers, with commas between; a number without is left out
  Place place;          ///< in tables
};
/// Deduces the types, so that a table can leave them out.
template <typename Answer, typename Value>
Figure(const char*, Value Answer::*, const char*, Place) -> Figure<Answer, Value>;

/// Columns of a pose.
inline constexpr const char* kPoseColumns = "x_mm,y_mm,z_mm,qw,qx,qy,qz";

/// The figures of a prediction, in the order of JSON. A new figure needs a line in this list.
inline constexpr std::tuple kPredictionFigures{
    Figure{"error_mm", &Prediction::error_mm, "dx_mm,dy_mm,dz_mm", Place::kInFront},
    Figure{"stddev_mm", &Prediction::stddev_mm, "sx_mm,sy_mm,sz_mm", Place::kInFront},
    Figure{"true_stddev_mm", &Prediction::true_stddev_mm, "slx_mm,sly_mm,slz_mm", Place::kBehind},
    Figure{"in_domain", &Prediction::in_domain, "in_domain", Place::kInFront},
    Figure{"nominal", &Prediction::nominal, "", Place::kJsonOnly},
    Figure{"predicted", &Prediction::predicted, kPoseColumns, Place::kInFront},
    Figure{"covariance_mm2", &Prediction::covariance_mm2, ",cxy_mm2,cxz_mm2,,,cyz_mm2,,,",
           Place::kCovariance},
    Figure{"rotation_stddev_deg", &Prediction::rotation_stddev_deg, "srx_deg,sry_deg,srz_deg",
           Place::kOrientation},
    Figure{"rotation_deg", &Prediction::rotation_deg, "", Place::kNowhere},
    Figure{"bias_share", &Prediction::bias_share, "", Place::kNowhere}};

/// The figures of a correction, likewise; status, pose, joints and message stand beside them.
inline constexpr std::tuple kCorrectionFigures{
    Figure{"error_before_mm", &CorrectedTarget::error_before_mm, "error_before_mm",
           Place::kInFront},
    Figure{"error_after_mm", &CorrectedTarget::error_after_mm, "error_after_mm", Place::kInFront},
    Figure{"sigma_mm", &CorrectedTarget::sigma_mm, "sigma_mm", Place::kInFront},
    Figure{"sigma_measured_mm", &CorrectedTarget::sigma_measured_mm, "sigma_measured_mm",
           Place::kBehind},
    Figure{"turn_before_deg", &CorrectedTarget::turn_before_deg, "turn_before_deg", Place::kBehind},
    Figure{"turn_after_deg", &CorrectedTarget::turn_after_deg, "turn_after_deg", Place::kBehind},
    Figure{"iterations", &CorrectedTarget::iterations, "iterations", Place::kInFront}};

/// Calls `take(figure)` for each figure of one of these tables, in order.
template <typename Table, typename Take>
constexpr void each_figure(const Table& figures, const Take& take) {
  std::apply([&](const auto&... figure) { (take(figure), ...); }, figures);
}

}  // namespace trammel::exchange
