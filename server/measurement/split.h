#pragma once

#include <cstdint>
#include <vector>

#include "server/measurement/measurement.h"

namespace trammel {

/// Rows for training and rows for validation. Order, indices and source text stay.
struct BatchSplit {
  MeasurementBatch train;
  MeasurementBatch validation;
};

/// One flag per row, true if it is held out. Uses the `set` column if the batch has one, else draws `share` of the rows
/// with `seed` (at least one row stays for training). Reproducible: same rows, seed and share, same flags.
[[nodiscard]] std::vector<bool> rows_held_out(const MeasurementBatch& batch, double share, std::uint64_t seed);

/// Splits the batch by `held_out`, one flag per row.
[[nodiscard]] BatchSplit split_rows(const MeasurementBatch& batch, const std::vector<bool>& held_out);

/// split_rows() by rows_held_out().
[[nodiscard]] BatchSplit split_batch(const MeasurementBatch& batch, double share, std::uint64_t seed);

}  // namespace trammel
