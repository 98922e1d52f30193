#include "server/calibrate/gauges/gauge_doubt.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "server/base/median.h"
#include "server/base/units.h"
#include "server/calibrate/calibrate.h"
#include "server/calibrate/frames/frames.h"
#include "server/calibrate/gauges/locate_anchors.h"
#include "server/calibrate/identify/weighting.h"
#include "server/error_sources/catalogue.h"
#include "server/measurement/reading_units.h"

namespace trammel {

namespace {

using CellPtr = std::shared_ptr<const Cell>;

constexpr double kNowhere = std::numeric_limits<double>::infinity();
constexpr double kFarRow = 0.1;     // m: no drawing is so far off at a single row
constexpr double kFarAnchor = 0.1;  // m: a base is set to some cm, and its anchors with it
constexpr double kAsked = 3;  // times the stated sigma, for touches: a larger misfit starts the
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

/// `kind`: kDistance or kApart.
std::optional<Error> doubt_of_distances(const CellPtr& cell, const MeasurementBatch& batch,
                                        Gauge::Kind kind) {
  const MeasurementBatch distances = read_as(batch, kind, 1);
  if (distances.measurements.empty()) return std::nullopt;
  const auto given = off_drawing(cell, distances);
  const double as_given = given ? median_size(*given) : kNowhere;
  if (as_given < kNoModelError) return doubt_of_rows(distances, *given);
  for (const UnitOfLength& unit : kUnitsOfLength) {
    const auto then = off_drawing(cell, read_as(batch, kind, unit.factor));
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

/// The distances to one anchor, and the tool points of the arm as drawn.
struct Wire {
  std::vector<Vector3> points_W;
  std::vector<double> lengths;  ///< m
  std::optional<Vector3> stated;
  std::optional<LocatedPoint> found;

  bool is_zero_known = false;

  /// m: median of the length errors if the anchor stands there, apart from an unknown zero.
  [[nodiscard]] double off_at(const Vector3& place) const {
    std::vector<double> off, sizes;
    for (std::size_t i = 0; i < lengths.size(); ++i)
      off.push_back(lengths[i] - (points_W[i] - place).norm());
    const double zero = is_zero_known ? 0 : median(off);
    for (const double one : off) sizes.push_back(std::abs(one - zero));
    return median(std::move(sizes));
  }
  [[nodiscard]] bool fits() const { return found && found->off < kNoModelError; }
  [[nodiscard]] bool stands_as_stated() const {
    return fits() && stated && off_at(*stated) < kFarAnchor;
  }
};

/// By anchor; empty if a tool is unknown.
std::map<std::string, Wire> wires_of(const Cell& cell, const MeasurementBatch& distances) {
  std::map<std::string, Wire> all;
  const Anchors anchors = anchors_of(cell).value_or(Anchors{});
  for (const Measurement& m : distances.measurements) {
    const auto& X_FT = cell.tools.at(m.context.tool);
    const auto anchor = anchors.find(m.gauge->anchor);
    if (!X_FT || anchor == anchors.end()) return {};
    if (m.gauge->minus != nullptr) continue;
    Wire& wire = all[m.gauge->anchor];
    wire.stated = anchor->second.p_W;
    wire.is_zero_known = anchor->second.zero.has_value();
    wire.points_W.push_back(cell.X_WB.value_or(Pose::Identity()) *
                            (cell.robot.flange_pose(m.context.q) * X_FT->translation()));
    wire.lengths.push_back(m.gauge->value - anchor->second.zero.value_or(0));
  }
  for (auto& [id, wire] : all) wire.found = locate_point(wire.points_W, wire.lengths);
  return all;
}

/// A wire with another unit than the others.
std::optional<Error> doubt_of_wire_unit(const std::string& anchor, const Wire& wire) {
  if (!wire.found || wire.fits()) return std::nullopt;
  for (const UnitOfLength& unit : kUnitsOfLength) {
    std::vector<double> lengths = wire.lengths;
    for (double& length : lengths) length *= unit.factor;
    const auto then = locate_point(wire.points_W, lengths);
    if (!then || then->off > std::min(kNoModelError, kMuchBetter * wire.found->off)) continue;
    return refused(
               "the distances to anchor '{}' do not follow the joints, by {:.0f} mm, while others "
               "do; read in {} they would, to {:.1f} mm of the drawing",
               anchor, to_mm(wire.found->off), unit.name, to_mm(then->off))
        .of("distance_mm")
        .beyond(to_mm(wire.found->off), to_mm(kNoModelError))
        .with_text(fmt::format("in {}", unit.name))
        .next(fmt::format("write those to '{}' in mm", anchor))
        .value();
  }
  return std::nullopt;
}

/// The places that may have been intended by `stated`.
std::vector<std::pair<std::string, Vector3>> meant_places(const Vector3& stated) {
  std::vector<std::pair<std::string, Vector3>> all;
  for (int k = 0; k < 3; ++k) {
    Vector3 p = stated;
    p(k) = -p(k);
    all.emplace_back(fmt::format("with the other sign of its {}", "xyz"[k]), p);
    p = stated;
    std::swap(p(k), p((k + 1) % 3));
    all.emplace_back(fmt::format("with its {} and {} exchanged", "xyz"[k], "xyz"[(k + 1) % 3]), p);
  }
  for (const UnitOfLength& unit : kUnitsOfLength)
    all.emplace_back(fmt::format("with its place in {}", unit.name), unit.factor * stated);
  return all;
}

/// An anchor that stands elsewhere than the cell file says, and the mistake that explains it.
std::optional<Error> doubt_of_place(const std::string& anchor,
                                    const std::map<std::string, Wire>& wires) {
  const Wire& wire = wires.at(anchor);
  if (!wire.fits() || !wire.stated || wire.stands_as_stated()) return std::nullopt;
  const double off = wire.off_at(*wire.stated);
  auto meant = meant_places(*wire.stated);
  for (const auto& [other, one] : wires)
    if (other != anchor && one.stated)
      meant.emplace_back(fmt::format("with the place of '{}'", other), *one.stated);
  std::string reading = "at another place", then;
  double least = kMuchBetter * off;
  for (const auto& [name, place] : meant) {
    if (wire.off_at(place) > least) continue;
    least = wire.off_at(place);
    reading = name;
    then = fmt::format("; read {} they would fit to {:.1f} mm", name, to_mm(least));
  }
  const Vector3& p = wire.found->p_W;
  return refused(
             "the distances to anchor '{}' are {:.0f} mm off from where the cell file has it, "
             "while those to others fit{}",
             anchor, to_mm(off), then)
      .of("anchors")
      .beyond(to_mm(off), to_mm(kFarAnchor))
      .with_text(fmt::format("anchor '{}' {}", anchor, reading))
      .next(
          fmt::format("correct xyz_mm of '{}' in the cell file: the distances put it near [{:.0f}, "
                      "{:.0f}, {:.0f}]",
                      anchor, to_mm(p.x()), to_mm(p.y()), to_mm(p.z())))
      .value();
}

/// One wire among others that fit.
std::optional<Error> doubt_of_wires(const Cell& cell, const MeasurementBatch& batch) {
  const auto wires = wires_of(cell, read_as(batch, Gauge::Kind::kDistance, 1));
  const auto some = [&](const auto& holds) {
    return std::any_of(wires.begin(), wires.end(),
                       [&](const auto& one) { return holds(one.second); });
  };
  const bool some_fit = some([](const Wire& wire) { return wire.fits(); });
  const bool some_stand = some([](const Wire& wire) { return wire.stands_as_stated(); });
  for (const auto& [anchor, wire] : wires) {
    if (some_fit)
      if (auto doubt = doubt_of_wire_unit(anchor, wire)) return doubt;
    if (some_stand && cell.X_WB)
      if (auto doubt = doubt_of_place(anchor, wires)) return doubt;
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
  if (auto doubt = doubt_of_wires(cell, batch)) return doubt;
  for (const Gauge::Kind kind : {Gauge::Kind::kDistance, Gauge::Kind::kApart})
    if (auto doubt = doubt_of_distances(shared, batch, kind)) return doubt;
  return doubt_of_touches(shared, batch);
}

}  // namespace trammel
