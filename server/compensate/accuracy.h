#pragma once

#include <optional>
#include <vector>

#include "server/compensate/compensated_model.h"

/// The distance between the tool's true position and the model's prediction, at a pose of its
/// domain that was not measured.
///
/// The true error t of such a pose is normal with the stated covariance S(q) of the model, without
/// the tracker's noise. The statement may be wrong by a factor f: t ~ N(0, f² S(q)), ln f ~ N(0,
/// kDoubt²). Poses held out from training determine f through e = t + noise, noise ~ N(0, g²
/// sigma²). The factor g, ln g ~ N(0, kNoiseDoubt²), is there because nobody knows a tracker's
/// sigma better. Where t is far below the noise, these poses say little, and the model is believed.
/// `at(share)` is the radius that contains this share of fresh poses, averaged over poses, f and g:
/// a beta-expectation tolerance limit (Guttman, Statistical Tolerance Regions, 1970). It is right
/// in `share` of fresh poses over many models, however few poses judged each. It cannot see a
/// lasting error that an overstated sigma of the tracker hides (hidden()).
namespace trammel {

/// The square error of a pose that was not trained on, m² per axis.
struct JudgingCoordinate {
  double squared_error = 0;     ///< measured - predicted
  double stated_variance = 0;   ///< of the true error
  double tracker_variance = 0;  ///< of its measurement
};

class PositionAccuracy {
 public:
  static constexpr double kDoubt = 0.2;       ///< of the stated standard deviations, relative
  static constexpr double kNoiseDoubt = 0.1;  ///< of the tracker's sigma, relative
  /// The stated radius contains this share of positions.
  static constexpr double kShare = 0.95;

  /// Estimates from the poses that the model held out and from `batch`: more poses, not trained on,
  /// with positions, checked against the cell. Empty if the model knows no position, because it was
  /// trained without any or because this cell can request no pose of its domain.
  [[nodiscard]] static std::optional<PositionAccuracy> of(
      const CompensatedModel& model, const std::optional<MeasurementBatch>& batch = {});

  /// m: `share` of fresh poses in the domain are within this radius. No radius is below the arm's
  /// smallest step.
  [[nodiscard]] double at(double share) const;
  /// Share of fresh poses in the domain whose true error is within `radius`, m; 0 below that step.
  [[nodiscard]] double within(double radius) const;
  /// m: at(kShare) for the smallest and the largest likely error of the stated covariances (95 %
  /// between the two).
  [[nodiscard]] double least() const;
  [[nodiscard]] double most() const;
  /// m: 95 % of distances between two positions are correct within this. It is an upper bound: it
  /// treats the errors of the two as independent, although those of near positions are similar.
  [[nodiscard]] double of_distances() const;
  /// m per axis: the lasting error that would not show, because the tracker's sigma may be
  /// overstated by kNoiseDoubt.
  [[nodiscard]] double hidden() const { return hidden_; }
  /// Poses that were not trained on and judged this; 0: the training's own statistics alone.
  [[nodiscard]] int judged_by() const { return judged_by_; }

 private:
  /// A factor on the stated standard deviations, and how likely it is.
  struct Factor {
    double factor = 1, weight = 0;
  };
  void draw(const std::vector<ErrorPrediction>& poses, double tracker_sigma);
  void weigh(const std::vector<JudgingCoordinate>& coordinates, double count_as);
  [[nodiscard]] double factor_at(double share) const;
  std::vector<double> errors_;     // m, rising: |t| of draws at poses of the domain, as stated
  std::vector<double> distances_;  // m, rising: likewise, of distances between two
  std::vector<Factor> factors_;
  double smallest_step_ = 0;  // m, of the arm: the smallest radius that may be stated
  double hidden_ = 0;
  int judged_by_ = 0;
};

/// Joint vectors within the range of the training poses and near a measured one, drawn evenly, with
/// the tools and payloads of the training in turn. Empty if the cell has none of these any more. It
/// has fewer than `count` if few drawn vectors are near.
[[nodiscard]] std::vector<PoseContext> poses_in_range(const CompensatedModel& model, int count);
/// Those poses_in_range() that the model counts as in its domain.
[[nodiscard]] std::vector<PoseContext> poses_of_domain(const CompensatedModel& model, int count);

}  // namespace trammel
