#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "server/bias/coupled/coupled_posterior.h"
#include "tests/bias/bias_data.h"

/// An arm of three joints (one turns it, two bend it) with 0.5 m and 0.4 m links, for the tests of
/// coupled processes.
namespace trammel {

struct Arm {
  std::array<Vector3, 3> axis_B;
  std::array<Vector3, 3> origin_B;
  Vector3 upper_B;  ///< directions of the two links
  Vector3 lower_B;
  Vector3 p_B;
};

inline Arm arm_at(const JointVector& q) {
  const Vector3 outwards_B(std::cos(q[0]), std::sin(q[0]), 0);
  const auto direction_B = [&](double lift) {
    return Vector3(std::cos(lift) * outwards_B + std::sin(lift) * Vector3::UnitZ());
  };
  const Vector3 bend_B = outwards_B.cross(Vector3::UnitZ());
  const Vector3 upper_B = direction_B(q[1]);
  const Vector3 lower_B = direction_B(q[1] + q[2]);
  const Vector3 elbow_B = 0.5 * upper_B;
  return {{Vector3::UnitZ(), bend_B, bend_B},
          {Vector3::Zero(), Vector3::Zero(), elbow_B},
          upper_B,
          lower_B,
          elbow_B + 0.4 * lower_B};
}

/// Deflections of the three joints; both links' lengths, known to 0.2 mm beforehand.
inline BiasFeatures arm_features(const JointVector& q) {
  const Arm arm = arm_at(q);
  BiasFeatures features{Eigen::MatrixXd(6, 3), Eigen::MatrixXd::Zero(6, 2)};
  for (std::size_t j = 0; j < 3; ++j)
    features.by_joint.col(static_cast<Eigen::Index>(j))
        << arm.axis_B[j].cross(arm.p_B - arm.origin_B[j]),
        arm.axis_B[j];
  features.by_parameter.col(0).head(3) = 2e-4 * arm.upper_B;
  features.by_parameter.col(1).head(3) = 2e-4 * arm.lower_B;
  return features;
}

inline LinearBlocks arm_blocks(std::vector<LinearBlockPtr> blocks) {
  return {std::move(blocks), arm_features(JointVector::Zero(3))};
}

/// H(q) of the position, 3 x p.
inline Eigen::MatrixXd arm_columns(const LinearBlocks& blocks, const JointVector& q) {
  return blocks.columns(q, arm_features(q)).topRows(3);
}

inline CoupledData arm_data(const LinearBlocks& blocks, const Eigen::MatrixXd& q,
                            const Eigen::MatrixXd& y, const Eigen::VectorXd& noise_shape) {
  CoupledData data{
      q, y, noise_shape,
      std::vector<Eigen::MatrixXd>(3, Eigen::MatrixXd(q.rows(), blocks.column_count()))};
  for (Eigen::Index i = 0; i < q.rows(); ++i) {
    const Eigen::MatrixXd H = arm_columns(blocks, q.row(i));
    for (std::size_t d = 0; d < 3; ++d)
      data.columns[d].row(i) = H.row(static_cast<Eigen::Index>(d));
  }
  return data;
}

/// At one joint vector, with H(q) as arm_columns() gives it.
inline CoupledPrediction predict_one(const CoupledPosterior& posterior, const JointVector& q,
                                     const Eigen::MatrixXd& H) {
  std::vector<Eigen::MatrixXd> columns;
  for (const auto& row : H.rowwise()) columns.emplace_back(row);
  return posterior.predict(q.transpose(), columns).front();
}

/// Gear errors of the three joints, rad: each of a slow and a fast harmonic.
inline Vector3 gear_errors(const JointVector& q) {
  return 1e-4 * Vector3(std::sin(q[0]) + 0.8 * std::cos(9 * q[0]),
                        std::cos(2 * q[1]) + 0.8 * std::sin(11 * q[1]),
                        std::sin(2 * q[2]) + 0.8 * std::cos(7 * q[2]));
}

}  // namespace trammel
