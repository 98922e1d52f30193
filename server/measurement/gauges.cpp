#include "server/measurement/gauges.h"

#include <algorithm>
#include <vector>

#include "server/measurement/pose_check.h"

namespace trammel {

namespace {

/// The anchor that is named, or the only one.
Result<std::string> resolved(const std::string& name, const Cell& cell, const Anchors& anchors) {
  std::vector<std::string> ids;
  for (const auto& [id, anchor] : anchors) ids.push_back(id);
  const std::string known = ids.empty() ? "none" : fmt::format("{}", fmt::join(ids, ", "));
  if (name.empty() && ids.size() == 1) return ids.front();
  Failure why =
      name.empty() ? refused("cell {}: no anchor named, and the cell has {}", cell.name, ids.size())
                   : refused("cell {}: unknown anchor '{}'", cell.name, name);
  if (!name.empty() && anchors.contains(name)) return name;
  return std::move(why)
      .of("anchor_id")
      .with_text(name)
      .next(fmt::format(
          "known: {}; anchors stand in the cell file, anchors: {{a1: {{xyz_mm: null}}}}", known));
}

/// Checks the pose against which the gauge is read, and completes it from the cell.
Status check_minus(Gauge& gauge, const Cell& cell) {
  if (gauge.minus == nullptr) return {};
  PoseContext other = *gauge.minus;
  TRY(check_pose(other, cell));
  gauge.minus = std::make_shared<const PoseContext>(std::move(other));
  return {};
}

}  // namespace

bool has_gauges(const MeasurementBatch& batch) {
  return std::any_of(batch.measurements.begin(), batch.measurements.end(),
                     [](const Measurement& m) { return m.gauge.has_value(); });
}

bool has_positions(const MeasurementBatch& batch) {
  return std::any_of(batch.measurements.begin(), batch.measurements.end(),
                     [](const Measurement& m) { return !m.gauge; });
}

MeasurementBatch positions_of(const MeasurementBatch& batch) {
  MeasurementBatch positions = batch;
  std::erase_if(positions.measurements, [](const Measurement& m) { return m.gauge.has_value(); });
  return positions;
}

std::optional<MeasurementBatch> about_one_point(const MeasurementBatch& batch) {
  MeasurementBatch positions = batch;
  for (Measurement& m : positions.measurements) {
    if (!m.gauge || m.gauge->kind != Gauge::Kind::kContact ||
        m.gauge->anchor != batch.measurements.front().gauge->anchor)
      return std::nullopt;
    m.gauge.reset();
    m.p_W.setZero();
  }
  return positions;
}

Status require_positions(const MeasurementBatch& batch, const std::string& who) {
  const auto gauged = std::find_if(batch.measurements.begin(), batch.measurements.end(),
                                   [](const Measurement& m) { return m.gauge.has_value(); });
  if (gauged == batch.measurements.end()) return {};
  const std::string column =
      gauged->gauge->kind == Gauge::Kind::kTouch ? "touch_mm" : "distance_mm";
  return refused("a row has {} and no position, {} works with positions alone", column, who)
      .in(batch.where.empty() ? "batch " + batch.id : batch.where)
      .at_row(gauged->row)
      .of(column)
      .next(
          "distances, touches and contacts are for train --bias none, and for evaluate; contacts "
          "with "
          "one point alone also for check");
}

Status check_gauge(Measurement& measurement, const Cell& cell, const Anchors& anchors) {
  if (!measurement.gauge) return {};
  Gauge& gauge = *measurement.gauge;
  if (gauge.kind == Gauge::Kind::kApart) return check_minus(gauge, cell);
  const bool is_named = anchors.contains(gauge.anchor) || gauge.anchor.empty();
  if (gauge.kind == Gauge::Kind::kContact && (anchors.empty() || !is_named)) return {};
  std::string id = TRY(resolved(gauge.anchor, cell, anchors));
  gauge.anchor = std::move(id);
  const Anchor& anchor = anchors.at(gauge.anchor);
  if (gauge.kind == Gauge::Kind::kTouch && anchor.shape == Anchor::Shape::kPoint) {
    return refused("touch_mm of anchor '{}', which is a point", gauge.anchor)
        .of("touch_mm")
        .with_text(gauge.anchor)
        .next(
            "say in the cell file what is touched: sphere_radius_mm, plane_normal, or ring_axis "
            "and ring_radius_mm");
  }
  if (gauge.kind == Gauge::Kind::kContact && anchor.shape != Anchor::Shape::kPoint) {
    return refused("distance_mm is 0 from anchor '{}', which is no point", gauge.anchor)
        .of("distance_mm")
        .with_text(gauge.anchor)
        .next("write touch_mm for what a surface was touched at");
  }
  if (!measurement.sigma) measurement.sigma = anchor.sigma;
  return check_minus(gauge, cell);
}

}  // namespace trammel
