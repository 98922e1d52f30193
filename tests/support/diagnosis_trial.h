#pragma once

#include <optional>
#include <string>

#include "server/base/result.h"
#include "server/diagnose/diagnose.h"
#include "tests/support/diagnosis_judge.h"

/// One hidden effect, one diagnosis from the three files alone, and its outcome.
namespace trammel::test {

struct Trial {
  std::string row;  ///< the row of the table to which it belongs
  hidden::HiddenSpec spec;
  bool compare_with_oracle = false;  ///< of the extended model's effect on the held-out poses
  bool compare_next_poses = false;   ///< with random ones
};

/// Standard deviation of the confounded effect: with this batch, with ten suggested poses more,
/// with ten random ones.
struct NextPosesWorth {
  double now = 0, suggested = 0, random = 0;

  [[nodiscard]] double random_over_suggested() const { return random / suggested; }
  /// The ratio to the reduction by random ones.
  [[nodiscard]] double reduction() const { return (now - suggested) / (now - random); }
};

struct TrialResult {
  Trial trial;
  std::string truth;  ///< `backlash:2`
  std::string error;  ///< the reason why there is no diagnosis; else empty
  Judgement judgement;
  double seconds = 0;
  /// The share of the requested lambda that the closest imitator with as few parameters cannot
  /// explain; empty: not computed.
  std::optional<double> beside_rival;
  std::string rival;
  double held_out_before_mm = 0, held_out_after_mm = 0;
  std::optional<double> oracle_mm;
  std::optional<NextPosesWorth> next_poses_claimed, next_poses_measured;
};

[[nodiscard]] Result<Diagnosis> diagnose_files(const hidden::HiddenCase& hidden,
                                               const DiagnoseOptions& options);
[[nodiscard]] TrialResult run_trial(const Trial& trial, const DiagnoseOptions& options);
/// The whole verdict, for people.
[[nodiscard]] std::string told(const Diagnosis& diagnosis);

}  // namespace trammel::test
