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

/// One flag a row, true where it is held out: by the `set` column where the batch has one, else by drawing `share` of
/// the rows with `seed` (one row at least stays for training). Reproducible: same rows, seed and share, same flags.
[[nodiscard]] std::vector<bool> rows_held_out(const MeasurementBatch& batch, double share, std::uint64_t seed);

/// `held_out`: one flag a row.
[[nodiscard]] BatchSplit split_rows(const MeasurementBatch& batch, const std::vector<bool>& held_out);

/// Both of these.
[[nodiscard]] BatchSplit split_batch(const MeasurementBatch& batch, double share, std::uint64_t seed);

}  // namespace trammel
