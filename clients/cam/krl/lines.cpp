#include "clients/cam/krl/lines.h"

#include <algorithm>
#include <cstdlib>

#include "clients/cam/number_text.h"
#include "server/base/letters.h"

namespace trammel::cam::krl {

namespace {

constexpr int kDeepest = 8;  // brackets within brackets

bool is_letter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' || c == '$' ||
         static_cast<unsigned char>(c) >= 0x80;
}
std::size_t number_end(std::string_view text, std::size_t at) {
  const auto digit = [&](std::size_t i) { return i < text.size() && is_digit(text[i]); };
  while (digit(at)) ++at;
  if (at < text.size() && text[at] == '.') ++at;
  while (digit(at)) ++at;
  if (at < text.size() && (text[at] == 'E' || text[at] == 'e')) {
    const std::size_t sign =
        at + 1 < text.size() && (text[at + 1] == '+' || text[at + 1] == '-') ? 2 : 1;
    if (digit(at + sign)) {
      at += sign;
      while (digit(at)) ++at;
    }
  }
  return at;
}

/// The next token of a line that ends at `end`.
Token token_at(std::string_view text, std::size_t at, std::size_t end) {
  Token token{TokenKind::kSign, at, at + 1, {}};
  const char c = text[at];
  if (is_letter(c)) {
    token.kind = TokenKind::kWord;
    while (token.end < end && (is_letter(text[token.end]) || is_digit(text[token.end])))
      ++token.end;
  } else if (is_digit(c) || (c == '.' && at + 1 < end && is_digit(text[at + 1]))) {
    token.kind = TokenKind::kNumber;
    token.end = number_end(text, at);
  } else if (c == '"' || c == '\'') {
    token.kind = c == '"' ? TokenKind::kText : TokenKind::kBits;
    const std::size_t close = text.find(c, at + 1);
    token.end = close == std::string_view::npos || close >= end ? end : close + 1;
  }
  token.text = std::string(text.substr(at, token.end - at));
  if (token.kind == TokenKind::kWord) {
    for (char& letter : token.text) letter = upper(letter);
  }
  return token;
}

double bits_of(const std::string& text) {
  if (text.size() < 4) return 0;
  const int base = upper(text[1]) == 'B' ? 2 : upper(text[1]) == 'H' ? 16 : 10;
  return static_cast<double>(std::strtol(text.c_str() + 2, nullptr, base));
}

class Reader {
 public:
  Reader(const std::vector<Token>& tokens, std::size_t at) : tokens_(tokens), at_(at) {}

  [[nodiscard]] bool is(std::string_view sign) const {
    return at_ < tokens_.size() && tokens_[at_].kind == TokenKind::kSign &&
           tokens_[at_].text == sign;
  }
  [[nodiscard]] bool is(TokenKind kind) const {
    return at_ < tokens_.size() && tokens_[at_].kind == kind;
  }
  [[nodiscard]] std::size_t at() const { return at_; }
  bool take(std::string_view sign) {
    if (!is(sign)) return false;
    ++at_;
    return true;
  }

  Value value(int depth = 0) {
    Value made;
    if (at_ >= tokens_.size() || depth > kDeepest) return made;
    made.begin = tokens_[at_].begin;
    const bool is_signed = (is("-") || is("+")) && at_ + 1 < tokens_.size();
    if (is_signed && tokens_[at_ + 1].kind == TokenKind::kNumber) {
      const double sign = is("-") ? -1 : 1;
      ++at_;
      const auto number = read_number(tokens_[at_].text);
      // A blank behind the sign makes it an expression.
      const bool together = tokens_[at_].begin == made.begin + 1;
      made.kind = number && together ? Value::Kind::kNumber : Value::Kind::kOther;
      made.number = number ? sign * number->value : 0;
      ++at_;
    } else if (is(TokenKind::kNumber)) {
      const auto number = read_number(tokens_[at_].text);
      made.kind = number ? Value::Kind::kNumber : Value::Kind::kOther;
      made.number = number ? number->value : 0;
      ++at_;
    } else if (is(TokenKind::kBits)) {
      made.kind = Value::Kind::kBits;
      made.number = bits_of(tokens_[at_++].text);
    } else if (is(TokenKind::kWord)) {
      name(made);
    } else if (is("{")) {
      aggregate(made, depth);
    } else {
      ++at_;
    }
    made.end = tokens_[at_ - 1].end;
    return made;
  }

