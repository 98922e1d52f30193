#pragma once

#include "server/robot/chain.h"

namespace trammel {

/// Where a model's training poses lie: up to its edge the learned bias is taken in full, beyond it fades.
struct Domain {
  JointVector q_min, q_max;      ///< range of the training poses, rad
  double prior_share_limit = 0;  ///< of the posterior in the prior variance, see BiasPrediction

  /// Whether every joint is within the range of the training poses or 5 % of it beyond.
  [[nodiscard]] bool in_range(const JointVector& q) const;
  /// How much of the bias to take at a pose, in [0, 1]: 1 inside; continuous with its slope in q and in `prior_share`;
  /// 0 where a joint is well out of range, or nearly as little is known as without data.
  [[nodiscard]] double bias_weight(const JointVector& q, double prior_share) const;
  /// m², of one coordinate: how much more than within range what the physics leaves over may be, Σ_j (slope_j d_j)²
  /// with d_j the distance_beyond() of joint j; 0 within range. `slope`: m by rad or m, empty for none.
  [[nodiscard]] double growth(const JointVector& q, const JointVector& slope, const Chain& robot) const;
};

/// How far a joint that is `beyond` its range, rad or m, is from it for what depends on it: of a revolute joint the
/// chord, since what turns comes back; never more than half a turn away.
[[nodiscard]] double distance_beyond(const Joint& joint, double beyond);

}  // namespace trammel
