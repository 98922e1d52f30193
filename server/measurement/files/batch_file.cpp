#include "server/measurement/files/batch_file.h"

#include <algorithm>

#include "server/base/text_file.h"
#include "server/measurement/files/csv_dialect.h"
#include "server/measurement/files/point_list.h"
#include "server/measurement/files/text_lines.h"

namespace trammel {

namespace {

bool any_of(const std::vector<std::string>& fields, bool (*holds)(const std::string&)) {
  return std::any_of(fields.begin(), fields.end(), holds);
}

bool is_ours(const std::string& field) {
  const ColumnName column = column_name(field);
  return (column.name == "x" && column.unit == "mm" && field.find('_') != std::string::npos) ||
         (column.name == "q1" && field.find('_') != std::string::npos);
}

bool is_first_joint(const std::string& field) {
  return joint_number(column_name(field).name).value_or(2) <= 1;
}

bool is_text(const std::string& field) { return !field.empty() && !is_number(field); }

}  // namespace

BatchKind recognise_batch(const std::string& text) {
  const std::vector<TextLine> lines = first_lines(text, 2);
  const auto is_long = [](const TextLine& line) { return line.text.size() > kLongestLine; };
  if (lines.empty() || std::any_of(lines.begin(), lines.end(), is_long)) return BatchKind::kTrammel;
  const char separator = separator_of(lines[0].text);
  const std::vector<std::string> first = split_fields(lines[0].text, separator);
  if (any_of(first, is_first_joint)) {
    return any_of(first, is_ours) ? BatchKind::kTrammel : BatchKind::kRoboDk;
  }
  const bool names_above =
      lines.size() > 1 && std::all_of(first.begin(), first.end(), is_text) && separator != ' ';
  if (names_above) {
    const std::vector<std::string> second = split_fields(lines[1].text, separator);
    const bool numbers = std::all_of(second.begin(), second.end(), [&](const std::string& field) {
      return is_number(separator == ',' ? field : with_decimal_point(field));
    });
    if (numbers && second.size() == first.size() && (first.size() == 12 || first.size() == 18)) {
      return BatchKind::kRoboDk;
    }
  }
  return parse_points(text, "").has_value() ? BatchKind::kPoints : BatchKind::kTrammel;
}

Result<MeasurementBatch> parse_batch(const std::string& text, const std::string& where) {
  switch (recognise_batch(text)) {
    case BatchKind::kRoboDk:
      return parse_robodk_csv(text, where);
    case BatchKind::kPoints:
      return refused("measured points without the joints that were commanded")
          .in(where)
          .of("q1_deg")
          .next(
              "join them with the plan by pose_id first: trammel convert --points POINTS --joints "
              "PLAN -o BATCH");
    case BatchKind::kTrammel:
      break;
  }
  return parse_batch_csv(text, where);
}

Result<MeasurementBatch> read_batch(const std::string& path) {
  return read_text_file(path)
      .and_then([&](const std::string& text) { return parse_batch(text, path); })
      .map([&](MeasurementBatch batch) { return dated(std::move(batch), written_at(path)); });
}

}  // namespace trammel
