#pragma once

#include <string>

namespace trammel {

/// A value and its expanded uncertainty, both rounded to two digits of the latter.
struct ShownValue {
  std::string value, expanded;
};
[[nodiscard]] ShownValue show_with_uncertainty(double value, double expanded);

}  // namespace trammel
