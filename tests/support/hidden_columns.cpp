#include "tests/support/hidden_columns.h"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

namespace trammel::hidden {

namespace {

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> fields;
  std::istringstream in(line);
  for (std::string field; std::getline(in, field, ',');) fields.push_back(field);
  return fields;
}

std::string joined(const std::vector<std::string>& fields) {
  std::string line;
  for (std::size_t k = 0; k < fields.size(); ++k) line += (k == 0 ? "" : ",") + fields[k];
  return line + "\n";
}

}  // namespace

std::string without_columns(const std::string& csv, const std::vector<std::string>& beginnings) {
  std::istringstream lines(csv);
  std::string line, text;
  std::getline(lines, line);
  const std::vector<std::string> head = split(line);
  std::vector<bool> kept;
  for (const std::string& name : head) {
    kept.push_back(
        std::none_of(beginnings.begin(), beginnings.end(),
                     [&](const std::string& beginning) { return name.starts_with(beginning); }));
  }
  lines.seekg(0);
  while (std::getline(lines, line)) {
    const std::vector<std::string> fields = split(line);
    std::vector<std::string> left;
    for (std::size_t k = 0; k < fields.size(); ++k) {
      if (kept.at(k)) left.push_back(fields[k]);
    }
    text += joined(left);
  }
  return text;
}

std::string with_added(const std::string& csv, const std::string& column, int row, double change) {
  std::istringstream lines(csv);
  std::string line, text;
  std::getline(lines, line);
  text = line + "\n";
  const std::vector<std::string> head = split(line);
  const auto place =
      static_cast<std::size_t>(std::find(head.begin(), head.end(), column) - head.begin());
  for (int at = 0; std::getline(lines, line); ++at) {
    std::vector<std::string> fields = split(line);
    if (at == row) fields.at(place) = fmt::format("{:.10g}", std::stod(fields.at(place)) + change);
    text += joined(fields);
  }
  return text;
}

}  // namespace trammel::hidden
