#include "server/compensate/domain.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace trammel {

namespace {

constexpr double kDomainMargin =
    0.05;  // of a joint's training range: a Latin hypercube leaves this much at its edges
constexpr double kLeastMargin = 1e-9;  // rad, for a joint that stood still: rounding
constexpr double kRangeFade = 0.20;    // of the range: from the margin to the point where the bias
                                       // has faded out
constexpr double kLeastFade =
    0.01;  // rad, for a joint that stood still: several times its motion in a correction
constexpr double kUnknownShare = 0.5;  // half of the prior variance is left: the bias knows little
constexpr double kLeastFadeOfShare = 2.0;  // times the limit, where the limit itself is high
constexpr double kKnownExactly = 1e-12;    // of the prior variance; keeps the logarithm finite

/// 1 up to `from`, 0 beyond `to`, smooth between.
double fading(double x, double from, double to) {
  const double t = std::clamp((x - from) / (to - from), 0.0, 1.0);
  return (1 - t) * (1 - t) * (1 + 2 * t);
}

}  // namespace

bool Domain::in_range(const JointVector& q) const {
  const Eigen::ArrayXd beyond = margin * (q_max - q_min).array() + kLeastMargin;
  return (q.array() >= q_min.array() - beyond).all() && (q.array() <= q_max.array() + beyond).all();
}

double Domain::bias_weight(const JointVector& q, double prior_share) const {
  double weight = 1;
  for (Eigen::Index j = 0; j < q.size(); ++j) {
    const double range = q_max(j) - q_min(j);
    const double beyond = std::max(q_min(j) - q(j), q(j) - q_max(j));
    const double full = kDomainMargin * range + kLeastMargin;
    weight *= fading(beyond, full, full + kRangeFade * range + kLeastFade);
  }
  // Shares span decades, so the fade is one of their logarithm.
  const double limit = std::max(prior_share_limit, kKnownExactly);
  const double unknown = std::max(kUnknownShare, kLeastFadeOfShare * limit);
  return weight *
         fading(std::log(std::max(prior_share, kKnownExactly)), std::log(limit), std::log(unknown));
}

double Domain::growth(const JointVector& q, const JointVector& slope, const Chain& robot) const {
  double variance = 0;
  for (Eigen::Index j = 0; j < slope.size(); ++j) {
    const double beyond = std::max(q_min(j) - q(j), q(j) - q_max(j));
    if (beyond > 0)
      variance += std::pow(slope(j) * distance_beyond(robot.joint(static_cast<int>(j)), beyond), 2);
  }
  return variance;
}

double distance_beyond(const Joint& joint, double beyond) {
  if (joint.type == JointType::kPrismatic) return beyond;
  return 2 * std::sin(std::min(beyond, std::numbers::pi) / 2);
}

}  // namespace trammel