 private:
  void name(Value& made) {
    made.kind = Value::Kind::kName;
    made.name = tokens_[at_++].text;
    while (is("[") || is(".")) {
      if (take(".")) {
        if (!is(TokenKind::kWord)) break;
        made.name += "." + tokens_[at_++].text;
        continue;
      }
      ++at_;
      const bool constant =
          is(TokenKind::kNumber) && at_ + 1 < tokens_.size() && tokens_[at_ + 1].text == "]";
      made.name += constant ? "[" + tokens_[at_].text + "]" : is("]") ? "[]" : "[*]";
      while (at_ < tokens_.size() && !is("]")) ++at_;
      take("]");
    }
    if (is("(")) made.kind = Value::Kind::kOther;
  }

  void aggregate(Value& made, int depth) {
    ++at_;
    made.kind = Value::Kind::kAggregate;
    // `{E6POS: X 1,...}` says its type.
    if (is(TokenKind::kWord) && at_ + 1 < tokens_.size() && tokens_[at_ + 1].text == ":") at_ += 2;
    while (at_ < tokens_.size() && !is("}")) {
      if (take(",")) continue;
      if (!is(TokenKind::kWord)) {
        made.kind = Value::Kind::kOther;
        ++at_;
        continue;
      }
      std::string field = tokens_[at_++].text;
      if (is("[")) {
        while (at_ < tokens_.size() && !is("]")) ++at_;
        take("]");
        field += "[]";
      }
      Value inner = value(depth + 1);
      // Anything but one value up to the comma is an expression.
      if (at_ < tokens_.size() && !is(",") && !is("}")) {
        inner.kind = Value::Kind::kOther;
        while (at_ < tokens_.size() && !is(",") && !is("}")) ++at_;
      }
      made.field_names.push_back(std::move(field));
      made.field_values.push_back(std::move(inner));
    }
    if (!take("}")) made.kind = Value::Kind::kOther;
  }

  const std::vector<Token>& tokens_;
  std::size_t at_;
};

}  // namespace

const Value* Value::field(std::string_view wanted) const {
  const auto found = std::find(field_names.begin(), field_names.end(), wanted);
  return found == field_names.end()
             ? nullptr
             : &field_values[static_cast<std::size_t>(found - field_names.begin())];
}

std::vector<Line> lines_of(std::string_view text) {
  std::vector<Line> lines;
  std::size_t begin = text.starts_with("\xEF\xBB\xBF") ? 3 : 0;
  for (int number = 1; begin < text.size(); ++number) {
    const std::size_t newline = text.find('\n', begin);
    const std::size_t end = newline == std::string_view::npos ? text.size() : newline;
    Line& line = lines.emplace_back();
    line.begin = begin;
    line.number = number;
    for (std::size_t at = begin; at < end;) {
      const char c = text[at];
      if (c == ' ' || c == '\t' || c == '\r' || c == '\0' || c == '\f') {
        ++at;
        continue;
      }
      if (c == ';') {
        line.comment = text.substr(at + 1, end - at - 1);
        break;
      }
      line.tokens.push_back(token_at(text, at, end));
      at = line.tokens.back().end;
    }
    begin = end + 1;
  }
  return lines;
}

std::vector<Value> operands_at(const std::vector<Token>& tokens, std::size_t at,
                               std::size_t* next) {
  std::vector<Value> operands;
  Reader reader(tokens, at);
  do {
    if (reader.at() >= tokens.size()) {
      operands.clear();
      break;
    }
    operands.push_back(reader.value());
    if (operands.back().kind == Value::Kind::kOther) break;
  } while (reader.take(":"));
  *next = reader.at();
  return operands;
}

}  // namespace trammel::cam::krl
