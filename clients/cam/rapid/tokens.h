#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace trammel::cam::rapid {

enum class TokenKind : unsigned char { kWord, kNumber, kString, kSign, kEnd };

/// A piece of a module. Bytes between tokens are blanks and comments.
struct Token {
  TokenKind kind = TokenKind::kEnd;
  std::uint32_t begin = 0, end = 0;
  int line = 1;
};

/// The tokens of a module, the last one kEnd. Words may hold letters of any encoding. A text that
/// is no RAPID has tokens too.
[[nodiscard]] std::vector<Token> tokens_of(std::string_view text);

}  // namespace trammel::cam::rapid
