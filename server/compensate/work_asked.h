#pragma once

#include <optional>
#include <vector>

#include "server/compensate/compensated_model.h"

namespace trammel {

/// The promise of a model at poses that a cell was asked for.
struct PromisedAtWork {
  int out_of_domain = 0;  ///< of the poses
  double rms = 0;         ///< m, of the stated standard deviations of the true position, Euclidean
};

/// The work of a cell, by its model and by another one that may follow.
struct WorkAsked {
  int poses = 0;  ///< whose tool and payload the models know; the others are left out
  PromisedAtWork in_force;
  std::optional<PromisedAtWork> other;
  /// The distance between the predictions of the two, m; 0 without another one.
  double difference_rms = 0, difference_max = 0;
  /// The poses at which the two are farthest apart, the farthest first.
  struct Step {
    PoseContext pose;
    double difference = 0;  ///< m
  };
  std::vector<Step> farthest;
  /// The poses to measure next: where the model in force is least certain, and not near each other.
  std::vector<PoseContext> measure_next;
};

/// `other`: null if there is no model to compare with.
[[nodiscard]] WorkAsked work_asked(const CompensatedModel& in_force, const CompensatedModel* other,
                                   const std::vector<PoseContext>& poses);

}  // namespace trammel
