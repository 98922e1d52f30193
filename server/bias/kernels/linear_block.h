#pragma once

#include <Eigen/Dense>
#include <memory>
#include <string_view>
#include <vector>

#include "server/robot/pose.h"

/// Finite-rank covariances that couple the coordinates: residual(q) contains H(q) w, w ~ N(0, diag(variances)).
namespace trammel {

/// How the tool moves when something of the arm changes; rows are position (m) and rotation vector (rad), in B.
struct BiasFeatures {
  Eigen::MatrixXd by_joint;      ///< 6 x n, per rad of deflection; zero for a joint that does not turn
  Eigen::MatrixXd by_parameter;  ///< 6 x P, per standard deviation that the parameter had before any data
};

/// One block of columns of H. A value without state: hyperparameters, natural logarithms, are passed in. Thread-safe.
class LinearBlock {
 public:
  virtual ~LinearBlock() = default;

  /// As it is spelled.
  [[nodiscard]] virtual std::string_view name() const = 0;
  /// Of the weights w, for features of that shape.
  [[nodiscard]] virtual Eigen::Index column_count(const BiasFeatures& shape) const = 0;
  [[nodiscard]] virtual Eigen::Index parameter_count(const BiasFeatures& shape) const = 0;
  /// Where a search starts, and how far from there a hyperparameter is taken to be (one standard deviation).
  [[nodiscard]] virtual Eigen::VectorXd start(const BiasFeatures& shape) const = 0;
  [[nodiscard]] virtual Eigen::VectorXd spread(const BiasFeatures& shape) const = 0;

  /// 6 x column_count, at one pose.
  virtual void columns(const JointVector& q, const BiasFeatures& features, Eigen::Ref<Eigen::MatrixXd> out) const = 0;
  /// Logarithms of the weights' prior variances, and their derivative, column_count x parameter_count.
  virtual void log_variance(const BiasFeatures& shape, const Eigen::VectorXd& parameters,
                            Eigen::Ref<Eigen::VectorXd> log_variance, Eigen::Ref<Eigen::MatrixXd> derivative) const = 0;
};

using LinearBlockPtr = std::shared_ptr<const LinearBlock>;

/// The matrix-valued kernel Σ_j J_j(q) k_j(q_j, q_j') J_j(q')ᵀ: an error of each joint's angle that depends on that
/// angle alone, k_j periodic and once differentiable (Matérn 3/2 on the circle) in a Fourier basis.
/// Hyperparameters of each joint: log amplitude, rad; log of the harmonic at which the spectrum begins to fall.
[[nodiscard]] LinearBlockPtr make_joint_map_block();
/// H = J_θ(q): what physical parameters, identified or not, leave uncertain. No hyperparameter: the weights have the
/// variance that the parameters had before any data, and what the calibration found is counted as found from the same
/// data.
[[nodiscard]] LinearBlockPtr make_parameter_block();

/// Several blocks side by side.
class LinearBlocks {
 public:
  LinearBlocks() = default;
  LinearBlocks(std::vector<LinearBlockPtr> blocks, const BiasFeatures& shape);

  [[nodiscard]] bool empty() const { return blocks_.empty(); }
  [[nodiscard]] Eigen::Index column_count() const { return columns_; }
  [[nodiscard]] Eigen::Index parameter_count() const { return parameters_; }
  [[nodiscard]] Eigen::VectorXd start() const { return of_each(&LinearBlock::start); }
  [[nodiscard]] Eigen::VectorXd spread() const { return of_each(&LinearBlock::spread); }
  [[nodiscard]] Eigen::MatrixXd columns(const JointVector& q, const BiasFeatures& features) const;
  void log_variance(const Eigen::VectorXd& parameters, Eigen::VectorXd* log_variance,
                    Eigen::MatrixXd* derivative) const;

 private:
  Eigen::VectorXd of_each(Eigen::VectorXd (LinearBlock::*figure)(const BiasFeatures&) const) const;

  std::vector<LinearBlockPtr> blocks_;
  BiasFeatures shape_;  // only its dimensions count
  Eigen::Index columns_ = 0;
  Eigen::Index parameters_ = 0;
};

}  // namespace trammel
