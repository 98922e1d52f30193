#pragma once

#include <string>
#include <vector>

#include "tests/support/hidden_effect.h"

namespace trammel::hidden {

/// A cell as it really is, and its measurements.
struct World {
  Arm arm;  ///< true; tool and load are put on pose by pose
  std::vector<Eigen::Matrix4d> tools;
  std::vector<Load> loads;
  std::vector<std::string> sources;  ///< the sources that the cell file tells the calibration to
                                     ///< identify
  std::vector<MeasuringPose> poses;
  std::vector<Effect> effects;
  bool orientation = true;
  double sigma_mm = 0.013;  ///< of the tracker, one axis
  double sigma_rad = 61e-6;
};

/// World from tool at each pose without noise.
using Frames = std::vector<Eigen::Matrix4d>;
[[nodiscard]] Frames frames_at(const World& world, const std::vector<MeasuringPose>& poses,
                               const std::vector<Effect>& effects);

/// Rows for all numbers of a pose (three, or six with orientation), over the tracker's sigma:
/// `moved` minus `still`.
[[nodiscard]] Eigen::VectorXd whitened(const World& world, const Frames& moved,
                                       const Frames& still);
/// Likewise by finite differences: the effects of the cell's error sources, one column each, in
/// units of their reasonable uncertainties.
[[nodiscard]] Eigen::MatrixXd arm_columns(const World& world,
                                          const std::vector<MeasuringPose>& poses);
/// The directions of `effect`: derivatives by its values, in units of its size.
[[nodiscard]] Eigen::MatrixXd effect_columns(const World& world,
                                             const std::vector<MeasuringPose>& poses,
                                             const Effect& effect);

/// Orthonormal directions that `columns` can make: singular values of 1 (one sigma for a reasonable
/// change) and above.
[[nodiscard]] Eigen::MatrixXd directions_of(const Eigen::MatrixXd& columns);
/// `rows` without their parts along `directions`.
[[nodiscard]] Eigen::MatrixXd outside(const Eigen::MatrixXd& directions,
                                      const Eigen::MatrixXd& rows);

/// Poses not set aside for validation.
[[nodiscard]] std::vector<MeasuringPose> training_poses(const World& world);

}  // namespace trammel::hidden
