#pragma once

#include <cmath>
#include <random>

#include "server/bias/bias_model.h"
#include "server/bias/kernels/kernel_spelling.h"

/// Made-up residuals of a six-joint robot, for the tests and the benchmarks of the bias.
namespace trammel {

/// The kernel that is spelled so; null where none is.
inline KernelPtr make_kernel(std::string_view spelling) {
  return spelled_kernel(spelling).value_or(nullptr);
}

inline Eigen::MatrixXd random_joints(Eigen::Index count, std::uint64_t seed,
                                     Eigen::Index joints = 6) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> angle(-1.2, 1.2);
  Eigen::MatrixXd q(count, joints);
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index j = 0; j < joints; ++j) q(i, j) = angle(random);
  }
  return q;
}

inline double normal(std::mt19937_64* random) {
  return std::normal_distribution<double>()(*random);
}

/// A smooth error of some tenths of a millimetre, m.
inline Vector3 smooth_error_B(const JointVector& q) {
  return 1e-3 *
         Vector3(0.2 * std::sin(q[0] + 0.5 * q[1]) + 0.1 * std::cos(1.5 * q[2] - q[3]) * q[1],
                 0.15 * std::cos(q[1] + q[2]) * std::sin(0.7 * q[4]) + 0.05 * q[0] * q[3],
                 0.25 * std::sin(q[1]) * std::cos(q[2]) + 0.05 * std::sin(2.0 * q[3] + q[5]));
}

/// `noise` in m, of each coordinate.
inline BiasProblem smooth_problem(Eigen::Index count, std::uint64_t seed, double noise = 10e-6) {
  BiasProblem problem;
  problem.q = random_joints(count, seed);
  problem.residual_B.resize(count, 3);
  problem.sigma = Eigen::VectorXd::Constant(count, noise);
  std::mt19937_64 random(seed + 1000);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Vector3 error_B = smooth_error_B(problem.q.row(i));
    for (int d = 0; d < 3; ++d) problem.residual_B(i, d) = error_B[d] + noise * normal(&random);
  }
  return problem;
}

}  // namespace trammel
