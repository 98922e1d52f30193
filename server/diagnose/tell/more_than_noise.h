#pragma once

#include <string>

#include "server/diagnose/tell/answers.h"

/// Whether what is left after all that was found is still the noise that is stated for a measurement.
///
/// With sigma known to a tenth, the sum of squares left is (1.1 sigma)^2 times a chi-square of as many degrees of
/// freedom as the fit has left, at the most. More than 1.3 times the stated sigma is more than noise, if chance makes
/// it in less than 1 of 100 batches: something is there that the poses do not say anything else of.
namespace trammel::cause_search {

enum class NoiseVerdict {
  kAsStated,
  kLarger,         ///< than stated, by more than a tenth: worth a note
  kMoreThanNoise,  ///< larger by more than three tenths, and not by chance
};
[[nodiscard]] NoiseVerdict judge_noise(const LeftOver& left);
/// Chance of as much or more, were sigma a tenth larger than stated; not below 1e-6.
[[nodiscard]] double chance_of_noise(const LeftOver& left);

/// Fills `left_position` and `left_rotation`; where either is more than noise, what is left is unexplained and depends
/// on nothing known; where it is larger than stated, `limits` says so. Verdict as the findings say, else `unknown`.
void tell_noise(const Explained& explained, const PreparedBatch& prepared, Diagnosis& diagnosis);

}  // namespace trammel::cause_search
