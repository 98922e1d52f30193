#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "server/calibrate/calibrate.h"

namespace trammel::cause_search {

/// A candidate's effect on the poses: one column a parameter, in units of its prior.
struct Effect {
  std::string source;                 ///< in the spelling of a cell file
  std::vector<Parameter> parameters;  ///< one a column
  Eigen::MatrixXd columns;            ///< R x m, whitened
};

/// The standard deviation by which a row's residual is weighted.
enum class Weighed {
  kByWhatIsLeft,  ///< the stated noise, and the surplus of the residual
  kAsStated
};

/// A batch seen from a calibrated model, to first order. A pose has 3 rows, or 6 with its
/// orientation; every row is divided by the standard deviation of its noise, so that white noise
/// has unit variance.
class LinearProblem {
 public:
  /// The noise is that of the measurement plus a robust estimate of the surplus in the residual,
  /// whatever its cause: as long as something large is unexplained, no small effect is claimed.
  /// `further` names additional sources with a wanted effect. Sources that the cell or the model
  /// cannot have are left out. `batch` outlives the problem.
  LinearProblem(const PhysicalModel& model, const MeasurementBatch& batch,
                const std::vector<Parameter>& priors, const std::vector<std::string>& further,
                Weighed weighed = Weighed::kByWhatIsLeft);

  [[nodiscard]] Eigen::Index poses() const {
    return static_cast<Eigen::Index>(batch_->measurements.size());
  }
  [[nodiscard]] Eigen::Index rows() const { return residual_.size(); }
  [[nodiscard]] Eigen::Index first_row(Eigen::Index pose) const {
    return first_row_[static_cast<std::size_t>(pose)];
  }
  [[nodiscard]] Eigen::Index row_count(Eigen::Index pose) const {
    return first_row(pose + 1) - first_row(pose);
  }

  [[nodiscard]] const PhysicalModel& model() const { return model_; }
  [[nodiscard]] const MeasurementBatch& batch() const { return *batch_; }
  /// n: the gear angles at that pose (Chain::gear_angles), on which causes of joints act.
  [[nodiscard]] JointVector gear_angles(Eigen::Index pose) const {
    return model_.cell->robot.gear_angles(
        batch_->measurements[static_cast<std::size_t>(pose)].context.q);
  }
  /// R: measured - model, whitened.
  [[nodiscard]] const Eigen::VectorXd& residual() const { return residual_; }
  /// R: measured - `model`, by the same weights.
  [[nodiscard]] Eigen::VectorXd residual_of(const PhysicalModel& model) const;
  /// R x P: the whitened effects of the model's own parameters, a column per prior scale.
  [[nodiscard]] const Eigen::MatrixXd& nuisance() const { return nuisance_; }
  [[nodiscard]] const std::vector<Parameter>& nuisance_parameters() const { return priors_; }
  /// The wanted sources, in the order of `further`.
  [[nodiscard]] const std::vector<Effect>& effects() const { return effects_; }
  /// R x n: the whitened effect of one radian (metre) of each joint's gear.
  [[nodiscard]] const Eigen::MatrixXd& by_joint() const { return by_joint_; }
  /// R: 1 / standard deviation of each row, in 1/m and 1/rad. Positions at one joint vector weigh
  /// as one pose, as far as they share their residual.
  [[nodiscard]] const Eigen::VectorXd& weight() const { return weight_; }
  /// m per axis: noise of a typical position, whatever its reason. A root mean square.
  [[nodiscard]] double noise() const { return position_.noise; }
  /// m per axis: standard deviation that is stated for a measured position. A root mean square.
  [[nodiscard]] double instrument() const { return position_.stated; }
  /// The noise of positions (m per axis) and of orientations (rad per axis), with the degrees of
  /// freedom behind them.
  struct Spread {
    double noise = 0, stated = 0;
    double freedom =
        0;  ///< 0 where none were measured; positions of a pose that share an error count as fewer
  };
  /// The part of the residual (SI) that the model's own parameters leave, and the share of freedom
  /// left.
  struct Leftover {
    Eigen::VectorXd residual;
    double share = 1;
    Eigen::MatrixXd scaled,
        root;  ///< of rows in units of their sigma; scaled rootᵀ is a root of the fit's hat matrix
  };
  [[nodiscard]] const Spread& position_spread() const { return position_; }
  [[nodiscard]] const Spread& rotation_spread() const { return rotation_; }

  /// 3 x poses, m: the positions of a whitened vector.
  [[nodiscard]] Eigen::Matrix3Xd positions(const Eigen::VectorXd& whitened) const;
  /// m: rms over the poses of the position part of a whitened vector.
  [[nodiscard]] double position_rms(const Eigen::VectorXd& whitened) const;

 private:
  struct Extended;
  [[nodiscard]] Extended extended_by(const std::vector<std::string>& further);
  void differentiate(const Extended& extended);
  void measure(Eigen::Index pose, const Pose& X_WT);
  void whiten(Weighed weighed);
  Spread weigh(const std::vector<Eigen::Index>& rows, double surplus, double share);
  void weigh_together(const Leftover& left);

  PhysicalModel model_;
  const MeasurementBatch* batch_;
  std::vector<Parameter> priors_;
  std::vector<Eigen::Index> first_row_;
  Eigen::VectorXd residual_;
  Eigen::VectorXd sigma_;   // as stated, m and rad
  Eigen::VectorXd weight_;  // 1 / standard deviation including the surplus
  Eigen::MatrixXd nuisance_, by_joint_;
  std::vector<Effect> effects_;
  Spread position_, rotation_;
};

/// The prior scale of each parameter, in its own unit.
[[nodiscard]] Eigen::VectorXd scales_of(const std::vector<Parameter>& parameters);

}  // namespace trammel::cause_search
