#pragma once

#include <Eigen/Dense>
#include <memory>
#include <string_view>
#include <vector>

#include "server/robot/pose.h"

/// Blocks of a bias: parts of the residual that are linear in few weights, H(q) w with w ~ N(0,
/// diag(variances)). The coordinates share the weights.
namespace trammel {

/// The motion of the tool when the arm changes a little. Rows: position (m), rotation vector (rad),
/// both in B.
struct BiasFeatures {
  Eigen::MatrixXd
      by_joint;  ///< 6 x n, per rad that the joint gives way; zero for a prismatic joint
  Eigen::MatrixXd by_parameter;        ///< 6 x P, per prior standard deviation of the parameter
  Vector3 lever_F = Vector3::Zero();   ///< m: the tool's point, seen from the flange
  Matrix3 R_BF = Matrix3::Identity();  ///< orientation of the flange
  JointVector gears = {};  ///< rad: the angles of the gears; empty where they are the joints' own
};

/// One block of columns of H. A value without state: its hyperparameters are passed in as natural
/// logarithms. Thread-safe.
class LinearBlock {
 public:
  virtual ~LinearBlock() = default;

  /// The spelling in a bias.
  [[nodiscard]] virtual std::string_view name() const = 0;
  /// The number of weights, and the number of hyperparameters, for features of that shape.
  [[nodiscard]] virtual Eigen::Index column_count(const BiasFeatures& shape) const = 0;
  [[nodiscard]] virtual Eigen::Index parameter_count(const BiasFeatures& shape) const = 0;
  /// Prior of the hyperparameters: mean, where the search starts, and standard deviation.
  [[nodiscard]] virtual Eigen::VectorXd start(const BiasFeatures& shape) const = 0;
  [[nodiscard]] virtual Eigen::VectorXd spread(const BiasFeatures& shape) const = 0;

  /// 6 x column_count, at one pose.
  virtual void columns(const JointVector& q, const BiasFeatures& features,
                       Eigen::Ref<Eigen::MatrixXd> out) const = 0;
  /// Logarithms of the prior variances of the weights, and their derivative, column_count x
  /// parameter_count.
  virtual void log_variance(const BiasFeatures& shape, const Eigen::VectorXd& parameters,
                            Eigen::Ref<Eigen::VectorXd> log_variance,
                            Eigen::Ref<Eigen::MatrixXd> derivative) const = 0;
};

using LinearBlockPtr = std::shared_ptr<const LinearBlock>;

/// An error of each gear that depends on that gear's angle alone: Σ_j J_j(q) k_j(g_j, g_j')
/// J_j(q')ᵀ, g_j the angle of gear j. k_j is a Matérn 3/2 kernel on the circle in a Fourier basis:
/// periodic and once differentiable. Hyperparameters of each joint: log amplitude, rad; log of the
/// harmonic at which the spectrum begins to fall.
[[nodiscard]] LinearBlockPtr make_joint_map_block();
/// The effect that errors of the physical parameters leave, identified or not: H = J_θ(q). No
/// hyperparameters: the weights have the prior variances of the parameters.
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
  BiasFeatures shape_;  // only the number of its columns matters
  Eigen::Index columns_ = 0;
  Eigen::Index parameters_ = 0;
};

}  // namespace trammel
