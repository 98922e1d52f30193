#pragma once

#include "server/diagnose/tell/answers.h"

/// Rows that themselves show a mistake. An outlier is tested as another tool or payload, and with
/// the joints of another row. Play is tested for poses that came from the other side than marked,
/// and times are tested for rising order.
namespace trammel::cause_search {

/// States for each suspect the tool, payload or row that it would fit. Lists poses marked with the
/// wrong side, and rows whose time does not rise, as suspects. Summarises all this in `limits`.
/// Play of a wrongly marked joint is not a certain finding. `unsorted`: all rows in the order of
/// the file if that is not the order of their times; else empty. Call it after findings and
/// suspects are set.
void tell_row_mistakes(const Explained& explained, const MeasurementBatch& unsorted,
                       Diagnosis& diagnosis);

/// Places of the rows, ascending, without which the known times never fall: as few as possible.
[[nodiscard]] std::vector<std::size_t> rows_against_time(const MeasurementBatch& batch);

}  // namespace trammel::cause_search
