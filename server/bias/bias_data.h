#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "server/bias/kernels/linear_block.h"
#include "server/robot/pose.h"

/// The input of a bias, its predictions, and the state that restores it.
namespace trammel {

inline constexpr Eigen::Index kCoordinates = 3;  ///< x, y, z: the coordinates that a bias predicts

/// N observations of the residual: measured minus calibrated.
struct BiasProblem {
  Eigen::MatrixXd q;                        ///< N x n, rad
  Eigen::MatrixXd residual_B;               ///< N x 3, m, expressed in B
  Eigen::VectorXd sigma;                    ///< N, m: standard deviation of one measured coordinate
  std::vector<BiasFeatures> features = {};  ///< N; empty for a kernel without blocks or flange
};

struct BiasOptions {
  std::string kernel =
      "se";         ///< `se`, `matern52 + joint_map`, `none`, ... as spelled in the cell file
  int starts = 20;  ///< of the hyperparameter search
  std::uint64_t seed = 1;
  /// Called between steps with the share done, in [0, 1]. Returns false to give up.
  std::function<bool(double)> progress;
};

/// At one joint vector, for the three coordinates in B.
struct BiasPrediction {
  Vector3 mean_B = Vector3::Zero();  ///< m
  /// m: the part of mean_B that the kernel learned from training poses nearby. For a kernel without
  /// blocks it is all of mean_B. The rest is H w of the blocks (linear_block.h) and the mean
  /// residual.
  Vector3 nearby_B = Vector3::Zero();
  Vector3 stddev_B = Vector3::Zero();           ///< m, of the function itself
  Vector3 measured_stddev_B = Vector3::Zero();  ///< m, of one measurement with average noise
  Matrix3 covariance_B =
      Matrix3::Zero();  ///< m^2, of the function itself; diagonal where no block couples the axes
  /// Posterior over prior variance of the function, the largest of the coordinates: 0 fully known,
  /// 1 unknown.
  double prior_share = 1.0;
};

/// All data that restore a fitted model bit for bit; factors and tables are computed again.
/// `features` follow from the physics, so they are not stored, but the caller must pass the same
/// ones again.
struct BiasState {
  std::string kernel;
  Eigen::MatrixXd q;           ///< N x n, rad
  Eigen::MatrixXd residual_B;  ///< N x 3, m
  Eigen::VectorXd sigma;       ///< N, m
  Eigen::VectorXd
      offset;  ///< of each coordinate, m: the mean residual, predicted far from all data
  Eigen::MatrixXd hyperparameters;  ///< a column for each coordinate, natural logarithms: kernel,
                                    ///< log σ_f, log σ_n
  /// The hyperparameters of all blocks in their order, natural logarithms; for `flange` those of
  /// the kernel and log σ (rad) of the rotation.
  Eigen::VectorXd block_hyperparameters = {};
  std::vector<BiasFeatures> features = {};  ///< N; empty for a kernel without blocks or flange
};

/// The figures of the fit.
struct BiasFitReport {
  Eigen::VectorXd
      log_likelihood;  ///< nat: of each coordinate, or one number where blocks couple them
  Eigen::VectorXd noise_stddev;  ///< m, of each coordinate
  double leave_one_out_rms = 0;  ///< m, Euclidean
  int starts_at_best = 0;  ///< starts that ended within 0.1 nat of the best optimum on the subset
  int evaluations = 0;     ///< of the full likelihood and gradient
};

}  // namespace trammel
