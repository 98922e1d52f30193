#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/calibrate/calibration.h"

/// Finds the rows of a batch that agree on one arm if many rows are bad.
namespace trammel {

struct Agreement {
  MeasurementBatch agreeing;  ///< rows that fit one arm
  MeasurementBatch others;    ///< rows that do not fit this arm, at most two in five
};

/// The rows of `batch` on which `sources` should be identified; empty means all rows. `plain` was
/// identified on all rows: if it leaves no more than 3 times the stated sigma, there is no search.
/// Otherwise the search is least trimmed squares (Rousseeuw 1984) by concentration steps (Rousseeuw
/// and Van Driessen 1999). It starts from all rows, and from base and tool alone. If no fit on all
/// rows succeeds, it starts from the small random set of rows that fits the most other rows.
/// Afterwards all rows return that fit as well as the kept ones. The search calls rows bad only if
/// the misfit of the others falls to a quarter: a model that lacks a cause leaves nearly the same
/// misfit at any rows. A batch may have too few rows for all sources, as some batches of distances
/// have. Then the bad rows are the ones that base and tool alone miss by far. With several
/// sessions, each session is searched by itself with a base of its own, since a difference between
/// sessions is a change.
[[nodiscard]] std::optional<Agreement> agreement_of(const std::shared_ptr<const Cell>& cell,
                                                    const std::vector<std::string>& sources,
                                                    const MeasurementBatch& batch,
                                                    const Result<CalibrationResult>& plain);

/// Names `others` among the suspects of `found`, which was identified on the rows that agree.
void add_suspects(const MeasurementBatch& others, CalibrationResult& found);

}  // namespace trammel
