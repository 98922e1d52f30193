#include "server/calibrate/gauges/gauge_doubt.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "server/base/units.h"
#include "server/calibrate/calibrate.h"
#include "server/calibrate/frames/frames.h"
#include "server/calibrate/identify/weighting.h"
#include "server/error_sources/catalogue.h"
#include "server/measurement/reading_units.h"

namespace trammel {

namespace {

using CellPtr = std::shared_ptr<const Cell>;

constexpr double kNowhere = std::numeric_limits<double>::infinity();
constexpr double kFarRow = 0.1;  // m: no drawing is so far off at a single row
constexpr double kAsked = 3;     // times the stated sigma, for touches: a larger misfit starts the
                                 // search for another reading
constexpr double kMuchBetter = 0.2;  // share of the misfit as given, relative to the spread of the
                                     // values; below it the other reading was surely meant

/// The rows of one kind, their values times `factor`.
MeasurementBatch read_as(MeasurementBatch batch, Gauge::Kind kind, double factor) {
  std::erase_if(batch.measurements,
                [kind](const Measurement& m) { return !m.gauge || m.gauge->kind != kind; });
  for (Measurement& m : batch.measurements) m.gauge->value *= factor;
  return batch;
}

double median_size(const Eigen::VectorXd& values) {
  std::vector<double> sizes;
  for (const double value : values) sizes.push_back(std::abs(value));
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return *middle;
}

/// m: the deviation of each distance from that of the arm as drawn, with the base fitted to the
/// distances. Empty if they determine no base.
std::optional<Eigen::VectorXd> off_drawing(const CellPtr& cell, const MeasurementBatch& distances) {
  const auto found =
      calibrate(cell, {std::string(cause_correcting(causes::Part::kBase).spelling)}, distances, {});
  if (!found) return std::nullopt;
  return residuals_of(found->model, distances, found->model.values).gauge;
}

/// Doubts rows whose distance is in another unit than the others, by their deviations `off`.
std::optional<Error> doubt_of_rows(const MeasurementBatch& distances, const Eigen::VectorXd& off) {
  for (const UnitOfLength& unit : kUnitsOfLength) {
    std::vector<int> rows;
    double worst = 0;
    for (Eigen::Index i = 0; i < off.size(); ++i) {
      const Measurement& m = distances.measurements[static_cast<std::size_t>(i)];
      const double then = off(i) + (unit.factor - 1) * m.gauge->value;
      if (std::abs(off(i)) < kFarRow || std::abs(then) > kNoModelError) continue;
      rows.push_back(m.row);
      worst = std::max(worst, std::abs(off(i)));
    }
    if (rows.empty()) continue;
    const bool one = rows.size() == 1;
    return refused(
               "{} of {} distances {} not follow the joints, by up to {:.0f} mm: {} {}; read in {} "
               "{} would fit",
               rows.size(), off.size(), one ? "does" : "do", to_mm(worst), one ? "row" : "rows",
               fmt::format("{}", fmt::join(rows, ", ")), unit.name, one ? "it" : "they")
        .of("distance_mm")
        .at_row(rows.front())
        .beyond(to_mm(worst), to_mm(kFarRow))
        .with_text(fmt::format("in {}", unit.name))
        .next("write all rows in mm")
        .value();
  }
  return std::nullopt;
}

std::optional<Error> doubt_of_distances(const CellPtr& cell, const MeasurementBatch& batch) {
  const MeasurementBatch distances = read_as(batch, Gauge::Kind::kDistance, 1);
  if (distances.measurements.empty()) return std::nullopt;
  const auto given = off_drawing(cell, distances);
  const double as_given = given ? median_size(*given) : kNowhere;
  if (as_given < kNoModelError) return doubt_of_rows(distances, *given);
  for (const UnitOfLength& unit : kUnitsOfLength) {
    const auto then = off_drawing(cell, read_as(batch, Gauge::Kind::kDistance, unit.factor));
    if (!then || median_size(*then) > std::min(kNoModelError, kMuchBetter * as_given)) continue;
    return refused(
               "the distances do not follow the joints; read in {} they would, to {:.1f} mm of the "
               "drawing",
               unit.name, to_mm(median_size(*then)))
        .of("distance_mm")
        .beyond(given ? to_mm(as_given) : kNowhere, to_mm(kNoModelError))
        .with_text(fmt::format("in {}", unit.name))
        .next("write them in mm")
        .value();
  }
  return std::nullopt;
}

/// A way in which touches may have been meant.
struct TouchReading {
  std::string name;
  double factor;
};

std::vector<TouchReading> touch_readings() {
  std::vector<TouchReading> all = {{"with the other sign", -1}};
  for (const UnitOfLength& unit : kUnitsOfLength) {
    all.push_back({fmt::format("in {}", unit.name), unit.factor});
    all.push_back({fmt::format("in {} with the other sign", unit.name), -unit.factor});
  }
  return all;
}

/// m: the residual of a touch under the arm that the touches identify.
double left_of_touches(const CellPtr& cell, const MeasurementBatch& touches) {
  const auto found =
      calibrate(cell, with_unknown_tool(cell->model.error_sources, *cell), touches, {});
  return found ? std::hypot(position_sigma(touches.measurements.front(), *cell), found->discrepancy)
               : kNowhere;
}

std::optional<Error> doubt_of_touches(const CellPtr& cell, const MeasurementBatch& batch) {
  const MeasurementBatch touches = read_as(batch, Gauge::Kind::kTouch, 1);
  if (touches.measurements.empty()) return std::nullopt;
  const double as_given = left_of_touches(cell, touches);
  if (as_given < kAsked * position_sigma(touches.measurements.front(), *cell)) return std::nullopt;
  const TouchReading* best = nullptr;
  double least = kNowhere;  // beside how the values spread
  const std::vector<TouchReading> readings = touch_readings();
  for (const TouchReading& reading : readings) {
    const double shrinks = std::max(1.0, 1 / std::abs(reading.factor));
    const double then =
        shrinks * left_of_touches(cell, read_as(batch, Gauge::Kind::kTouch, reading.factor));
    if (then >= least) continue;
    least = then;
    best = &reading;
  }
  if (best == nullptr || !(least < std::min(kNoModelError, kMuchBetter * as_given)))
    return std::nullopt;
  return refused("the touches do not follow the joints{}; read {} they would fit to {:.2f} mm",
                 std::isfinite(as_given) ? fmt::format(": {:.2f} mm off", to_mm(as_given)) : "",
                 best->name, to_mm(least))
      .of("touch_mm")
      .beyond(to_mm(as_given), to_mm(kMuchBetter * as_given))
      .with_text(best->name)
      .next("correct the file if it was meant so")
      .value();
}

}  // namespace

std::optional<Error> gauge_doubt(const MeasurementBatch& batch, const Cell& cell) {
  const auto shared = std::make_shared<const Cell>(cell);
  if (auto doubt = doubt_of_distances(shared, batch)) return doubt;
  return doubt_of_touches(shared, batch);
}

}  // namespace trammel
