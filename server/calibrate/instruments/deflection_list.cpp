#include "server/calibrate/instruments/deflection_list.h"

#include <map>

#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/measurement/files/csv_table.h"

namespace trammel {

namespace {

constexpr int kMostElements = 100;  // more joints than any arm has: a larger number is a mistake

/// The columns of a reading's numbers.
struct DeflectionColumns {
  std::map<std::string, std::size_t> required;
  std::optional<std::size_t> sigma, set;
};

Result<DeflectionColumns> find_columns(const CsvTable& table) {
  DeflectionColumns columns{
      .required = {}, .sigma = table.find("sigma_mm"), .set = table.find("set")};
  for (const char* name :
       {"element", "load_n", "x_mm", "dx_mm", "dz_mm", "theta_deg", "length_mm", "lever_mm"}) {
    const std::size_t column = TRY(table.require(name));
    columns.required[name] = column;
  }
  return columns;
}

/// One row, as its columns are named.
struct DeflectionRow {
  int element = 0;
  std::map<std::string, double> value;
};

Result<DeflectionRow> read_row(const CsvTable& table, std::size_t row,
                               const DeflectionColumns& columns) {
  DeflectionRow read;
  for (const auto& [name, column] : columns.required) {
    const double number = TRY(table.number(row, column));
    read.value[name] = number;
  }
  const int element = TRY(table.integer(row, columns.required.at("element"), 1, kMostElements));
  read.element = element;
  if (!(read.value["length_mm"] > 0))
    return table.refuse(row, "length_mm is {}, must be above 0", read.value["length_mm"])
        .of("length_mm")
        .beyond(read.value["length_mm"], 0);
  return read;
}

Result<std::optional<double>> read_sigma(const CsvTable& table, std::size_t row,
                                         std::optional<std::size_t> column) {
  if (!column || table.field(row, *column).empty()) return std::nullopt;
  const double number = TRY(table.number(row, *column));
  if (!(number > 0))
    return table.refuse(row, "sigma_mm is {}, must be above 0", number)
        .of("sigma_mm")
        .beyond(number, 0);
  return from_mm(number);
}

/// True if the row is for validation; empty if the file does not say.
Result<std::optional<bool>> read_set(const CsvTable& table, std::size_t row,
                                     std::optional<std::size_t> column) {
  if (!column || table.field(row, *column).empty()) return std::nullopt;
  const std::string& name = table.field(row, *column);
  if (name != "train" && name != "validation")
    return table.refuse(row, "set is '{}', expected train or validation", name)
        .of("set")
        .with_text(name);
  return name == "validation";
}

Result<DeflectionReading> read_reading(const CsvTable& table, std::size_t row,
                                       const DeflectionColumns& columns, DeflectionRow& read) {
  const std::optional<double> sigma = TRY(read_sigma(table, row, columns.sigma));
  const std::optional<bool> validation = TRY(read_set(table, row, columns.set));
  return DeflectionReading{.element = read.element,
                           .load = read.value["load_n"],
                           .x = from_mm(read.value["x_mm"]),
                           .moved = {from_mm(read.value["dx_mm"]), from_mm(read.value["dz_mm"])},
                           .sigma = sigma,
                           .validation = validation,
                           .row = table.line(row)};
}

}  // namespace

Result<DeflectionData> parse_deflection_csv(const std::string& text, const std::string& where) {
  const CsvTable table = TRY(CsvTable::parse(text, where));
  const DeflectionColumns columns = TRY(find_columns(table));
  std::map<int, DeflectionElement> elements;
  DeflectionData data{where, {}, {}};
  for (std::size_t row = 0; row < table.size(); ++row) {
    DeflectionRow read = TRY(read_row(table, row, columns));
    const DeflectionElement stands{read.element, from_deg(read.value["theta_deg"]),
                                   from_mm(read.value["length_mm"]),
                                   from_mm(read.value["lever_mm"])};
    const DeflectionElement& first = elements.emplace(read.element, stands).first->second;
    if (first.theta != stands.theta || first.length != stands.length ||
        first.lever != stands.lever) {
      return table
          .refuse(row, "element {} stands or hangs otherwise than in its first row", read.element)
          .of("element")
          .with_value(read.element);
    }
    DeflectionReading reading = TRY(read_reading(table, row, columns, read));
    data.readings.push_back(std::move(reading));
  }
  for (const auto& [number, element] : elements) data.elements.push_back(element);
  return data;
}

Result<DeflectionData> read_deflection_csv(const std::string& path) {
  return read_text_file(path).and_then(
      [&](const std::string& text) { return parse_deflection_csv(text, path); });
}

}  // namespace trammel
