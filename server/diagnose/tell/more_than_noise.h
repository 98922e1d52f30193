#pragma once

#include <string>

#include "server/diagnose/tell/answers.h"
#include "server/diagnose/tell/findings.h"

/// Tells whether what is left after all that was found is still the noise that is stated for a
/// measurement.
///
/// sigma is known to a tenth (one standard uncertainty), and the sum of squares left over sigma^2
/// is a chi-square of as many degrees of freedom as the fit has left. So the logarithm of what is
/// left over what is stated has a standard deviation of hypot(0.1, 1/sqrt(2 degrees of freedom));
/// beyond two of them something is there of which the poses say nothing else.
namespace trammel::cause_search {

enum class NoiseVerdict {
  kAsStated,
  kLarger,         ///< than stated, and not by chance, but sigma may be that: worth a note
  kMoreThanNoise,  ///< larger than chance and the uncertainty of sigma allow: 1.23 times of many
                   ///< poses
};
[[nodiscard]] NoiseVerdict judge_noise(const LeftOver& left);
/// Chance of as much or more; not below 1e-6.
[[nodiscard]] double chance_of_noise(const LeftOver& left);

/// Times the stated sigma: noise of the measurement that repeated poses vouch for. Where they
/// scatter by more than measurements do, something moved between them, and they vouch for nothing.
[[nodiscard]] double vouched_by(const RepeatStatistics& repeats);

/// True if what the extended model leaves, of all poses or of one session, is more than noise, or
/// repeated poses scatter by more.
[[nodiscard]] bool leaves_more_than_noise(const Explained& explained,
                                          const PreparedBatch& prepared);

/// The rest beside all that has a name. It is more than noise where
/// - something was found that has no name;
/// - the extended model leaves more than the measurement;
/// - the extended model is worse on the poses held out, if there are enough of them (`diagnosis`
/// has their errors): it
///   says something else than what is there.
[[nodiscard]] Remainder remainder_of(const Explained& explained, const PreparedBatch& prepared,
                                     const Diagnosis& diagnosis);

/// Fills `left_position` and `left_rotation`; where either is more than noise, what is left is
/// unexplained and depends on nothing known; where it is larger than stated, `limits` says so.
void tell_noise(const Explained& explained, const PreparedBatch& prepared, Diagnosis& diagnosis);

}  // namespace trammel::cause_search
