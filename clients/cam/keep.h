#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "clients/cam/program.h"
#include "clients/cam/scan.h"

/// The way in which a reader keeps the places of what is written anew, for all dialects alike:
/// numbers in their own digits, and texts that hold numbers.
namespace trammel::cam {

/// A number as a token writes it; empty: it is none.
[[nodiscard]] std::optional<WrittenNumber> number_in(const Token& token);
/// Its value; 0: it is none.
[[nodiscard]] double value_in(const Token& token);
/// The values of the numbers among tokens.
[[nodiscard]] std::vector<double> values_in(const Tokens& tokens);

[[nodiscard]] NumberStyle with_decimals(int decimals);

/// Number `value` of a target is written anew where it stands, in the style that it has there.
void keep(Span place, std::size_t value, const NumberStyle& style, ProgramTarget& target);
/// The number of a token likewise: it becomes the target's next one. False: the token is none.
[[nodiscard]] bool keep(const Token& token, ProgramTarget& target);
/// The first `count` of them. Returns why not; empty: it did.
[[nodiscard]] std::string keep(const std::vector<Token>& numbers, std::size_t count,
                               ProgramTarget& target);

/// A text that takes the place of an expression, with numbers of a target in it.
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
  /// So many, from `first` on, with a text between.
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

/// The bytes from the begin of a statement's line up to `at`; empty where something else than
/// blanks stands before the statement.
[[nodiscard]] std::string from_line_begin(const std::string& text, std::size_t statement,
                                          std::size_t at);

/// Above the line of `at` a comment keeps what stood there. `begin`: of the dialect's comments.
void keep_original(const std::string& text, std::size_t at, const std::string& begin,
                   std::string original, ProgramTarget& target);

/// Notes what is left, and why. Where a motion goes to it, that is number `move` of the program.
void leave(Program& program, LeftAlone left, std::optional<std::size_t> move = {});
/// A position that no motion goes to.
void leave_unused(Program& program, const std::string& name, std::size_t file, int line,
                  const std::string& in = "these files");

/// A tool or frame that the controller's own lists tell.
struct ListedValue {
  Pose X = Pose::Identity();       ///< a tool from the flange, a frame as the controller has it
  std::optional<StatedLoad> load;  ///< of a tool
  std::string file;
  int line = 0;
  std::string why_not = {};  ///< why its value is not known; empty: it is
};

/// Those of all lists, by name, and which of them programs use.
class ListedValues {
 public:
  /// One that two lists have otherwise is not known.
  void add(const std::string& name, ListedValue value);
  /// For a target; nullptr: no list has it.
  [[nodiscard]] const ListedValue* take(const std::string& name);
  [[nodiscard]] const std::map<std::string, ListedValue>& all() const { return all_; }
  /// A sentence a list, of what was taken from it.
  [[nodiscard]] std::vector<std::string> notes() const;

 private:
  std::map<std::string, ListedValue> all_;
  std::map<std::string, std::set<std::string>> taken_;  ///< names, by the file
};

}  // namespace trammel::cam
