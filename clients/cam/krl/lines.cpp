#include "clients/cam/krl/lines.h"

#include <algorithm>
#include <cstdlib>

#include "clients/cam/keep.h"

namespace trammel::cam::krl {

namespace {

constexpr int kDeepestBrackets = 8;  // brackets within brackets

constexpr Lexis kLexis = {";", "\"'", false, false};

/// `'B0110'`
bool is_bits(const Token& token) { return token.is_text() && token.text[0] == '\''; }

double bits_of(const std::string& text) {
  if (text.size() < 4) return 0;
  const int base = text[1] == 'B' ? 2 : text[1] == 'H' ? 16 : 10;
  return static_cast<double>(std::strtol(text.c_str() + 2, nullptr, base));
}

class LineReader {
 public:
  LineReader(const Tokens& tokens, std::size_t at) : tokens_(tokens), at_(at) {}

  [[nodiscard]] Token token() const { return tokens_[at_]; }
  [[nodiscard]] bool is(std::string_view sign) const { return token().is_sign(sign); }
  [[nodiscard]] bool at_end() const { return at_ >= tokens_.size(); }
  [[nodiscard]] std::size_t at() const { return at_; }
  bool take(std::string_view sign) {
    if (!is(sign)) return false;
    ++at_;
    return true;
  }

  Value value(int depth = 0) {
    Value made;
    if (at_end() || depth > kDeepestBrackets) return made;
    made.begin = token().begin;
    const bool has_sign = (is("-") || is("+")) && tokens_[at_ + 1].is_number();
    if (has_sign || token().is_number()) {
      number(made, has_sign);
    } else if (is_bits(token())) {
      made.kind = Value::Kind::kBits;
      made.number = bits_of(std::string(tokens_[at_++].text));
    } else if (token().is_word()) {
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
  void number(Value& made, bool has_sign) {
    const double sign = has_sign && is("-") ? -1 : 1;
    if (has_sign) ++at_;
    const auto number = number_in(token());
    // A blank behind the sign makes it an expression.
    const bool together = token().begin == made.begin + (has_sign ? 1 : 0);
    made.kind = number && together ? Value::Kind::kNumber : Value::Kind::kOther;
    made.number = number ? sign * number->value : 0;
    ++at_;
  }

  void name(Value& made) {
    made.kind = Value::Kind::kName;
    made.name = tokens_[at_++].text;
    while (is("[") || is(".")) {
      if (take(".")) {
        if (!token().is_word()) break;
        made.name += '.';
        made.name += tokens_[at_++].text;
        continue;
      }
      ++at_;
      const bool constant = token().is_number() && tokens_[at_ + 1].is("]");
      made.name += constant ? "[" + std::string(token().text) + "]" : is("]") ? "[]" : "[*]";
      skip_index();
    }
    if (is("(")) made.kind = Value::Kind::kOther;
  }
  void skip_index() {
    while (!at_end() && !is("]")) ++at_;
    take("]");
  }

  void aggregate(Value& made, int depth) {
    ++at_;
    made.kind = Value::Kind::kAggregate;
    // `{E6POS: X 1,...}` says its type.
    if (token().is_word() && tokens_[at_ + 1].is(":")) at_ += 2;
    while (!at_end() && !is("}")) {
      if (take(",")) continue;
      if (!token().is_word()) {
        made.kind = Value::Kind::kOther;
        ++at_;
        continue;
      }
      std::string field(tokens_[at_++].text);
      if (is("[")) {
        skip_index();
        field += "[]";
      }
      Value inner = value(depth + 1);
      // Anything but one value up to the comma is an expression.
      if (!at_end() && !is(",") && !is("}")) {
        inner.kind = Value::Kind::kOther;
        while (!at_end() && !is(",") && !is("}")) ++at_;
      }
      made.field_names.push_back(std::move(field));
      made.field_values.push_back(std::move(inner));
    }
    if (!take("}")) made.kind = Value::Kind::kOther;
  }

  const Tokens& tokens_;
  std::size_t at_;
};

}  // namespace

const Value* Value::field(std::string_view wanted) const {
  const auto found = std::find(field_names.begin(), field_names.end(), wanted);
  return found == field_names.end()
             ? nullptr
             : &field_values[static_cast<std::size_t>(found - field_names.begin())];
}

std::vector<Line> lines_of(std::string_view text, std::string_view capitals) {
  std::vector<Line> lines;
  for (TokenLine& line : token_lines(capitals, kLexis)) {
    const std::size_t comment = std::min(line.comment + 1, line.end);
    lines.push_back({line.begin, line.number, std::move(line.tokens),
                     text.substr(comment, line.end - comment)});
  }
  return lines;
}

std::vector<Value> operands_at(const Tokens& tokens, std::size_t at, std::size_t* next) {
  std::vector<Value> operands;
  LineReader reader(tokens, at);
  do {
    if (reader.at_end()) {
      operands.clear();
      break;
    }
    operands.push_back(reader.value());
    if (operands.back().kind == Value::Kind::kOther) break;
  } while (reader.take(":"));
  if (next != nullptr) *next = reader.at();
  return operands;
}

}  // namespace trammel::cam::krl
