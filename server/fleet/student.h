#pragma once

namespace trammel {

/// The probability that a value of Student's t with `freedom` degrees of freedom is farther from
/// 0 than `t`.
[[nodiscard]] double two_sided(double t, double freedom);

}  // namespace trammel
