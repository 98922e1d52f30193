#include "server/robot/rigid_fit.h"

#include "server/base/check.h"

namespace trammel {

namespace {

constexpr double kLeastSpread = 1e-6;  // ratio of singular values below which points lie on a line

}  // namespace

Result<Pose> fit_transform(const Eigen::Matrix3Xd& points_A, const Eigen::Matrix3Xd& points_B) {
  TRAMMEL_CHECK(points_A.cols() == points_B.cols());
  if (points_A.cols() < 3)
    return refused("localisation: {} points, at least 3 are needed", points_A.cols())
        .beyond(points_A.cols(), 3);
  const Vector3 mean_A = points_A.rowwise().mean();
  const Vector3 mean_B = points_B.rowwise().mean();
  const Matrix3 cross = (points_A.colwise() - mean_A) * (points_B.colwise() - mean_B).transpose();
  const Vector3 singular = Eigen::JacobiSVD<Matrix3>(cross).singularValues();
  if (!(singular(1) > kLeastSpread * singular(0)))
    return refused("localisation: the points lie on one line").next("measure one beside that line");
  const Matrix3 R = nearest_rotation(cross);
  return make_pose(R, mean_A - R * mean_B);
}

}  // namespace trammel
