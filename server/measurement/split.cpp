#include "server/measurement/split.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "server/base/check.h"
#include "server/measurement/pose_groups.h"

namespace trammel {

namespace {

/// Draws `count` of `size` without replacement. Own Fisher-Yates: the result of std::shuffle
/// differs between libraries.
std::vector<bool> draw(std::size_t size, std::size_t count, std::uint64_t seed) {
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

}  // namespace

std::vector<bool> drawn_of(std::size_t count, double share, std::uint64_t seed) {
  if (count == 0) return {};
  const double wanted = std::round(std::clamp(share, 0.0, 1.0) * static_cast<double>(count));
  return draw(count, std::min(static_cast<std::size_t>(wanted), count - 1), seed);
}

std::vector<bool> rows_held_out(const MeasurementBatch& batch, double share, std::uint64_t seed) {
  const auto& rows = batch.measurements;
  const bool assigned = std::any_of(rows.begin(), rows.end(), [](const Measurement& m) {
    return m.set != MeasurementSet::kUnassigned;
  });
  if (assigned) {
    std::vector<bool> validation;
    for (const Measurement& m : rows) validation.push_back(m.set == MeasurementSet::kValidation);
    return validation;
  }
  const std::vector<PoseGroup> poses = pose_groups(batch);
  const std::vector<bool> drawn = drawn_of(poses.size(), share, seed);
  std::vector<bool> held_out(rows.size());
  for (std::size_t p = 0; p < poses.size(); ++p)
    for (const Eigen::Index row : poses[p]) held_out[static_cast<std::size_t>(row)] = drawn[p];
  return held_out;
}

BatchSplit split_rows(const MeasurementBatch& batch, const std::vector<bool>& held_out) {
  TRAMMEL_CHECK(held_out.size() == batch.measurements.size());
  BatchSplit split{batch, batch};
  split.train.measurements.clear();
  split.validation.measurements.clear();
  for (std::size_t i = 0; i < batch.measurements.size(); ++i) {
    (held_out[i] ? split.validation : split.train).measurements.push_back(batch.measurements[i]);
  }
  return split;
}

BatchSplit split_batch(const MeasurementBatch& batch, double share, std::uint64_t seed) {
  return split_rows(batch, rows_held_out(batch, share, seed));
}

}  // namespace trammel
