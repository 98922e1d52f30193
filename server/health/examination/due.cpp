#include "server/health/examination/due.h"

#include <algorithm>
#include <cmath>
#include <ctime>

#include "server/base/units.h"

namespace trammel::health {

namespace {

constexpr int kFewestChecks = 3;  // needed to estimate the drift of an arm

std::string date_of(std::int64_t unix_s) {
  const std::time_t time = unix_s;
  std::tm utc{};
  gmtime_r(&time, &utc);
  return fmt::format("{:04}-{:02}-{:02}", utc.tm_year + 1900, utc.tm_mon + 1, utc.tm_mday);
}

/// The basis of the next check's date; `since`: s from the model to this check.
std::string because_of(const DriftRate& rate, double since) {
  constexpr double kDay = 86400;  // s
  constexpr double kMonth = 30 * kDay;
  if (rate.checks == 1) {
    return fmt::format(
        "since the model was measured, {:.0f} days before, the arm has drifted by at most {:.3f} "
        "mm rms (95 %)",
        since / kDay, 2 * to_mm(DriftRate::after(rate.most, since)));
  }
  return fmt::format(
      "by {} checks over {:.0f} days the arm drifts by {:.3f} mm rms in 30 days ({:.3f} to {:.3f}, "
      "95 %)",
      rate.checks, rate.span / kDay, to_mm(DriftRate::after(rate.best, kMonth)),
      to_mm(DriftRate::after(rate.least, kMonth)), to_mm(DriftRate::after(rate.most, kMonth)));
}

}  // namespace

std::vector<double> misfits_of_drift(Eigen::MatrixXd drift, const Eigen::VectorXd& residual) {
  drift /= std::sqrt(static_cast<double>(drift.cols()));
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> along(drift * drift.transpose());
  const Eigen::VectorXd left = along.eigenvectors().transpose() * residual;
  std::vector<double> misfits;
  for (const double variance : drift_variances()) {
    const Eigen::ArrayXd all = 1 + variance * along.eigenvalues().array().max(0.0);
    misfits.push_back((all.log() + left.array().square() / all).sum());
  }
  const double least = *std::min_element(misfits.begin(), misfits.end());
  for (double& misfit : misfits) misfit -= least;
  return misfits;
}

void tell_due(const HealthOptions& options, const CheckTimes& times,
              const std::function<std::vector<double>()>& misfits, HealthCheck& check) {
  constexpr double kDay = 86400;  // s
  if (!check.changed.empty()) {
    check.due_because = "what changed comes first: train again, then check";
    return;
  }
  if (!times.model || !times.check || static_cast<double>(*times.check - *times.model) < kDay) {
    check.due_because = "it is not known when the model and the check were measured";
    if (!times.model || !times.check) return;
    check.due = date_of(*times.model + kUsualInterval);
    check.due_because = fmt::format(
        "{} days after the model's own measurements, which are less than a day older than the "
        "check",
        kUsualInterval / 86400);
    return;
  }
  check.drift = DriftSeen{*times.model, *times.check, misfits()};
  std::vector<DriftSeen> seen = options.earlier;
  seen.push_back(*check.drift);
  check.drift_rate = drift_rate(seen);
  const DriftRate& rate = *check.drift_rate;
  if (rate.checks < kFewestChecks) {
    check.due_because = fmt::format(
        "{}; to tell how fast it drifts needs {} checks of different days, so far there {} {}: "
        "until "
        "then every {} days",
        because_of(rate, static_cast<double>(*times.check - *times.model)), kFewestChecks,
        rate.checks > 1 ? "are" : "is", rate.checks, kUsualInterval / 86400);
    check.due = date_of(*times.check + kUsualInterval);
    return;
  }
  constexpr double kFarthest = 2 * 365.25 * kDay;
  const double until = (options.tolerance * options.tolerance) / (4 * rate.most);
  const double since = static_cast<double>(*times.check - *times.model);
  const double due = static_cast<double>(*times.model) + std::min(until, since + kFarthest);
  check.due = date_of(static_cast<std::int64_t>(std::max(due, static_cast<double>(*times.check))));
  check.due_because = because_of(rate, since);
}

}  // namespace trammel::health
