#pragma once

#include <string>

#include "server/diagnose/tell/answers.h"
#include "server/diagnose/tell/findings.h"

/// Tests whether the residual after all findings is still the stated noise of the measurement.
///
/// sigma is known to a tenth (one standard uncertainty), and the sum of squared residuals over
/// sigma^2 is a chi-square with the degrees of freedom that the fit leaves. So the logarithm of the
/// residual over the stated noise has a standard deviation of hypot(0.1, 1/sqrt(2 degrees of
/// freedom)). A deviation of more than two standard deviations means an effect that no other test
/// of the poses shows.
namespace trammel::cause_search {

enum class NoiseVerdict {
  kAsStated,
  kLarger,  ///< larger than stated, not by chance, but within the uncertainty of sigma: worth a
            ///< note
  kMoreThanNoise,  ///< larger than chance and the uncertainty of sigma allow: 1.23 times of many
                   ///< poses
};
[[nodiscard]] NoiseVerdict judge_noise(const LeftOver& left);
/// Chance of at least this residual; not below 1e-6.
[[nodiscard]] double chance_of_noise(const LeftOver& left);

/// Times the stated sigma: the noise of the measurement that repeated poses confirm. If they
/// scatter by more than measurements do, something moved between them, and they confirm nothing.
[[nodiscard]] double vouched_by(const RepeatStatistics& repeats);

/// True if the residual of the extended model, of all poses or of one session, is more than noise,
/// or if repeated poses scatter by more.
[[nodiscard]] bool leaves_more_than_noise(const Explained& explained,
                                          const PreparedBatch& prepared);

/// The remainder after all named findings. It is more than noise if
/// - something was found that has no name;
/// - the extended model leaves more than the measurement;
/// - the extended model is worse on the held-out poses, if there are enough of them (`diagnosis`
///   has their errors): its added causes are wrong.
[[nodiscard]] Remainder remainder_of(const Explained& explained, const PreparedBatch& prepared,
                                     const Diagnosis& diagnosis);

/// Fills `left_position` and `left_rotation`. If either is more than noise, the residual is
/// reported as unexplained, without a known dependence. If it is only larger than stated, `limits`
/// says so.
void tell_noise(const Explained& explained, const PreparedBatch& prepared, Diagnosis& diagnosis);

}  // namespace trammel::cause_search
