#pragma once

#include "server/measurement/measurement.h"

namespace trammel {

/// What measuring the same pose several times says about one measurement.
struct RepeatStatistics {
  int groups = 0;              ///< poses measured more than once
  int measurements = 0;        ///< in those groups
  double sigma = 0;            ///< m, one axis of one measurement, pooled over the groups: robot and tracker together
  int degrees_of_freedom = 0;  ///< 3 (n - 1) summed over the groups; 0 = `sigma` says nothing
  double sigma_rotation = 0;   ///< rad, one axis of one measured orientation, pooled
  int rotation_degrees_of_freedom = 0;
  /// What the stated sigmas were multiplied with, >= 1: the square root of chi² per degree of freedom (Birge ratio),
  /// where that is above 1 and known from 6 degrees of freedom at least.
  double sigma_factor = 1;
};

struct MergedRepeats {
  MeasurementBatch batch;
  RepeatStatistics statistics;
};

/// One measurement for each pose measured repeatedly. Repeats have the same commanded joints (each within 1e-6 rad or
/// m), tool, payload, approach direction and set; measurements with a velocity are never repeats. The average takes the
/// place of the first, with its pose id, row, index and extra fields: position weighted by 1/sigma² (`default_sigma`,
/// m, one axis, where a row states none), orientation the rotation with the least squared angles, time and temperature
/// the means of those recorded. Where the batch has repeats, each row's sigma is then that of its (averaged) position,
/// `sigma_factor` / sqrt(sum 1/sigma²): poses measured once share the scatter that the repeated ones show. A batch
/// without repeats comes back as it was. What changes between repeats (a drift, a step) is averaged over: look for that
/// in the batch itself.
[[nodiscard]] MergedRepeats merge_repeats(const MeasurementBatch& batch, double default_sigma);

}  // namespace trammel
