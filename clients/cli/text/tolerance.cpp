#include "clients/cli/text/tolerance.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "server/base/units.h"

namespace trammel::cli {
namespace {

constexpr double kSure = 0.95;

/// Probability that |e| <= r, for e with a mean of this length and this standard deviation of each
/// axis.
double inside(double r, double mean, double stddev) {
  if (stddev <= 0) return mean <= r ? 1 : 0;
  const double a = (r - mean) / stddev, b = (r + mean) / stddev;
  if (mean < 1e-6 * stddev) {
    const double x = r / stddev;
    return std::erf(x / std::sqrt(2.0)) - std::sqrt(2 / kPi) * x * std::exp(-0.5 * x * x);
  }
  const double tail = std::exp(-0.5 * a * a) - std::exp(-0.5 * b * b);
  return std::max(0.0, 0.5 * (std::erf(a / std::sqrt(2.0)) + std::erf(b / std::sqrt(2.0))) -
                           stddev / (mean * std::sqrt(2 * kPi)) * tail);
}

/// The share of errors with this rms that are inside the tolerance.
double share_inside(double tolerance, double rms, double sigma) {
  const double mean = std::sqrt(std::max(0.0, rms * rms - 3 * sigma * sigma));
  return inside(tolerance, mean, sigma);
}

}  // namespace

bool surely_inside(const ExpectedError& target, double tolerance_mm) {
  return std::isfinite(target.after_mm + target.sigma_mm) &&
         share_inside(tolerance_mm, target.after_mm, target.sigma_mm) >= kSure;
}

ToleranceVerdict tolerance_verdict(const std::vector<ExpectedError>& targets, double tolerance_mm) {
  ToleranceVerdict verdict{tolerance_mm};
  for (const ExpectedError& one : targets) {
    if (!std::isfinite(one.before_mm + one.after_mm + one.sigma_mm)) {
      ++verdict.unknown;
      continue;
    }
    ++verdict.targets;
    if (!one.in_domain) ++verdict.out_of_domain;
    const double before = share_inside(tolerance_mm, one.before_mm, one.sigma_mm);
    const double after = share_inside(tolerance_mm, one.after_mm, one.sigma_mm);
    verdict.expected_before += before;
    verdict.expected_after += after;
    if (before >= kSure) ++verdict.before;
    if (after >= kSure) ++verdict.after;
  }
  return verdict;
}

std::string verdict_text(const ToleranceVerdict& verdict) {
  return fmt::format(
             "tolerance {:.4g} mm: {} of {} targets are inside with 95 % or more (before: {}); "
             "{:.1f} are expected inside",
             verdict.tolerance_mm, verdict.after, verdict.targets, verdict.before,
             verdict.expected_after) +
         (verdict.unknown > 0 ? fmt::format("; of {} the error is not known", verdict.unknown)
                              : "");
}

Status check_strictly(const std::string& left_alone,
                      const std::optional<ToleranceVerdict>& verdict) {
  if (!left_alone.empty())
    return refused("nothing is written: {}", left_alone.substr(0, left_alone.size() - 1));
  if (!verdict) return {};
  if (verdict->after == verdict->targets && verdict->unknown == 0 && verdict->out_of_domain == 0)
    return {};
  std::string why = verdict_text(*verdict);
  if (verdict->out_of_domain > 0)
    why += fmt::format("; {} are out of domain", verdict->out_of_domain);
  return refused("nothing is written: {}", why);
}

nlohmann::ordered_json tolerance_json(const ToleranceVerdict& verdict) {
  return {{"tolerance_mm", verdict.tolerance_mm},
          {"targets", verdict.targets},
          {"inside_before", verdict.before},
          {"inside_after", verdict.after},
          {"expected_inside_after", verdict.expected_after},
          {"out_of_domain", verdict.out_of_domain}};
}

}  // namespace trammel::cli
