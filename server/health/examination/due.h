#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "server/health/health_verdict.h"

/// When the next check is due.
namespace trammel::health {

/// Unix time, s; empty: not known.
struct CheckTimes {
  std::optional<std::int64_t> model, check;
};

/// The misfit of each of drift_variances() to the residuals, if the effects of all single causes
/// are normal with equal variance. `drift`: R x S, the effects of signals of 1 m rms at the check's
/// poses. Both whitened and refitted.
[[nodiscard]] std::vector<double> misfits_of_drift(Eigen::MatrixXd drift,
                                                   const Eigen::VectorXd& residual);

/// Sets the date of the next check: when the effect of the drift may exceed the tolerance (95 %) at
/// the highest rate that all checks together leave likely (95 %). While too few checks show a rate,
/// kUsualInterval after the check (after the model, if both are of one day). `misfits`:
/// misfits_of_drift(), called if times are known.
void tell_due(const HealthOptions& options, const CheckTimes& times,
              const std::function<std::vector<double>()>& misfits, HealthCheck& check);

}  // namespace trammel::health
