#pragma once

#include <optional>
#include <string>
#include <string_view>

/// Numbers as programs write them: `-.384`, `+1800.`, `9E+09`.
namespace trammel::cam {

/// The style of a number, for writing another value in the same style.
struct NumberStyle {
  int decimals = 0;            ///< digits behind the point (of the mantissa)
  bool plus = false;           ///< positive numbers carry a sign
  bool bare_point = false;     ///< no zero before the point: `.5`
  bool ends_in_point = false;  ///< `5.`
  char exponent = 0;           ///< `e` or `E`; 0: none
  bool exponent_plus = false;  ///< `E+02`
  int exponent_digits = 0;     ///< at least
};

/// The style and value of a number; empty when the text is no finite decimal number.
struct WrittenNumber {
  double value = 0;
  NumberStyle style = {};
};
[[nodiscard]] std::optional<WrittenNumber> read_number(std::string_view text);

/// Half a unit of the last digit that `style` writes of `value`.
[[nodiscard]] double rounding_of(double value, const NumberStyle& style);
/// `style` with enough additional decimals that rounding_of() is at most `largest`. It has ten
/// decimals at most.
[[nodiscard]] NumberStyle with_rounding(double value, NumberStyle style, double largest);
[[nodiscard]] std::string number_text(double value, const NumberStyle& style);

}  // namespace trammel::cam
