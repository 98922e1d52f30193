#pragma once

#include <string>
#include <vector>

#include "server/measurement/measurement.h"

/// Columns that Trammel does not know are kept, so a misspelled optional one would be passed over
/// without a word.
namespace trammel::cli {

enum class TableKind { kBatch, kTargets, kJoints };

/// A sentence for each column that is nearly one that such a table may have and has not:
/// `b.csv: column temprature_c is not known and is left aside; temperature_c was meant?`.
[[nodiscard]] std::vector<std::string> near_columns(const std::vector<std::string>& columns,
                                                    TableKind kind, const std::string& where);
/// Tells them for the header of a table's text, on standard error; the columns that it told of.
std::vector<std::string> tell_near_columns(const std::string& text, TableKind kind,
                                           const std::string& where);
/// Tells of a batch that was read from the text also the columns of numbers that nothing is learned
/// from (unread_columns()), each column once.
void tell_columns_left_aside(const MeasurementBatch& batch, const std::string& text,
                             const std::string& where);

}  // namespace trammel::cli
