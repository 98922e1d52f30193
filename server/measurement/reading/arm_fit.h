#pragma once

#include <map>
#include <string>
#include <vector>

#include "server/measurement/reading/number_table.h"

/// The fit of joints to positions, for any arm that the robot of a cell may be.
namespace trammel::reading {

/// A possible arm, with errors of building, mounting and mastering, and its fit to the positions of
/// a table.
///
/// The model: p_W = X_WB X_BF(q + zeros; links, compliance) p_FT. The base is free. A known tool is
/// off by 5 mm, each zero by 3 deg, each length by 3 mm, each twist by 0.3 deg, each compliance by
/// 3e-9 rad/Nmm (standard deviations); an unknown tool lies within a metre. In addition every
/// position is off by 1 mm.
struct ArmFit {
  Pose X_WB = Pose::Identity();
  std::map<std::string, Pose> tools;  ///< X_FT; the rotations are the cell's, or identity
  Eigen::VectorXd arm;                ///< deviations of the arm, SI: zeros first, one a joint
  double off = 0;               ///< m, rms distance of the positions that fit best, seven of ten
  double quality = 0;           ///< m, the same with a penalty for unlikely deviations
  double base_turn_stddev = 0;  ///< rad, of the base's rotation about its worst axis, for this arm
  Eigen::VectorXd stddev_of_zeros;                 ///< rad (m), a joint
  std::map<std::string, Matrix3> tool_covariance;  ///< m2, of the tool points
};

enum class ToolPoints {
  kAsDrawn,  ///< the frames of the cell, where it states them
  kAnywhere
};

/// Base and tools alone, by closed forms that a third of bad rows does not mislead.
[[nodiscard]] ArmFit located(const NumberTable& table, const Cell& cell,
                             ToolPoints points = ToolPoints::kAsDrawn);
/// All of the arm, from `start`.
[[nodiscard]] ArmFit fitted(const NumberTable& table, const Cell& cell, const ArmFit& start,
                            ToolPoints points = ToolPoints::kAsDrawn);

/// fitted() for positions at one place, which do not determine the turn of the base: the best fit
/// from several turns.
[[nodiscard]] ArmFit fitted_from_all_sides(const NumberTable& table, const Cell& cell,
                                           const ArmFit& start);

/// m, per row: the distance between the measured position and the predicted one.
[[nodiscard]] std::vector<double> distances(const NumberTable& table, const Cell& cell,
                                            const ArmFit& fit);
/// X_WF of a row.
[[nodiscard]] Pose flange_pose_W(const NumberTable& table, std::size_t row, const Cell& cell,
                                 const ArmFit& fit);

}  // namespace trammel::reading
