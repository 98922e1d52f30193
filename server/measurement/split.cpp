#include "server/measurement/split.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "server/base/check.h"

namespace trammel {

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

}  // namespace

std::vector<bool> rows_held_out(const MeasurementBatch& batch, double share, std::uint64_t seed) {
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
