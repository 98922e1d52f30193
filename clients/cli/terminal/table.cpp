#include "clients/cli/terminal/table.h"

#include <algorithm>
#include <sstream>

#include "clients/cli/terminal/command_tree.h"

namespace trammel::cli {

namespace {

constexpr std::size_t kWidth = 100, kLeastForTheLast = 24;

std::string filled(const std::string& text, std::size_t width, bool is_right) {
  const std::size_t taken = columns_of(text);
  const std::string blanks(width > taken ? width - taken : 0, ' ');
  return is_right ? blanks + text : text + blanks;
}

/// The text in lines of at most `width`, those after the first indented.
std::string in_lines(const std::string& text, std::size_t indent, std::size_t width) {
  std::istringstream lines(wrapped(text, 0, std::max(width, kLeastForTheLast)));
  std::string all;
  for (std::string line; std::getline(lines, line);)
    all += (all.empty() ? "" : "\n" + std::string(indent, ' ')) + line;
  return all;
}

}  // namespace

std::string table_text(const std::vector<TableColumn>& columns,
                       const std::vector<std::vector<std::string>>& rows, TableForm form) {
  std::vector<std::size_t> shown, widths;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    if (columns[k].is_wide && form != TableForm::kWide) continue;
    std::size_t width = columns_of(columns[k].name);
    for (const auto& row : rows) width = std::max(width, columns_of(row[k]));
    shown.push_back(k);
    widths.push_back(width);
  }
  const auto line = [&](const auto& cell_of) {
    std::string text;
    for (std::size_t i = 0; i < shown.size(); ++i) {
      const std::string cell = cell_of(shown[i]);
      const bool is_last = i + 1 == shown.size();
      if (!is_last) text += filled(cell, widths[i], columns[shown[i]].is_right) + "  ";
      if (is_last && form == TableForm::kWide) text += cell;
      if (is_last && form == TableForm::kTable)
        text += in_lines(cell, columns_of(text), kWidth - std::min(kWidth, columns_of(text)));
    }
    text.erase(text.find_last_not_of(' ') + 1);
    return text + "\n";
  };
  std::string text = line([&](std::size_t k) { return columns[k].name; });
  for (const auto& row : rows) text += line([&](std::size_t k) { return row[k]; });
  return text;
}

}  // namespace trammel::cli
