#include "clients/cam/keep.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace trammel::cam {

std::optional<WrittenNumber> number_in(const Token& token) { return read_number(token.text); }

double value_in(const Token& token) { return number_in(token).value_or(WrittenNumber{}).value; }

std::vector<double> values_in(const Tokens& tokens) {
  std::vector<double> values;
  for (const Token token : tokens) {
    if (token.is_number()) values.push_back(value_in(token));
  }
  return values;
}

NumberStyle with_decimals(int decimals) {
  NumberStyle style;
  style.decimals = decimals;
  return style;
}

void keep(Span place, std::size_t value, const NumberStyle& style, ProgramTarget& target) {
  target.rewrites.push_back({place, {}, {{value, style}}});
}

bool keep(const Token& token, ProgramTarget& target) {
  const auto written = number_in(token);
  if (!written) return false;
  keep({token.begin, token.end}, target.numbers.size(), written->style, target);
  target.numbers.push_back(written->value);
  return true;
}

std::string keep(const std::vector<Token>& numbers, std::size_t count, ProgramTarget& target) {
  for (std::size_t k = 0; k < count; ++k) {
    if (!keep(numbers[k], target)) return "it holds what is no number";
  }
  return "";
}

NewText& NewText::numbers(std::size_t first, std::size_t count, int decimals,
                          const std::string& between) {
  for (std::size_t k = 0; k < count; ++k) {
    if (k > 0) text(between);
    number(first + k, decimals);
  }
  return *this;
}

std::string from_line_begin(const std::string& text, std::size_t statement, std::size_t at) {
  const std::size_t begin = line_begin(text, statement);
  const bool alone = text.find_first_not_of(" \t", begin) == statement;
  return alone && at >= begin ? text.substr(begin, at - begin) : "";
}

void keep_original(const std::string& text, std::size_t at, const std::string& begin,
                   std::string original, ProgramTarget& target) {
  for (char& c : original) {
    if (c == '\n' || c == '\r') c = ' ';
  }
  target.comment_at = line_begin(text, at);
  const std::size_t indent = text.find_first_not_of(" \t", target.comment_at);
  target.comment = text.substr(target.comment_at, indent - target.comment_at) + begin +
                   " trammel: was " + original;
}

void leave(Program& program, LeftAlone left, std::optional<std::size_t> move) {
  if (move) program.moves[*move].left_some = true;
  program.left.push_back(std::move(left));
}

void leave_unused(Program& program, const std::string& name, std::size_t file, int line,
                  const std::string& in) {
  leave(program, {name, file, line, "", fmt::format("no motion in {} goes to it", in)});
}

void ListedValues::add(const std::string& name, ListedValue value) {
  const auto [known, is_new] = all_.try_emplace(name, value);
  ListedValue& first = known->second;
  if (!is_new && first.why_not.empty() && !same_place(first.X, value.X))
    first.why_not =
        fmt::format("{} has two values: {} ({} line {}), {} ({} line {})", name, pose_text(first.X),
                    first.file, first.line, pose_text(value.X), value.file, value.line);
}

const ListedValue* ListedValues::take(const std::string& name) {
  const auto known = all_.find(name);
  if (known == all_.end()) return nullptr;
  if (known->second.why_not.empty()) taken_[known->second.file].insert(name);
  return &known->second;
}

std::vector<std::string> ListedValues::notes() const {
  std::vector<std::string> notes;
  for (const auto& [file, names] : taken_)
    notes.push_back(fmt::format("{}: taken from {}", fmt::join(names, ", "), file));
  return notes;
}

}  // namespace trammel::cam
