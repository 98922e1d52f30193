#pragma once

#include <vector>

#include "server/health/foreign_poses.h"
#include "server/health/health_verdict.h"

/// The verdict of a check, and the sentence that gives its reason.
namespace trammel::health {

/// m rms, base refitted: beyond it no small change shows, and effects are not linear.
inline constexpr double kFarOff = kNeverOff;

/// The reasons that keep a check from naming a change, or from being certain of it.
struct Doubt {
  bool is_too_far = false;  ///< the poses are off by more than a small change makes
  double scatter = 0;  ///< times a healthy robot's residuals, where nothing explains them better
                       ///< than noise; or 0
  std::vector<int>
      in_tool{};  ///< joints (0-based) with zeros that a named tool absorbs at any poses
};
/// Sets the verdict of a check from its other members.
void tell_verdict(const HealthOptions& options, const Doubt& doubt, HealthCheck& check);

}  // namespace trammel::health
