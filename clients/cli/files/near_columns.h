#pragma once

#include <string>
#include <vector>

#include "server/measurement/measurement.h"

/// Columns that Trammel does not know are kept, so a misspelled optional one would be passed over
/// without a word.
namespace trammel::cli {

enum class TableKind { kBatch, kTargets, kJoints };

/// A sentence for each column whose name is similar to a missing one of such a table: `b.csv:
/// column temprature_c is not known and is left aside; temperature_c was meant?`.
[[nodiscard]] std::vector<std::string> near_columns(const std::vector<std::string>& columns,
                                                    TableKind kind, const std::string& where);
/// Reports such columns in the header of a table's text on standard error. Returns the reported
/// columns.
std::vector<std::string> tell_near_columns(const std::string& text, TableKind kind,
                                           const std::string& where);
/// For a batch that was read from the text, also reports columns of numbers that nothing learns
/// from (unread_columns()). Each column is reported once.
void tell_columns_left_aside(const MeasurementBatch& batch, const std::string& text,
                             const std::string& where);

}  // namespace trammel::cli
