#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "server/base/check.h"

namespace trammel {

/// The median of `values`, which must not be empty; for an even number the upper one of the two in
/// the middle.
[[nodiscard]] inline double median(std::vector<double> values) {
  TRAMMEL_CHECK(!values.empty());
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace trammel
