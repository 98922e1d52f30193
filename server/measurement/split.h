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

/// Draws `share` of `count` items with `seed`, one flag for each; at least one item is not drawn.
/// Reproducible.
[[nodiscard]] std::vector<bool> drawn_of(std::size_t count, double share, std::uint64_t seed);

/// One flag per row, true if it is held out. Uses the `set` column if the batch has one. Otherwise
/// it draws `share` of the poses with `seed`; at least one stays for training. All rows at one
/// joint vector are drawn together, since a training row would vouch for the others. Reproducible:
/// same rows, seed and share give the same flags.
[[nodiscard]] std::vector<bool> rows_held_out(const MeasurementBatch& batch, double share,
                                              std::uint64_t seed);

/// Splits the batch by `held_out`, one flag per row.
[[nodiscard]] BatchSplit split_rows(const MeasurementBatch& batch,
                                    const std::vector<bool>& held_out);

/// split_rows() by rows_held_out().
[[nodiscard]] BatchSplit split_batch(const MeasurementBatch& batch, double share,
                                     std::uint64_t seed);

}  // namespace trammel
