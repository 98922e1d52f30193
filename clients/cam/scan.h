#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace trammel::cam {

/// A piece of a text: a word, a number with its sign, a text in quotes, or one other byte.
struct Piece {
  enum class Kind { kWord, kNumber, kText, kSign };
  Kind kind = Kind::kSign;
  std::size_t begin = 0, end = 0;
  int line = 1;
  std::string_view text;

  [[nodiscard]] bool is(std::string_view wanted) const { return text == wanted; }
};

struct ScanOptions {
  std::string_view comment;  ///< begins a comment that ends with its line; empty: there are none
  std::string_view quotes;   ///< each of them encloses texts
};

/// The pieces of text[begin, end). A sign belongs to a number where no value stands before it.
/// `line`: of `begin`.
[[nodiscard]] std::vector<Piece> pieces_of(std::string_view text, std::size_t begin,
                                           std::size_t end, int line, const ScanOptions& options);

}  // namespace trammel::cam
