#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "clients/cam/scan.h"

/// The lines of a KRL file, as far as targets need them. KRL ends a statement with its line.
namespace trammel::cam::krl {

struct Line {
  std::size_t begin = 0;  ///< first byte
  int number = 1;
  Tokens tokens;             ///< without the comment, in capitals
  std::string_view comment;  ///< behind `;`, as it stands there

  [[nodiscard]] std::string_view word() const { return tokens[0].text; }
};

/// `capitals`: the text in capitals. Both outlive the lines.
[[nodiscard]] std::vector<Line> lines_of(std::string_view text, std::string_view capitals);

/// The text of a value: `{X 1,Y 2}`, `XP1[3]`, a number, or something else.
struct Value {
  enum class Kind { kNumber, kBits, kAggregate, kName, kOther };
  Kind kind = Kind::kOther;
  std::size_t begin = 0, end = 0;
  double number = 0;
  std::string name;  ///< in upper case, with its index: `XP[3]`; an index that is no number is `*`
  std::vector<std::string> field_names;  ///< of an aggregate
  std::vector<Value> field_values;       ///< as field_names

  [[nodiscard]] const Value* field(std::string_view name) const;
};

/// The operands of `a:b:c` from a token on; `next` is set behind them. Empty where it is no such
/// expression.
[[nodiscard]] std::vector<Value> operands_at(const Tokens& tokens, std::size_t at,
                                             std::size_t* next = nullptr);

}  // namespace trammel::cam::krl
