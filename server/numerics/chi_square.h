#pragma once

/// Tails of the chi-square distribution of a whole number of degrees of freedom, central or not.
namespace trammel {

/// Chance of more than `x`.
[[nodiscard]] double chi_square_tail(double x, int freedom);
/// Chance of more than `x` where the mean is shifted: `noncentrality` is the squared length of the
/// shift.
[[nodiscard]] double chi_square_tail(double x, int freedom, double noncentrality);
/// The x that is exceeded with this chance; the chance is in (0, 1).
[[nodiscard]] double chi_square_limit(double chance, int freedom);

}  // namespace trammel
