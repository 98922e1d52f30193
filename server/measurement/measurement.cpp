#include "server/measurement/measurement.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "server/base/hash.h"
#include "server/measurement/pose_check.h"
#include "server/measurement/pose_columns.h"
#include "server/measurement/spread_check.h"

namespace trammel {

namespace {

constexpr double kOldestUnixTime = 1e9;  // s: September 2001; what is less counts from some other start
constexpr double kClockAhead = 86400;    // s by which the instrument's clock may be ahead of ours

}  // namespace

MeasurementBatch dated(MeasurementBatch batch, std::int64_t taken_in) {
  std::optional<double> newest;
  for (const Measurement& m : batch.measurements) {
    const double time = m.context.time.value_or(0);
    if (time < kOldestUnixTime || time > static_cast<double>(taken_in) + kClockAhead) continue;
    newest = std::max(newest.value_or(time), time);
  }
  batch.measured_at = newest ? static_cast<std::int64_t>(*newest) : taken_in;
  return batch;
}

Result<MeasurementBatch> check_against_cell(MeasurementBatch batch, const Cell& cell) {
  const std::string where = batch.where.empty() ? "batch " + batch.id : batch.where;
  if (batch.measurements.empty()) return refused("no measurements, at least 1 is needed").in(where).beyond(0, 1);
  if (batch.joint_types.empty()) batch.joint_types = joint_types(cell.robot);
  if (const Status columns = check_joint_columns(batch.joint_types, cell.robot, where); !columns) {
    return tl::make_unexpected(columns.error());
  }
  const auto timed = std::find_if(batch.measurements.begin(), batch.measurements.end(),
                                  [](const Measurement& m) { return m.context.time.has_value(); });
  const double origin = timed == batch.measurements.end() ? 0 : *timed->context.time;
  for (Measurement& measurement : batch.measurements) {
    if (measurement.context.time) *measurement.context.time -= origin;
    if (measurement.context.q.size() != cell.robot.size()) {
      return refused("{} joints, robot {} has {}", measurement.context.q.size(), cell.robot.name(), cell.robot.size())
          .in(where)
          .at_row(measurement.row)
          .beyond(measurement.context.q.size(), cell.robot.size());
    }
    const Status pose = check_pose(measurement.context, cell);
    if (!pose) return Failure(pose.error()).in(where).at_row(measurement.row);
  }
  if (const Status spread = check_spread(batch, cell, where); !spread) return tl::make_unexpected(spread.error());
  return batch;
}

namespace {

/// `count` of `size` rows, drawn without return. Fisher-Yates by hand: std::shuffle differs between libraries.
std::vector<bool> draw_rows(std::size_t size, std::size_t count, std::uint64_t seed) {
  std::vector<std::size_t> order(size);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::mt19937_64 random(seed);
  std::vector<bool> drawn(size, false);
  for (std::size_t i = 0; i < count; ++i) {
    std::swap(order[i], order[i + static_cast<std::size_t>(random() % (size - i))]);
    drawn[order[i]] = true;
  }
  return drawn;
}

std::vector<bool> validation_rows(const MeasurementBatch& batch, double share, std::uint64_t seed) {
  const auto& rows = batch.measurements;
  const bool assigned =
      std::any_of(rows.begin(), rows.end(), [](const Measurement& m) { return m.set != MeasurementSet::kUnassigned; });
  if (assigned) {
    std::vector<bool> validation;
    for (const Measurement& m : rows) validation.push_back(m.set == MeasurementSet::kValidation);
    return validation;
  }
  if (rows.empty()) return {};
  const double wanted = std::round(std::clamp(share, 0.0, 1.0) * static_cast<double>(rows.size()));
  return draw_rows(rows.size(), std::min(static_cast<std::size_t>(wanted), rows.size() - 1), seed);
}

}  // namespace

BatchSplit split_batch(const MeasurementBatch& batch, double validation_share, std::uint64_t seed) {
  const std::vector<bool> validation = validation_rows(batch, validation_share, seed);
  BatchSplit split{batch, batch};
  split.train.measurements.clear();
  split.validation.measurements.clear();
  for (std::size_t i = 0; i < batch.measurements.size(); ++i) {
    (validation[i] ? split.validation : split.train).measurements.push_back(batch.measurements[i]);
  }
  return split;
}

std::string batch_hash(const MeasurementBatch& batch) {
  return sha256_hex(batch.source_text.empty() ? to_csv(batch) : batch.source_text);
}

}  // namespace trammel
