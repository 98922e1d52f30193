#include "clients/cam/edits.h"

#include <algorithm>

#include "server/base/check.h"

namespace trammel::cam {

std::string line_end_of(const std::string& text) {
  const std::size_t end = text.find('\n');
  return end != std::string::npos && end > 0 && text[end - 1] == '\r' ? "\r\n" : "\n";
}

Edits::Applied Edits::apply(const std::string& text) && {
  std::vector<Replacement> replacements = std::move(replacements_);
  std::vector<Line> lines = std::move(lines_);
  for (Line& line : lines) line.at = line_begin(text, line.at);  // a last line may have no end
  const auto by_place = [](const Replacement& a, const Replacement& b) {
    return a.span.begin < b.span.begin;
  };
  if (!std::is_sorted(replacements.begin(), replacements.end(), by_place))
    std::stable_sort(replacements.begin(), replacements.end(), by_place);
  std::stable_sort(lines.begin(), lines.end(),
                   [](const auto& a, const auto& b) { return a.at < b.at; });
  const std::string end = line_end_of(text);
  Applied made;
  made.text.reserve(text.size() + text.size() / 8);
  std::size_t at = 0;
  int number = 1;
  const auto copy_to = [&](std::size_t to) {
    TRAMMEL_CHECK(to >= at && to <= text.size());
    number += static_cast<int>(std::count(text.begin() + static_cast<std::ptrdiff_t>(at),
                                          text.begin() + static_cast<std::ptrdiff_t>(to), '\n'));
    made.text.append(text, at, to - at);
    at = to;
  };
  std::size_t line = 0;
  const auto insert_up_to = [&](std::size_t to) {
    for (; line < lines.size() && lines[line].at <= to; ++line) {
      copy_to(lines[line].at);
      made.inserted.push_back({number++, lines[line].text});
      made.text += lines[line].text + end;
    }
  };
  for (const Replacement& replacement : replacements) {
    insert_up_to(replacement.span.begin);
    copy_to(replacement.span.begin);
    made.text += replacement.text;
    number += static_cast<int>(std::count(replacement.text.begin(), replacement.text.end(), '\n'));
    at = replacement.span.end;
  }
  insert_up_to(text.size());
  copy_to(text.size());
  return made;
}

}  // namespace trammel::cam
