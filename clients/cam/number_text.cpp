#include "clients/cam/number_text.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "server/base/check.h"
#include "server/base/letters.h"

namespace trammel::cam {

namespace {

constexpr int kMostDecimals = 10;

std::size_t digits_at(std::string_view text, std::size_t from) {
  std::size_t at = from;
  while (at < text.size() && is_digit(text[at])) ++at;
  return at - from;
}

/// Decimal exponent of the first digit.
int magnitude_of(double value) {
  return value == 0 ? 0 : static_cast<int>(std::floor(std::log10(std::abs(value))));
}

bool is_zero(std::string_view text) {
  return text.find_first_of("123456789") == std::string_view::npos;
}

/// `1.25`, always with a digit before the point.
std::string fixed_text(double value, const NumberStyle& style) {
  std::string text = fmt::format("{:.{}f}", value, style.decimals);
  if (text.front() == '-' && is_zero(text)) text.erase(0, 1);
  return text;
}

std::string exponent_text(double value, const NumberStyle& style) {
  std::string text = fmt::format("{:.{}e}", value, style.decimals);
  const std::size_t e = text.find('e');
  const int exponent = std::stoi(text.substr(e + 1));
  text.erase(e);
  if (text.front() == '-' && is_zero(text)) text.erase(0, 1);
  const char* sign = exponent < 0 ? "-" : style.exponent_plus ? "+" : "";
  return fmt::format("{}{}{}{:0{}d}", text, style.exponent, sign, std::abs(exponent),
                     style.exponent_digits);
}

}  // namespace

std::optional<WrittenNumber> read_number(std::string_view text) {
  WrittenNumber number;
  NumberStyle& style = number.style;
  std::size_t at = 0;
  if (at < text.size() && (text[at] == '+' || text[at] == '-')) style.plus = text[at++] == '+';
  const std::size_t before = digits_at(text, at);
  at += before;
  std::size_t behind = 0;
  if (at < text.size() && text[at] == '.') {
    behind = digits_at(text, ++at);
    at += behind;
    style.ends_in_point = behind == 0;
  }
  if (before + behind == 0) return std::nullopt;
  style.bare_point = before == 0;
  style.decimals = static_cast<int>(behind);
  if (at < text.size() && (text[at] == 'e' || text[at] == 'E')) {
    style.exponent = text[at++];
    if (at < text.size() && (text[at] == '+' || text[at] == '-'))
      style.exponent_plus = text[at++] == '+';
    style.exponent_digits = static_cast<int>(digits_at(text, at));
    if (style.exponent_digits == 0) return std::nullopt;
    at += static_cast<std::size_t>(style.exponent_digits);
  }
  if (at != text.size()) return std::nullopt;
  const char* begin = text.data() + (text.front() == '+' ? 1 : 0);
  const auto [end, error] = std::from_chars(begin, text.data() + text.size(), number.value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(number.value))
    return std::nullopt;
  return number;
}

double rounding_of(double value, const NumberStyle& style) {
  const int magnitude = style.exponent == 0 ? 0 : magnitude_of(value);
  return 0.5 * std::pow(10.0, magnitude - style.decimals);
}

NumberStyle with_rounding(double value, NumberStyle style, double largest) {
  while (style.decimals < kMostDecimals && rounding_of(value, style) > largest) {
    ++style.decimals;
    style.ends_in_point = false;
  }
  return style;
}

std::string number_text(double value, const NumberStyle& style) {
  TRAMMEL_CHECK(std::isfinite(value));
  std::string text = style.exponent == 0 ? fixed_text(value, style) : exponent_text(value, style);
  const std::size_t digits = text.front() == '-' ? 1 : 0;
  if (style.ends_in_point && style.decimals == 0) {
    text.insert(digits + digits_at(text, digits), ".");
  }
  if (style.bare_point && text[digits] == '0' && text.size() > digits + 1 &&
      text[digits + 1] == '.') {
    text.erase(digits, 1);
  }
  if (style.plus && digits == 0) text.insert(0, "+");
  return text;
}

}  // namespace trammel::cam
