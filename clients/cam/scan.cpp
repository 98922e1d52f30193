#include "clients/cam/scan.h"

#include <algorithm>

#include "server/base/letters.h"

namespace trammel::cam {

namespace {

class Scanner {
 public:
  Scanner(std::string_view text, std::size_t begin, std::size_t end, int line, const Lexis& lexis)
      : text_(text.substr(0, end)), at_(begin), line_(line), comment_(end), lexis_(lexis) {}

  void read(Tokens& tokens) {
    std::size_t last_end = 0;
    bool is_value = false;  // of the token before
    while (skip_blanks()) {
      const Token token = next(is_value && last_end == at_);
      last_end = token.end;
      is_value = token.kind != TokenKind::kSign || token.is(")") || token.is("]");
      tokens.add(token);
    }
    tokens.set_end(at_, line_);
  }
  /// The start of the last comment.
  [[nodiscard]] std::size_t comment() const { return comment_; }

 private:
  [[nodiscard]] char peek(std::size_t ahead) const {
    return at_ + ahead < text_.size() ? text_[at_ + ahead] : '\0';
  }
  [[nodiscard]] bool is_letter(char c) const {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' ||
           (c == '$' && lexis_.dollar_is_letter) || static_cast<unsigned char>(c) >= 0x80;
  }

  /// True if there is anything left.
  bool skip_blanks() {
    for (; at_ < text_.size(); ++at_) {
      const char c = text_[at_];
      if (!lexis_.comment.empty() && text_.substr(at_).starts_with(lexis_.comment)) {
        comment_ = at_;
        at_ = std::min(text_.find('\n', at_), text_.size());
        if (at_ == text_.size()) return false;
      } else if (c != ' ' && c != '\t' && c != '\r' && c != '\n' && c != '\f' && c != '\0') {
        return true;
      }
      if (text_[at_] == '\n') ++line_;
    }
    return false;
  }

  Token next(bool after_value) {
    Token token{TokenKind::kSign, at_, at_ + 1, line_, {}};
    const char c = text_[at_];
    const bool has_sign = lexis_.numbers_have_signs && (c == '-' || c == '+') && !after_value;
    const std::size_t first = has_sign ? 1 : 0;
    if (is_digit(peek(first)) || (peek(first) == '.' && is_digit(peek(first + 1)))) {
      token.kind = TokenKind::kNumber;
      token.end = number_end(at_ + first);
    } else if (is_letter(c)) {
      token.kind = TokenKind::kWord;
      while (token.end < text_.size() &&
             (is_letter(text_[token.end]) || is_digit(text_[token.end])))
        ++token.end;
    } else if (lexis_.quotes.find(c) != std::string_view::npos) {
      token.kind = TokenKind::kText;
      token.end = quoted_end(at_, c);
    } else if (!lexis_.long_sign.empty() && text_.substr(at_).starts_with(lexis_.long_sign)) {
      token.end = at_ + lexis_.long_sign.size();
    }
    token.text = text_.substr(at_, token.end - at_);
    at_ = token.end;
    return token;
  }

  [[nodiscard]] std::size_t number_end(std::size_t at) const {
    const auto digit = [&](std::size_t i) { return i < text_.size() && is_digit(text_[i]); };
    const auto is = [&](std::size_t i, char a, char b) {
      return i < text_.size() && (text_[i] == a || text_[i] == b);
    };
    while (digit(at)) ++at;
    if (is(at, '.', '.')) ++at;
    while (digit(at)) ++at;
    if (!is(at, 'e', 'E')) return at;
    const std::size_t exponent = at + (is(at + 1, '+', '-') ? 2 : 1);
    if (!digit(exponent)) return at;
    for (at = exponent; digit(at);) ++at;
    return at;
  }

  [[nodiscard]] std::size_t quoted_end(std::size_t at, char quote) const {
    for (++at; at < text_.size() && text_[at] != '\n'; ++at) {
      if (text_[at] != quote) continue;
      const bool goes_on = lexis_.doubled_quotes && at + 1 < text_.size() && text_[at + 1] == quote;
      if (!goes_on) return at + 1;
      ++at;
    }
    return at;
  }

  std::string_view text_;
  std::size_t at_;
  int line_;
  std::size_t comment_;
  Lexis lexis_;
};

}  // namespace

std::size_t Tokens::find(std::string_view wanted, std::size_t from) const {
  std::size_t at = from;
  while (at < size() && !(*this)[at].is(wanted)) ++at;
  return std::min(at, size());
}

Tokens Tokens::part(std::size_t first, std::size_t last) const {
  Tokens made(text_);
  for (std::size_t at = first; at < std::min(last, size()); ++at) made.add((*this)[at]);
  made.set_end(end_, end_line_);
  return made;
}

void Tokens::add(const Token& token) {
  marks_.push_back({token.kind, static_cast<std::uint32_t>(token.begin),
                    static_cast<std::uint32_t>(token.end), token.line});
}

Tokens tokens_of(std::string_view text, std::size_t begin, std::size_t end, int line,
                 const Lexis& lexis) {
  Tokens tokens(text);
  Scanner(text, begin, end, line, lexis).read(tokens);
  return tokens;
}

Tokens tokens_of(std::string_view text, const Lexis& lexis) {
  return tokens_of(text, first_byte(text), text.size(), 1, lexis);
}

std::vector<TextLine> text_lines(std::string_view text) {
  std::vector<TextLine> lines;
  std::size_t begin = first_byte(text);
  for (int number = 1; begin < text.size(); ++number) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    lines.push_back({begin, end, number, text.substr(begin, end - begin)});
    begin = end + 1;
  }
  return lines;
}

std::vector<TokenLine> token_lines(std::string_view text, const Lexis& lexis) {
  std::vector<TokenLine> lines;
  for (const TextLine& line : text_lines(text)) {
    TokenLine& made =
        lines.emplace_back(TokenLine{line.begin, line.end, line.number, Tokens(text), line.end});
    Scanner scanner(text, line.begin, line.end, line.number, lexis);
    scanner.read(made.tokens);
    made.comment = scanner.comment();
  }
  return lines;
}

std::size_t first_byte(std::string_view text) { return text.starts_with("\xEF\xBB\xBF") ? 3 : 0; }

}  // namespace trammel::cam
