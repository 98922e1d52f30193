#pragma once

#include "server/robot/pose.h"

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
};

}  // namespace trammel
