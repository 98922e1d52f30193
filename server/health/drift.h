#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

/// The rate at which an arm drifts away from its model, by all checks that were made of it.
///
/// Drift is a random walk of all single causes together: after a time t their effects over the
/// working poses are normal, of variance r t in all. A check says how likely each variance is;
/// together the checks say how likely each rate r is. Checks whose times overlap have seen a part
/// of the same walk: two of them have squared effects that correlate by (overlap)^2 / (length *
/// length), and all together count for as many as are independent.
namespace trammel {

/// The evidence of one check about the drift.
struct DriftSeen {
  std::int64_t from = 0, until = 0;  ///< Unix time, s: when the model was measured, and the check
  std::vector<double>
      misfit;  ///< minus twice the log likelihood, beside the least, at drift_variances()
};
/// m^2, rising evenly in their logarithm.
[[nodiscard]] const std::vector<double>& drift_variances();

/// m^2 a second; `least` and `most` are what 95 % of the likelihood lies above and below.
struct DriftRate {
  double least = 0, best = 0, most = 0;
  int checks = 0;     ///< how many say so
  double weight = 0;  ///< how many independent ones they are worth
  double span = 0;    ///< s, from the first model measured to the last check

  /// m, rms of the effect after so many seconds.
  [[nodiscard]] static double after(double rate, double seconds);
};
/// Empty: none of them says anything (a check less than a day after its model does not).
[[nodiscard]] std::optional<DriftRate> drift_rate(const std::vector<DriftSeen>& checks);

}  // namespace trammel
