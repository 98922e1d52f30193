#pragma once

#include "server/robot/chain.h"

namespace trammel {

/// The region of a model's training poses. Inside, the learned bias counts in full; beyond the edge
/// it fades.
struct Domain {
  JointVector q_min, q_max;      ///< range of the training poses, rad
  double prior_share_limit = 0;  ///< of BiasPrediction::prior_share, at the edge
  double margin = 0.05;  ///< of a joint's range, for in_range(): WhatWasMeasured::range_margin()

  /// True if every joint is within the range of the training poses, or within the margin beyond it.
  /// Poses in range may still be far from all training poses, so WhatWasMeasured::is_near() is
  /// tested as well.
  [[nodiscard]] bool in_range(const JointVector& q) const;
  /// The weight of the bias at a pose, in [0, 1]: 1 inside; 0 if a joint is far out of range, or if
  /// the data say almost nothing there. Smooth in q and in `prior_share`.
  [[nodiscard]] double bias_weight(const JointVector& q, double prior_share) const;
  /// The variance by which one coordinate of the residual grows outside the range, m²: Σ_j (slope_j
  /// d_j)², with d_j the distance_beyond() of joint j. `slope`: m per rad, for a prismatic joint
  /// per m; empty: no growth.
  [[nodiscard]] double growth(const JointVector& q, const JointVector& slope,
                              const Chain& robot) const;
};

/// The effective distance of a joint that is `beyond` its range (rad, m). For a revolute joint it
/// is the chord of the angle, at most that of half a turn, since a full turn brings the joint back.
[[nodiscard]] double distance_beyond(const Joint& joint, double beyond);

}  // namespace trammel
