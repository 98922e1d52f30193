#pragma once

#include <Eigen/Dense>
#include <vector>

#include "server/calibrate/identify/weighting.h"
#include "server/calibrate/maps/linear_arm.h"

namespace trammel {

/// Neighbouring columns of a linear arm: the parameters of one source.
struct ColumnGroup {
  Eigen::Index first = 0;
  Eigen::Index count = 0;
};

/// The evidence that groups of parameters add to a batch, one group after the other, linearised at
/// the present values of a model (README.md). Each parameter has a normal prior about its present
/// value, with standard deviation 1 in units of its scale. The noise is estimated from the
/// residuals with the free groups fitted, and is at least the stated sigmas.
class CauseEvidence {
 public:
  /// `blocks`: the rows of the batch, a part each. `present`: the groups that are free to begin
  /// with.
  CauseEvidence(const CalibrationProblem& problem, const Weights& weights,
                const std::vector<std::vector<std::size_t>>& blocks,
                const std::vector<ColumnGroup>& present);

  struct Gain {
    double nat = 0;      ///< the rise of the log evidence when this group is free, too
    double freedom = 0;  ///< the number of its parameters that the batch determines
  };
  /// Beside the groups that are free.
  [[nodiscard]] Gain gain_of(const ColumnGroup& group) const;
  /// Frees the group.
  void take(const ColumnGroup& group);
  /// Squares of the residuals of positions, in units of their sigmas. The other blocks with the
  /// free groups predict each block. One number per block; their sum is the mean square of an axis.
  [[nodiscard]] Eigen::VectorXd left_out() const { return left_out_with(free_); }
  /// left_out() with `group` free, too.
  [[nodiscard]] Eigen::VectorXd left_out(const ColumnGroup& group) const;

 private:
  void add_free(const ColumnGroup& group);
  [[nodiscard]] Eigen::VectorXd left_out_with(const std::vector<Eigen::Index>& free) const;
  /// Learns the noise beside the groups that are free, and integrates these out.
  void free_anew();
  void learn_precision();
  void weigh_all();

  std::vector<LinearArm> blocks_;
  LinearArm all_;
  Eigen::Vector2d precision_ = Eigen::Vector2d::Ones();  // of each kind: times 1/sigma²
  Eigen::Vector2d most_precision_ = Eigen::Vector2d::Ones();
  std::vector<Eigen::Index> free_;
  // Curvature and slope of all columns, with the free ones integrated out.
  Eigen::MatrixXd curvature_;
  Eigen::VectorXd downhill_;
};

}  // namespace trammel
