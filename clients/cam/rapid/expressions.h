#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "clients/cam/rapid/syntax.h"
#include "clients/cam/scan.h"
#include "server/base/letters.h"

namespace trammel::cam::rapid {

constexpr Lexis kLexis = {"!", "\"", true, false, false, ":="};

/// Goes through the tokens of a module, and reads the expressions among them.
class Expressions {
 protected:
  explicit Expressions(std::string_view text) : text_(text), tokens_(tokens_of(text, kLexis)) {}

  [[nodiscard]] Token token(std::size_t ahead = 0) const { return tokens_[at_ + ahead]; }
  [[nodiscard]] bool at_end() const { return at_ >= tokens_.size(); }
  [[nodiscard]] std::string_view bytes(std::size_t ahead = 0) const { return token(ahead).text; }
  [[nodiscard]] bool is_sign(std::string_view sign, std::size_t ahead = 0) const {
    return token(ahead).is_sign(sign);
  }
  [[nodiscard]] std::string word(std::size_t ahead = 0) const {
    return token(ahead).is_word() ? lower(bytes(ahead)) : std::string();
  }
  bool take(std::string_view sign) {
    if (!is_sign(sign)) return false;
    ++at_;
    return true;
  }
  std::string take_word() {
    std::string text = word();
    if (!text.empty()) ++at_;
    return text;
  }
  [[nodiscard]] std::uint32_t at_byte() const { return static_cast<std::uint32_t>(token().begin); }
  [[nodiscard]] std::uint32_t last_end() const {
    return at_ == 0 ? 0 : static_cast<std::uint32_t>(tokens_[at_ - 1].end);
  }
  /// True for a word that begins or ends a statement wherever it is, so that an unfinished
  /// statement ends there.
  [[nodiscard]] bool is_reserved() const;
  [[nodiscard]] bool at_statement_end() const { return at_end() || is_sign(";") || is_reserved(); }
  static bool is_operator(const std::string& text);

  Expression expression(int depth = 0);
  Expression primary(int depth);

  std::string_view text_;
  Tokens tokens_;
  std::size_t at_ = 0;

 private:
  Expression term(int depth);
  Expression binary(Expression left, Expression (Expressions::*operand)(int), int depth);
  Expression factor(int depth);
  Expression unknown();
  void aggregate(Expression& made, int depth);
  bool plain_number(Expression& made);
  void name(Expression& made, int depth);
  void call(Expression& made, int depth);
  void skip_to_closing(std::string_view opening, std::string_view closing);
  void suffixes(Expression& made, int depth);
};

}  // namespace trammel::cam::rapid
