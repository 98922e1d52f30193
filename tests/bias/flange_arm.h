#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <random>
#include <vector>

#include "server/bias/bias_model.h"
#include "tests/bias/bias_data.h"

/// A flange that is shifted and turned by a smooth error, seen through levers.
namespace trammel {

/// rad; some tenths of a milliradian.
inline Vector3 smooth_turn_B(const JointVector& q) {
  return 1e-3 * Vector3(0.3 * std::sin(q[1] - 0.4 * q[2]), 0.2 * std::cos(q[0] + 0.6 * q[4]) * q[2],
                        0.25 * std::sin(0.8 * q[0] + q[3]));
}

inline Matrix3 flange_stands(const JointVector& q) {
  return (Eigen::AngleAxisd(q[0] + q[3], Vector3::UnitZ()) *
          Eigen::AngleAxisd(q[1] + q[4], Vector3::UnitY()) *
          Eigen::AngleAxisd(q[5], Vector3::UnitX()))
      .toRotationMatrix();
}

inline BiasFeatures at_lever(const JointVector& q, const Vector3& lever_F) {
  return {Eigen::MatrixXd::Zero(6, 6), Eigen::MatrixXd::Zero(6, 2), lever_F, flange_stands(q)};
}

/// The true error of the point at this lever.
inline Vector3 error_at_lever_B(const JointVector& q, const Vector3& lever_F) {
  return smooth_error_B(q) + smooth_turn_B(q).cross(flange_stands(q) * lever_F);
}

/// At every joint vector all `levers` are measured, one after the other.
inline BiasProblem seen_problem(const Eigen::MatrixXd& q, const std::vector<Vector3>& levers,
                                std::uint64_t seed, double noise = 10e-6) {
  const auto each = static_cast<Eigen::Index>(levers.size());
  BiasProblem problem;
  problem.q.resize(each * q.rows(), q.cols());
  problem.residual_B.resize(each * q.rows(), 3);
  problem.sigma = Eigen::VectorXd::Constant(each * q.rows(), noise);
  std::mt19937_64 random(seed + 2000);
  for (Eigen::Index row = 0; row < problem.q.rows(); ++row) {
    const JointVector joints = q.row(row / each);
    const Vector3& lever_F = levers[static_cast<std::size_t>(row % each)];
    problem.q.row(row) = joints.transpose();
    problem.features.push_back(at_lever(joints, lever_F));
    const Vector3 error_B = error_at_lever_B(joints, lever_F);
    for (int d = 0; d < 3; ++d) problem.residual_B(row, d) = error_B[d] + noise * normal(&random);
  }
  return problem;
}

}  // namespace trammel
