#include "clients/cam/rapid/tokens.h"

#include <algorithm>

#include "server/base/letters.h"

namespace trammel::cam::rapid {

namespace {

bool is_letter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' ||
         static_cast<unsigned char>(c) >= 0x80;
}

class Scanner {
 public:
  explicit Scanner(std::string_view text) : text_(text) {
    if (text_.starts_with("\xEF\xBB\xBF")) at_ = 3;
  }

  Token next() {
    skip_blanks();
    Token token{TokenKind::kEnd, static_cast<std::uint32_t>(at_), static_cast<std::uint32_t>(at_),
                line_};
    if (at_ >= text_.size()) return token;
    const char c = text_[at_];
    if (is_letter(c)) {
      token.kind = TokenKind::kWord;
      while (at_ < text_.size() && (is_letter(text_[at_]) || is_digit(text_[at_]))) ++at_;
    } else if (is_digit(c) || (c == '.' && is_digit(peek(1)))) {
      token.kind = TokenKind::kNumber;
      skip_number();
    } else if (c == '"') {
      token.kind = TokenKind::kString;
      skip_string();
    } else {
      token.kind = TokenKind::kSign;
      at_ += (c == ':' && peek(1) == '=') ? 2 : 1;
    }
    token.end = static_cast<std::uint32_t>(at_);
    return token;
  }

 private:
  [[nodiscard]] char peek(std::size_t ahead) const {
    return at_ + ahead < text_.size() ? text_[at_ + ahead] : '\0';
  }

  void skip_blanks() {
    for (; at_ < text_.size(); ++at_) {
      const char c = text_[at_];
      if (c == '!') at_ = std::min(text_.find('\n', at_), text_.size() - 1);
      if (at_ < text_.size() && text_[at_] == '\n') ++line_;
      if (c != ' ' && c != '\t' && c != '\r' && c != '\n' && c != '!' && c != '\f' && c != '\0')
        return;
    }
  }

  void skip_number() {
    while (is_digit(peek(0))) ++at_;
    if (peek(0) == '.') ++at_;
    while (is_digit(peek(0))) ++at_;
    if (peek(0) != 'e' && peek(0) != 'E') return;
    const std::size_t sign = peek(1) == '+' || peek(1) == '-' ? 2 : 1;
    if (!is_digit(peek(sign))) return;
    at_ += sign;
    while (is_digit(peek(0))) ++at_;
  }

  /// Two quotes inside stand for one. A string ends with its line at the latest.
  void skip_string() {
    for (++at_; at_ < text_.size() && text_[at_] != '\n'; ++at_) {
      if (text_[at_] != '"') continue;
      ++at_;
      if (peek(0) != '"') return;
    }
  }

  std::string_view text_;
  std::size_t at_ = 0;
  int line_ = 1;
};

}  // namespace

std::vector<Token> tokens_of(std::string_view text) {
  std::vector<Token> tokens;
  tokens.reserve(text.size() / 3);
  Scanner scanner(text);
  do {
    tokens.push_back(scanner.next());
  } while (tokens.back().kind != TokenKind::kEnd);
  return tokens;
}

}  // namespace trammel::cam::rapid
