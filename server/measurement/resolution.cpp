#include "server/measurement/resolution.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "server/base/median.h"
#include "server/base/units.h"

namespace trammel {

namespace {

constexpr std::size_t kFewestValues = 10;
constexpr double kFewestSteps = 5;    // over which the values extend; with fewer they hardly differ
constexpr double kSameNumber = 1e-6;  // of a step: rounding in the last bits of a value
constexpr double kCounts = 0.5;       // of the stated sigma
constexpr std::array<double, 12> kSteps = {10,   5,     1,     0.5,  0.1,  0.05,
                                           0.01, 0.005, 0.001, 5e-4, 2e-4, 1e-4};

bool are_multiples(const std::vector<double>& values, double step) {
  return std::all_of(values.begin(), values.end(), [step](double value) {
    const double count = value / step;
    return std::abs(count - std::round(count)) < kSameNumber;
  });
}

std::vector<double> stated_sigmas(const MeasurementBatch& batch, const Cell& cell, bool of_gauges) {
  std::vector<double> all;
  for (const Measurement& m : batch.measurements)
    if (m.gauge.has_value() == of_gauges) all.push_back(m.sigma.value_or(cell.tracker.sigma));
  return all;
}

/// Each kind of number separately: three coordinates, or gauges.
std::vector<std::vector<double>> columns_mm(const MeasurementBatch& batch, bool of_gauges) {
  std::vector<std::vector<double>> all(of_gauges ? 1 : 3);
  for (const Measurement& m : batch.measurements) {
    if (m.gauge.has_value() != of_gauges || (m.gauge && !m.gauge->is_reading())) continue;
    for (std::size_t k = 0; k < all.size(); ++k)
      all[k].push_back(to_mm(of_gauges ? m.gauge->value : m.p_W(static_cast<Eigen::Index>(k))));
  }
  return all;
}

}  // namespace

std::optional<double> step_of(const std::vector<double>& values) {
  if (values.size() < kFewestValues) return std::nullopt;
  const auto [least, most] = std::minmax_element(values.begin(), values.end());
  for (const double step : kSteps)
    if (*most - *least >= kFewestSteps * step && are_multiples(values, step)) return step;
  return std::nullopt;
}

double Rounding::stddev() const { return step / std::sqrt(12.0); }

std::optional<Rounding> coarse_rounding(const MeasurementBatch& batch, const Cell& cell) {
  for (const bool of_gauges : {false, true}) {
    double coarsest = 0;
    for (const std::vector<double>& column : columns_mm(batch, of_gauges))
      coarsest = std::max(coarsest, step_of(column).value_or(0));
    if (coarsest == 0) continue;
    const Rounding rounding{from_mm(coarsest), median(stated_sigmas(batch, cell, of_gauges)),
                            of_gauges};
    if (rounding.stddev() > kCounts * rounding.sigma) return rounding;
  }
  return std::nullopt;
}

std::optional<double> sigma_of_rows(const MeasurementBatch& batch) {
  std::vector<double> all;
  std::size_t positions = 0;
  for (const Measurement& m : batch.measurements) {
    positions += m.gauge ? 0 : 1;
    if (!m.gauge && m.sigma) all.push_back(*m.sigma);
  }
  return 2 * all.size() > positions ? std::optional(median(all)) : std::nullopt;
}

std::optional<double> joint_step(const MeasurementBatch& batch) {
  std::vector<double> all;
  for (const Measurement& m : batch.measurements) {
    for (std::size_t j = 0; j < batch.joint_types.size(); ++j)
      if (batch.joint_types[j] == JointType::kRevolute &&
          m.context.q(static_cast<Eigen::Index>(j)) != 0)
        all.push_back(to_deg(m.context.q(static_cast<Eigen::Index>(j))));
  }
  const auto step = step_of(all);
  return step ? std::optional(from_deg(*step)) : std::nullopt;
}

}  // namespace trammel
