#pragma once

#include "server/measurement/measurement.h"

namespace trammel {

/// Repeatability: the scatter of one measurement, estimated from poses measured several times.
struct RepeatStatistics {
  int groups = 0;        ///< poses measured more than once
  int measurements = 0;  ///< the number of measurements in those groups
  double sigma =
      0;  ///< m, one axis of one measurement, pooled over the groups: robot and tracker together
  int degrees_of_freedom = 0;  ///< 3 (n - 1) summed over the groups; 0 = `sigma` is meaningless
  double sigma_rotation = 0;   ///< rad, one axis of one measured orientation, pooled
  int rotation_degrees_of_freedom = 0;
  /// Factor on the stated sigmas, >= 1: the square root of chi² per degree of freedom (Birge
  /// ratio). It is 1 if the ratio is below 1 or has fewer than 6 degrees of freedom.
  double sigma_factor = 1;
};

struct MergedRepeats {
  MeasurementBatch batch;
  RepeatStatistics statistics;
};

/// Merges repeats into one measurement per pose. Repeats have the same commanded joints (each
/// within 1e-6 rad or m), tool, payload, approach direction, session and set; measurements with a
/// velocity are never repeats. The average replaces the first measurement and keeps its pose id,
/// row, index and extra fields. The position is weighted by 1/sigma² (`default_sigma`, m, one axis,
/// if a row states none). The orientation is the rotation with the least squared angles. Time,
/// temperature, the pose before and the lagged temperatures are means of the recorded values. If
/// the batch has repeats, the sigma of each row becomes that of its (averaged) position,
/// `sigma_factor` / sqrt(sum 1/sigma²). So `sigma_factor` also applies to poses measured once. A
/// batch without repeats is returned unchanged. A change between repeats (a drift, a step) is
/// averaged out, so look for changes in the original batch.
[[nodiscard]] MergedRepeats merge_repeats(const MeasurementBatch& batch, double default_sigma);

}  // namespace trammel
