#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

/// The scanner that splits the bytes of a program into words, numbers, texts and signs, each with
/// its place. One scanner serves all dialects; a Lexis has their differences.
namespace trammel::cam {

enum class TokenKind : unsigned char { kWord, kNumber, kText, kSign, kEnd };

/// A word, a number, a text in quotes, or a sign.
struct Token {
  TokenKind kind = TokenKind::kEnd;
  std::size_t begin = 0, end = 0;  ///< bytes
  int line = 1;
  std::string_view text;

  [[nodiscard]] bool is(std::string_view wanted) const { return text == wanted; }
  [[nodiscard]] bool is_word() const { return kind == TokenKind::kWord; }
  [[nodiscard]] bool is_number() const { return kind == TokenKind::kNumber; }
  [[nodiscard]] bool is_text() const { return kind == TokenKind::kText; }
  /// The sign, and not a text that looks like it.
  [[nodiscard]] bool is_sign(std::string_view sign) const {
    return kind == TokenKind::kSign && text == sign;
  }
};

/// The meaning of a dialect's bytes.
struct Lexis {
  std::string_view comment;  ///< begins one that ends with its line; empty: there are none
  std::string_view
      quotes;  ///< each of them encloses a text, which ends with its line at the latest
  bool doubled_quotes = false;     ///< two quotes in a text stand for one
  bool numbers_have_signs = true;  ///< if no value precedes the sign
  bool dollar_is_letter = true;
  std::string_view long_sign = {};  ///< a sign of two bytes; empty: there is none
};

/// The tokens of a text in their order. The text outlives them. Every place before the first token
/// and behind the last holds an empty token.
class Tokens {
 public:
  Tokens() = default;
  explicit Tokens(std::string_view text) : text_(text) {}

  [[nodiscard]] Token operator[](std::size_t number) const {
    if (number >= marks_.size()) return {TokenKind::kEnd, end_, end_, end_line_, {}};
    const Mark& mark = marks_[number];
    return {mark.kind, mark.begin, mark.end, mark.line,
            text_.substr(mark.begin, mark.end - mark.begin)};
  }
  [[nodiscard]] std::size_t size() const { return marks_.size(); }
  [[nodiscard]] bool empty() const { return marks_.empty(); }
  [[nodiscard]] Token back() const { return (*this)[size() - 1]; }
  /// The number of the first that is `wanted`, from one on; size(): there is none.
  [[nodiscard]] std::size_t find(std::string_view wanted, std::size_t from = 0) const;
  [[nodiscard]] bool has(std::string_view wanted) const { return find(wanted) < size(); }
  /// The tokens from `first` up to `last`.
  [[nodiscard]] Tokens part(std::size_t first, std::size_t last) const;

  void add(const Token& token);
  void reserve(std::size_t count) { marks_.reserve(count); }
  /// Sets the end of the scanned text.
  void set_end(std::size_t at, int line) {
    end_ = at;
    end_line_ = line;
  }

  class Iterator {
   public:
    Iterator(const Tokens& tokens, std::size_t at) : tokens_(&tokens), at_(at) {}
    Token operator*() const { return (*tokens_)[at_]; }
    Iterator& operator++() {
      ++at_;
      return *this;
    }
    bool operator!=(const Iterator& other) const { return at_ != other.at_; }

   private:
    const Tokens* tokens_;
    std::size_t at_;
  };
  [[nodiscard]] Iterator begin() const { return {*this, 0}; }
  [[nodiscard]] Iterator end() const { return {*this, size()}; }

 private:
  /// A long program has millions.
  struct Mark {
    TokenKind kind = TokenKind::kEnd;
    std::uint32_t begin = 0, end = 0;
    int line = 1;
  };
  std::string_view text_;
  std::vector<Mark> marks_;
  std::size_t end_ = 0;
  int end_line_ = 1;
};

/// The tokens of text[begin, end). `line`: of `begin`.
[[nodiscard]] Tokens tokens_of(std::string_view text, std::size_t begin, std::size_t end, int line,
                               const Lexis& lexis);
/// The tokens of a whole file.
[[nodiscard]] Tokens tokens_of(std::string_view text, const Lexis& lexis);

/// A line of a file, without its line end.
struct TextLine {
  std::size_t begin = 0, end = 0;
  int number = 1;
  std::string_view text;
};
[[nodiscard]] std::vector<TextLine> text_lines(std::string_view text);

/// A line of a dialect that ends its statements so.
struct TokenLine {
  std::size_t begin = 0, end = 0;
  int number = 1;
  Tokens tokens;            ///< without the comment
  std::size_t comment = 0;  ///< the start of the comment; `end`: there is none
};
[[nodiscard]] std::vector<TokenLine> token_lines(std::string_view text, const Lexis& lexis);

/// The first byte of a file behind its byte order mark.
[[nodiscard]] std::size_t first_byte(std::string_view text);

}  // namespace trammel::cam
