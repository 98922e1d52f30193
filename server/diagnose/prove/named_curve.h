#pragma once

#include <Eigen/Dense>
#include <optional>

namespace trammel::cause_search {

/// The strengths of the added effects. Each is √2 times the previous one.
inline constexpr Eigen::Index kStrengthsPutIn = 16;
[[nodiscard]] double strength_put_in(Eigen::Index place);

/// The share of the effects of a cause that are named, by their strength. It follows
///   most / (1 + exp(-(log λ - middle) / width)).
/// The middle, width and most have a posterior over a grid, given the counts. Every middle and
/// width is equally likely beforehand. The prior odds that no size is named in kProvedShare of the
/// cases (most below it) are even. Predictions do not enter. A binomial count at each strength
/// alone would need many more diagnoses.
class NamedCurve {
 public:
  NamedCurve();

  void count(double strength, bool named);

  /// The strength that is named with kProvedShare: the median and the 95 % interval. Empty if it is
  /// beyond all tried strengths. `never`: the probability of that.
  struct Smallest {
    std::optional<double> median, from, to;
    double never = 0;
  };
  [[nodiscard]] Smallest smallest() const;

  /// The place of the strength to try next. It draws a curve from the posterior (Thompson
  /// sampling), and takes the strength nearest to the point where this curve reaches `share`.
  /// `drawn`: uniform in [0, 1).
  [[nodiscard]] Eigen::Index next(double share, double drawn) const;

 private:
  [[nodiscard]] Eigen::VectorXd posterior() const;

  Eigen::VectorXd log_weight_;  // of each curve of the grid
};

}  // namespace trammel::cause_search
