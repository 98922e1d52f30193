#pragma once

#include <Eigen/Dense>
#include <optional>

namespace trammel::cause_search {

/// Strengths that are put in: each is √2 times the one before.
inline constexpr Eigen::Index kStrengthsPutIn = 16;
[[nodiscard]] double strength_put_in(Eigen::Index place);

/// The share of the effects of a cause that are named, by their strength. It follows
///   most / (1 + exp(-(log λ - middle) / width)).
/// The middle, width and most that the counts allow are a posterior over a grid, every middle and
/// width as likely beforehand; even odds that no size is named in kProvedShare of the cases (most
/// below it). What was predicted is no part of it. A binomial count at each strength alone would
/// need many more diagnoses.
class NamedCurve {
 public:
  NamedCurve();

  void count(double strength, bool named);

  /// The strength that is named with kProvedShare: the median and the 95 % interval. Empty: beyond
  /// all that are put in. `never`: the chance of that.
  struct Smallest {
    std::optional<double> median, from, to;
    double never = 0;
  };
  [[nodiscard]] Smallest smallest() const;

  /// Place of the strength to try next: a curve is drawn from the posterior (Thompson sampling), of
  /// which the strength at `share` is the nearest. `drawn`: uniform in [0, 1).
  [[nodiscard]] Eigen::Index next(double share, double drawn) const;

 private:
  [[nodiscard]] Eigen::VectorXd posterior() const;

  Eigen::VectorXd log_weight_;  // of each curve of the grid
};

}  // namespace trammel::cause_search
