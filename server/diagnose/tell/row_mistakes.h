#pragma once

#include "server/diagnose/tell/answers.h"

/// Rows that say by themselves what was done wrong with them. A pose that fits nothing is asked
/// whether it fits as another tool or payload, or with the joints of another row. Of play it is
/// asked whether some poses came from the other side than their mark says; times whether they rise.
namespace trammel::cause_search {

/// Says of each suspect what it would fit as, lists poses marked with the wrong side and rows whose
/// time does not rise as suspects, and sums all of it up in `limits`. Play of a joint that is
/// marked wrongly is no sure finding. `unsorted`: all rows in the order of the file, where that is
/// not the order of their times; else none. Findings and suspects are told before.
void tell_row_mistakes(const Explained& explained, const MeasurementBatch& unsorted,
                       Diagnosis& diagnosis);

/// Places of the rows, ascending, without which the times that are known never fall: as few as can
/// be.
[[nodiscard]] std::vector<std::size_t> rows_against_time(const MeasurementBatch& batch);

}  // namespace trammel::cause_search
