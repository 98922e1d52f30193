#include "clients/cam/rapid/expressions.h"

#include <algorithm>
#include <set>

#include "clients/cam/number_text.h"

namespace trammel::cam::rapid {

namespace {

constexpr int kDeepest = 60;  // brackets within brackets

using Kind = Expression::Kind;

}  // namespace

bool Expressions::is_reserved() const {
  static const std::set<std::string> kReserved = {
      "module", "endmodule", "proc",  "endproc",  "func", "endfunc", "trap",  "endtrap", "record",
      "local",  "task",      "const", "pers",     "var",  "if",      "endif", "elseif",  "else",
      "for",    "endfor",    "while", "endwhile", "test", "endtest", "case",  "default"};
  return token().is_word() && kReserved.contains(word());
}

bool Expressions::is_operator(const std::string& text) {
  return text == "and" || text == "or" || text == "not" || text == "xor" || text == "div" ||
         text == "mod";
}

Expression Expressions::expression(int depth) {
  if (depth > kDeepest) return unknown();
  Expression left = term(depth);
  while (is_sign("+") || is_sign("-")) left = binary(std::move(left), &Expressions::term, depth);
  // Comparisons and logic decide nothing here.
  if (is_sign("<") || is_sign(">") || is_sign("=") || is_operator(word())) return unknown();
  return left;
}

Expression Expressions::primary(int depth) {
  if (depth > kDeepest) return unknown();
  Expression made = unknown();
  if (token().is_number()) {
    const auto number = read_number(bytes());
    made.kind = number ? Kind::kNumber : Kind::kUnknown;
    made.value = number ? number->value : 0;
    ++at_;
  } else if (token().is_text()) {
    made.kind = Kind::kText;
    made.name = std::string(bytes());
    ++at_;
  } else if (is_sign("[")) {
    aggregate(made, depth);
  } else if (take("(")) {
    made.sign = '+';
    made.parts.push_back(expression(depth + 1));
    if (take(")") && made.parts[0].kind != Kind::kUnknown) made.kind = Kind::kUnary;
  } else if (token().is_word()) {
    name(made, depth);
  }
  made.end = std::max(last_end(), made.begin);
  return made;
}

Expression Expressions::term(int depth) {
  Expression left = factor(depth);
  while (is_sign("*") || is_sign("/")) left = binary(std::move(left), &Expressions::factor, depth);
  return left;
}

Expression Expressions::binary(Expression left, Expression (Expressions::*operand)(int),
                               int depth) {
  Expression both;
  both.kind = Kind::kBinary;
  both.begin = left.begin;
  both.line = left.line;
  both.sign = bytes()[0];
  ++at_;
  both.parts.push_back(std::move(left));
  both.parts.push_back((this->*operand)(depth));
  both.end = last_end();
  if (both.parts[1].kind == Kind::kUnknown) both.kind = Kind::kUnknown;
  return both;
}

Expression Expressions::factor(int depth) {
  if (depth > kDeepest) return unknown();
  if (!is_sign("-") && !is_sign("+")) return primary(depth);
  Expression signed_one;
  signed_one.begin = at_byte();
  signed_one.line = token().line;
  signed_one.sign = bytes()[0];
  ++at_;
  Expression inner = factor(depth + 1);
  signed_one.end = inner.end;
  if (inner.kind == Kind::kNumber &&
      read_number(text_.substr(signed_one.begin, inner.end - signed_one.begin))) {
    inner.value = signed_one.sign == '-' ? -inner.value : inner.value;
    inner.begin = signed_one.begin;
    return inner;
  }
  signed_one.kind = inner.kind == Kind::kUnknown ? Kind::kUnknown : Kind::kUnary;
  signed_one.parts.push_back(std::move(inner));
  return signed_one;
}

Expression Expressions::unknown() {
  Expression none;
  none.begin = none.end = at_byte();
  none.line = token().line;
  return none;
}

void Expressions::aggregate(Expression& made, int depth) {
  ++at_;
  made.kind = Kind::kAggregate;
  while (!at_end() && !is_sign("]") && !is_sign(";")) {
    if (plain_number(made)) continue;
    made.parts.push_back(expression(depth + 1));
    if (made.parts.back().kind == Kind::kUnknown) {
      made.kind = Kind::kUnknown;
      skip_to_closing("[", "]");
      break;
    }
    if (!take(",") && !is_sign("]")) break;
  }
  if (!take("]")) made.kind = Kind::kUnknown;
  made.parts.shrink_to_fit();  // a long program is mostly this
}

/// `-1.5,` or `1.5]` as the next part: most of a long program.
bool Expressions::plain_number(Expression& made) {
  const std::size_t sign = is_sign("-") || is_sign("+") ? 1 : 0;
  if (!token(sign).is_number() || (!is_sign(",", sign + 1) && !is_sign("]", sign + 1)))
    return false;
  const auto number = read_number(text_.substr(token().begin, token(sign).end - token().begin));
  if (!number) return false;
  if (made.parts.empty()) made.parts.reserve(4);
  Expression& part = made.parts.emplace_back();
  part.kind = Kind::kNumber;
  part.begin = at_byte();
  part.end = static_cast<std::uint32_t>(token(sign).end);
  part.line = token().line;
  part.value = number->value;
  at_ += sign + 1;
  take(",");
  return true;
}

void Expressions::name(Expression& made, int depth) {
  made.name = take_word();
  made.kind = made.name == "true" || made.name == "false" ? Kind::kTruth : Kind::kName;
  if (take("(")) call(made, depth);
  suffixes(made, depth);
}

/// The arguments of a function, `\Rx:=30` among them.
void Expressions::call(Expression& made, int depth) {
  made.kind = Kind::kCall;
  while (!at_end() && !is_sign(")") && !is_sign(";")) {
    if (take(",")) continue;
    const bool labelled = take("\\");
    const std::string label = labelled ? take_word() : "";
    const bool is_switch = labelled && !take(":=");
    made.parts.push_back(is_switch ? unknown() : expression(depth + 1));
    made.parts.back().label = label;
    if (is_switch || made.parts.back().kind != Kind::kUnknown) continue;
    // An argument that is not understood does not change the places of the others.
    while (!at_end() && !is_sign(",") && !is_sign("\\") && !is_sign(")") && !is_sign(";")) {
      const std::size_t before = at_;
      if (take("(")) skip_to_closing("(", ")");
      if (at_ == before || is_sign(")")) ++at_;
    }
  }
  if (!take(")")) made.kind = Kind::kUnknown;
}

/// Moves to the sign that closes the open one; to the end of the statement at the latest.
void Expressions::skip_to_closing(std::string_view opening, std::string_view closing) {
  for (int open = 0; !at_statement_end(); ++at_) {
    if (is_sign(opening)) ++open;
    if (is_sign(closing) && open-- == 0) return;
  }
}

/// `.trans.x`, `{3}`, `{i,j}`.
void Expressions::suffixes(Expression& made, int depth) {
  for (int count = 0; count < kDeepest; ++count) {
    made.end = last_end();
    Expression outer;
    outer.begin = made.begin;
    outer.line = made.line;
    if (is_sign(".") && token(1).is_word()) {
      ++at_;
      outer.kind = Kind::kField;
      outer.name = take_word();
      outer.parts.push_back(std::move(made));
    } else if (is_sign("{")) {
      ++at_;
      outer.kind = Kind::kElement;
      outer.parts.push_back(std::move(made));
      while (!at_end() && !is_sign("}") && !is_sign(";")) {
        outer.parts.push_back(expression(depth + 1));
        // An index that is not understood counts as decided by the program.
        while (!at_end() && !is_sign(",") && !is_sign("}") && !is_sign(";")) ++at_;
        take(",");
      }
      if (!take("}")) outer.kind = Kind::kUnknown;
    } else {
      return;
    }
    outer.end = last_end();
    if (outer.parts[0].kind == Kind::kUnknown) outer.kind = Kind::kUnknown;
    made = std::move(outer);
  }
}

}  // namespace trammel::cam::rapid
