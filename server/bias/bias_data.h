#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "server/bias/kernels/linear_block.h"
#include "server/robot/pose.h"

/// What a bias learns from, what it says, and what must be kept of it.
namespace trammel {

/// N observations of the residual measured - calibrated.
struct BiasProblem {
  Eigen::MatrixXd q;                        ///< N x n, rad
  Eigen::MatrixXd residual_B;               ///< N x 3, m, expressed in B
  Eigen::VectorXd sigma;                    ///< N, m: what metrology says of one coordinate of each observation
  std::vector<BiasFeatures> features = {};  ///< N; none where the kernel has no blocks
};

struct BiasOptions {
  std::string kernel = "se";  ///< `se`, `matern52 + joint_map`, `none`, ... as spelled in the cell file
  int starts = 20;            ///< of the hyperparameter search, log-uniform
  std::uint64_t seed = 1;
  /// Called between steps with the share done in [0, 1]; return false to give up.
  std::function<bool(double)> progress;
};

/// At one joint vector, for the three coordinates in B.
struct BiasPrediction {
  Vector3 mean_B = Vector3::Zero();  ///< m
  /// m: what of mean_B rests on training poses nearby: what the kernel says, without blocks all of it. The rest is H w
  /// of the blocks and the mean residual.
  Vector3 nearby_B = Vector3::Zero();
  Vector3 stddev_B = Vector3::Zero();           ///< m, of the function itself
  Vector3 measured_stddev_B = Vector3::Zero();  ///< m, of one measurement as noisy as the mean of them
  Matrix3 covariance_B = Matrix3::Zero();  ///< m^2, of the function itself; diagonal where no block couples the axes
  double prior_share =
      1.0;  ///< posterior variance of the function / prior variance, largest coordinate; 0 known, 1 not
};

/// All that must be kept to restore a fitted model exactly: no factor, no table. Who knows the physics need not keep
/// `features`, but must give the same ones again.
struct BiasState {
  std::string kernel;
  Eigen::MatrixXd q;                ///< N x n, rad
  Eigen::MatrixXd residual_B;       ///< N x 3, m
  Eigen::VectorXd sigma;            ///< N, m
  Eigen::VectorXd offset;           ///< per output, m: the mean residual, what the model says far from all data
  Eigen::MatrixXd hyperparameters;  ///< one column per output; rows as the kernel orders them, natural logarithms
  Eigen::VectorXd block_hyperparameters = {};  ///< of the blocks one after the other, natural logarithms
  std::vector<BiasFeatures> features = {};     ///< N; none where the kernel has no blocks
};

/// How the fit went, for the report.
struct BiasFitReport {
  Eigen::VectorXd log_likelihood;  ///< nat: of each output, or one number where blocks couple them
  Eigen::VectorXd noise_stddev;    ///< m, of each output
  double leave_one_out_rms = 0;    ///< m, Euclidean
  int starts_at_best = 0;          ///< how many starts reached the best optimum of the subset within 0.1 nat
  int evaluations = 0;             ///< of the full likelihood and gradient
};

}  // namespace trammel
