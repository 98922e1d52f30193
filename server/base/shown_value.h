#pragma once

#include <string>

namespace trammel {

/// A value and its expanded uncertainty, both rounded to two digits of the latter.
struct ShownValue {
  std::string value, expanded;
};
[[nodiscard]] ShownValue show_with_uncertainty(double value, double expanded);

/// The unit in which people read a number that is computed in `unit`: angles in degrees.
struct Reading {
  double scale = 1;  ///< times the number
  std::string unit;
};
[[nodiscard]] Reading reading_of(const std::string& unit);

/// Both in `reading`'s unit, to two digits of the uncertainty; lengths and angles without powers of
/// ten.
[[nodiscard]] ShownValue show_read(double value, double expanded, const Reading& reading);

}  // namespace trammel
