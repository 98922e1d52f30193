#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "clients/cam/program.h"
#include "clients/cam/scan.h"

/// The way in which readers of all dialects record the places of values to rewrite: numbers in
/// their own digits, and texts that contain numbers.
namespace trammel::cam {

/// The number in a token, in its written form; empty if the token is no number.
[[nodiscard]] std::optional<WrittenNumber> number_in(const Token& token);
/// The value of the token; 0 if it is no number.
[[nodiscard]] double value_in(const Token& token);
/// The values of the numbers among tokens.
[[nodiscard]] std::vector<double> values_in(const Tokens& tokens);

[[nodiscard]] NumberStyle with_decimals(int decimals);

/// Records that number `value` of a target is rewritten in its place, in the style that it has
/// there.
void keep(Span place, std::size_t value, const NumberStyle& style, ProgramTarget& target);
/// Records the number of a token likewise, as the target's next number. False if it has none.
[[nodiscard]] bool keep(const Token& token, ProgramTarget& target);
/// Records the first `count` numbers. Returns the reason if that fails; else empty.
[[nodiscard]] std::string keep(const std::vector<Token>& numbers, std::size_t count,
                               ProgramTarget& target);

/// A text that replaces an expression and contains numbers of a target.
class NewText {
 public:
  NewText(Span place, std::string begin) : whole_{place, {std::move(begin)}, {}} {}
  NewText& text(const std::string& more) {
    whole_.texts.back() += more;
    return *this;
  }
  NewText& number(std::size_t value, int decimals) {
    whole_.slots.push_back({value, with_decimals(decimals)});
    whole_.texts.emplace_back();
    return *this;
  }
  /// Adds `count` numbers from `first` on, with a text between them.
  NewText& numbers(std::size_t first, std::size_t count, int decimals, const std::string& between);
  /// A line above the one of `at`.
  [[nodiscard]] NewLine line(std::size_t at) && {
    return {at, std::move(whole_.texts), std::move(whole_.slots)};
  }
  /// The target is no longer computed by the program.
  void fold(ProgramTarget& target) && {
    target.folded = true;
    target.rewrites.push_back(std::move(whole_));
  }

 private:
  Rewrite whole_;
};

/// The bytes from the beginning of a statement's line up to `at`. Empty if anything but blanks
/// precedes the statement.
[[nodiscard]] std::string from_line_begin(const std::string& text, std::size_t statement,
                                          std::size_t at);

/// Above the line of `at` a comment keeps what stood there. `begin`: of the dialect's comments.
void keep_original(const std::string& text, std::size_t at, const std::string& begin,
                   std::string original, ProgramTarget& target);

/// Records an item that is left alone, and the reason. `move`: the number of the program's motion
/// that goes to it.
void leave(Program& program, LeftAlone left, std::optional<std::size_t> move = {});
/// A position that no motion goes to.
void leave_unused(Program& program, const std::string& name, std::size_t file, int line,
                  const std::string& in = "these files");

/// A tool or frame from the controller's own lists.
struct ListedValue {
  Pose X = Pose::Identity();       ///< a tool from the flange, a frame as the controller has it
  std::optional<StatedLoad> load;  ///< of a tool
  std::string file;
  int line = 0;
  std::string why_not = {};  ///< why its value is not known; empty: it is
};

/// The values of all lists, by name, with a record of those that programs use.
class ListedValues {
 public:
  /// Adds a value; if two lists differ, the value becomes unknown.
  void add(const std::string& name, ListedValue value);
  /// For a target; nullptr: no list has it.
  [[nodiscard]] const ListedValue* take(const std::string& name);
  [[nodiscard]] const std::map<std::string, ListedValue>& all() const { return all_; }
  /// One sentence per list about the values taken from it.
  [[nodiscard]] std::vector<std::string> notes() const;

 private:
  std::map<std::string, ListedValue> all_;
  std::map<std::string, std::set<std::string>> taken_;  ///< names, by the file
};

}  // namespace trammel::cam
