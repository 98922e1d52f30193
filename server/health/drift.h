#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

/// The rate at which an arm drifts away from its model, by all its checks.
///
/// Drift is a random walk of all single causes together: after a time t their effects over the
/// working poses are normal with the total variance r t. A check gives the likelihood of each
/// variance; together the checks give the likelihood of each rate r. Checks with overlapping times
/// have seen a part of the same walk: the squared effects of two of them correlate by (overlap)^2 /
/// (length * length). Together they count as the equivalent number of independent checks.
namespace trammel {

/// The evidence of one check about the drift.
struct DriftSeen {
  std::int64_t from = 0, until = 0;  ///< Unix time, s: when the model was measured, and the check
  std::vector<double>
      misfit;  ///< minus twice the log likelihood, beside the least, at drift_variances()
};
/// m^2, rising evenly in their logarithm.
[[nodiscard]] const std::vector<double>& drift_variances();

/// m^2 per second; 95 % of the likelihood lies above `least`, and 95 % below `most`.
struct DriftRate {
  double least = 0, best = 0, most = 0;
  int checks = 0;     ///< the number of checks behind it
  double weight = 0;  ///< the equivalent number of independent checks
  double span = 0;    ///< s, from the first model measured to the last check

  /// m, rms of the effect after so many seconds.
  [[nodiscard]] static double after(double rate, double seconds);
};
/// Empty: no check contributes (a check less than a day after its model does not).
[[nodiscard]] std::optional<DriftRate> drift_rate(const std::vector<DriftSeen>& checks);

}  // namespace trammel
