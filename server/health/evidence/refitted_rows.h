#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "server/health/evidence/check_rows.h"

namespace trammel::health {

/// Share of a column: with less left, the column is absorbed by the refit up to rounding.
inline constexpr double kLeastLeft = 1e-3;

/// The largest credible numbers of a cause, in units of their prior scales (standard deviations):
/// 20 mm and 50 mrad for links and tools, 0.1 rad for a zero, 2 mrad for an error that depends on
/// the angle.
inline constexpr double kWidest = 10, kWidestZero = 50, kWidestFunction = 1;

/// Numbers fitted to residuals; undetermined ones keep their prior uncertainty.
struct Estimate {
  Eigen::VectorXd numbers;
  Eigen::MatrixXd covariance;
};
/// `own`: R x k, `left`: R, both whitened and refitted. `widest`: in units of the numbers.
[[nodiscard]] Estimate estimate(const Eigen::MatrixXd& own, const Eigen::VectorXd& left,
                                double widest);

/// Something that may explain the residuals: columns of R rows.
struct Hypothesis {
  std::size_t cause = 0;         ///< index in CauseEffects::causes()
  int pose = -1;                 ///< a single bad pose; -1: the cause
  Eigen::MatrixXd columns = {};  ///< R x k
};
/// A hypothesis for every cause that has a signal.
[[nodiscard]] std::vector<Hypothesis> cause_hypotheses(const CauseEffects& effects,
                                                       const CheckRows& rows,
                                                       const std::vector<CauseSignal>& signals);
/// For every pose.
[[nodiscard]] std::vector<Hypothesis> pose_hypotheses(const CheckRows& rows);

/// Residuals and effects after whitening, and after removing the refitted parameters.
class RefittedRows {
 public:
  /// `nuisance`: R x f, refitted columns: base, tool, bad poses, earlier findings.
  RefittedRows(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& nuisance);

  [[nodiscard]] Eigen::Index size() const { return nuisance_.rows(); }
  [[nodiscard]] int freedom() const {
    return static_cast<int>(nuisance_.rows() - nuisance_.cols());
  }
  /// R x k of R x k.
  [[nodiscard]] Eigen::MatrixXd left(const Eigen::MatrixXd& columns) const;
  /// left() of a vector that is whitened already.
  [[nodiscard]] Eigen::VectorXd refitted(const Eigen::VectorXd& whitened) const {
    return whitened - nuisance_ * (nuisance_.transpose() * whitened);
  }
  /// R x r, orthonormal: the directions that columns have outside the nuisance columns.
  [[nodiscard]] Eigen::MatrixXd directions(const Eigen::MatrixXd& columns) const;
  /// R x r, in their own units: columns with the same span as those.
  [[nodiscard]] Eigen::MatrixXd kept(const Eigen::MatrixXd& columns) const {
    return unwhitened(directions(columns));
  }
  /// R x k: residuals, or columns, as a generalised least-squares fit of the nuisance leaves them,
  /// in their own units.
  [[nodiscard]] Eigen::MatrixXd unwhitened(const Eigen::MatrixXd& left) const;
  /// R x R: their covariance.
  [[nodiscard]] Eigen::MatrixXd unwhitened_covariance() const;

 private:
  [[nodiscard]] Eigen::MatrixXd whitened(const Eigen::MatrixXd& columns) const;

  Eigen::LLT<Eigen::MatrixXd> factor_;
  Eigen::MatrixXd nuisance_;  // R x f, orthonormal
};

}  // namespace trammel::health
