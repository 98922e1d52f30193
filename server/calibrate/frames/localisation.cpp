#include "server/calibrate/frames/localisation.h"

#include <cmath>

#include "server/base/check.h"
#include "server/robot/rigid_fit.h"

namespace trammel {

namespace {

constexpr double kLeastTurning = 1e-4;  // rad²: the nominal chain is itself some 10 mrad off
constexpr int kMostAlternations =
    10000;                          // nearly flat valleys take thousands; each costs microseconds
constexpr double kLastStep = 1e-9;  // m
constexpr double kOnePoint = 1e-7;  // m: positions this close are one stated point, not measured
                                    // ones

/// The point t with R_i t ~ difference_i for all poses: the mean of R_iᵀ difference_i.
Vector3 mean_point(const Eigen::Matrix3Xd& p_W, const std::vector<Pose>& X_WF) {
  Vector3 sum = Vector3::Zero();
  for (std::size_t i = 0; i < X_WF.size(); ++i)
    sum += X_WF[i].inverse() * Vector3(p_W.col(static_cast<int>(i)));
  return sum / static_cast<double>(X_WF.size());
}

/// The rotations of base and tool; translations zero. R_WT R_FTᵀ = R_WB R_BF, so vec(R_WB) and
/// vec(R_FTᵀ) are the singular pair of K = Σ kron(R_BF, R_WT) with the largest singular value.
Result<BaseAndTool> locate_rotations(const std::vector<Pose>& X_WT, const std::vector<Pose>& X_BF) {
  Eigen::Matrix<double, 9, 9> K = Eigen::Matrix<double, 9, 9>::Zero();
  for (std::size_t i = 0; i < X_WT.size(); ++i) {
    const Matrix3 F = X_BF[i].linear();
    const Matrix3 T = X_WT[i].linear();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) K.block<3, 3>(3 * r, 3 * c) += F(r, c) * T;
    }
  }
  const Eigen::JacobiSVD<Eigen::Matrix<double, 9, 9>> svd(
      K, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double count = static_cast<double>(X_WT.size());
  if (!(svd.singularValues()(0) - svd.singularValues()(1) > kLeastTurning * count)) {
    return refused(
        "base and tool: the poses turn too little about different axes to find both ({} poses)",
        X_WT.size());
  }
  // K vec(A) = N vec(B) with B F = T A, i.e. A = R_FTᵀ, B = R_WB; both up to one common sign.
  Matrix3 B = Eigen::Map<const Matrix3>(svd.matrixU().col(0).data());
  Matrix3 A = Eigen::Map<const Matrix3>(svd.matrixV().col(0).data());
  if (B.determinant() < 0) {
    B = -B;
    A = -A;
  }
  BaseAndTool found;
  found.X_WB.linear() = nearest_rotation(B);
  found.X_FT.linear() = nearest_rotation(A).transpose();
  return found;
}

/// Finds both translations when the rotations are known. p_WT = p_WB + R_WB (p_BF + R_BF p_FT) is
/// linear in them.
Status add_translations(const std::vector<Pose>& X_WT, const std::vector<Pose>& X_BF,
                        BaseAndTool& found) {
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
  Vector6 right = Vector6::Zero();
  for (std::size_t i = 0; i < X_WT.size(); ++i) {
    Eigen::Matrix<double, 3, 6> row;
    row << Matrix3::Identity(), found.X_WB.linear() * X_BF[i].linear();
    normal += row.transpose() * row;
    right +=
        row.transpose() * (X_WT[i].translation() - found.X_WB.linear() * X_BF[i].translation());
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(normal);
  if (!(eigen.eigenvalues()(0) > kLeastTurning * eigen.eigenvalues()(5))) {
    return refused(
        "base and tool: the poses turn too little to tell the tool from the base ({} poses)",
        X_WT.size());
  }
  const Vector6 solution = normal.ldlt().solve(right);
  found.X_WB.translation() = solution.head<3>();
  found.X_FT.translation() = solution.tail<3>();
  return {};
}

}  // namespace

Result<BaseAndTool> locate_base_and_tool(const std::vector<Pose>& X_WT,
                                         const std::vector<Pose>& X_BF) {
  TRAMMEL_CHECK(X_WT.size() == X_BF.size());
  if (X_WT.size() < 3)
    return refused("base and tool: {} full poses, at least 3 are needed", X_WT.size())
        .beyond(X_WT.size(), 3);
  Result<BaseAndTool> found = locate_rotations(X_WT, X_BF);
  if (!found) return found;
  TRY(add_translations(X_WT, X_BF, *found));
  return found;
}

namespace {

Matrix3 mean_rotation(const std::vector<Pose>& X_BF) {
  Matrix3 mean_R = Matrix3::Zero();
  for (const Pose& X : X_BF) mean_R += X.linear();
  return mean_R / static_cast<double>(X_BF.size());
}

/// Solves for the tool point and the base's translation, with the base's rotation from `found`. If
/// the flange turns about one axis only, a shift along it is undetermined and stays at its
/// smallest. Returns the step of the tool point, m.
double solve_point(const Eigen::Matrix3Xd& p_W, const std::vector<Pose>& X_BF,
                   const Matrix3& mean_R, BaseAndTool& found) {
  const Matrix3 R_WB = found.X_WB.linear();
  Matrix3 normal = Matrix3::Zero();
  Vector3 right = Vector3::Zero();
  Vector3 shift = Vector3::Zero();
  for (std::size_t i = 0; i < X_BF.size(); ++i) {
    const Matrix3 turned = R_WB * (X_BF[i].linear() - mean_R);
    normal += turned.transpose() * turned;
    right += turned.transpose() * (p_W.col(static_cast<int>(i)) - R_WB * X_BF[i].translation());
    shift += p_W.col(static_cast<int>(i)) - R_WB * X_BF[i].translation();
  }
  Eigen::CompleteOrthogonalDecomposition<Matrix3> decomposition;
  decomposition.setThreshold(kLeastTurning);
  decomposition.compute(normal);
  const Vector3 point = decomposition.solve(right);
  const double step = (point - found.X_FT.translation()).norm();
  found.X_WB.translation() = shift / static_cast<double>(X_BF.size()) - R_WB * mean_R * point;
  found.X_FT.translation() = point;
  return step;
}

}  // namespace

Result<BaseAndTool> locate_base_and_tool_point(const Eigen::Matrix3Xd& p_W,
                                               const std::vector<Pose>& X_BF) {
  TRAMMEL_CHECK(p_W.cols() == static_cast<int>(X_BF.size()));
  if (X_BF.size() < 6)
    return refused("base and tool: {} positions, at least 6 are needed", X_BF.size())
        .beyond(X_BF.size(), 6);
  const Matrix3 mean_R = mean_rotation(X_BF);
  const double turning = 1 - Eigen::JacobiSVD<Matrix3>(mean_R).singularValues()(1);
  if (!(turning > kLeastTurning))
    return refused("base and tool: the flange turns too little to tell the tool from the base");
  BaseAndTool found;
  if ((p_W.colwise() - p_W.rowwise().mean()).colwise().norm().maxCoeff() < kOnePoint) {
    solve_point(p_W, X_BF, mean_R,
                found);  // any turn of the base about the point fits alike: none is taken
    return found;
  }
  Eigen::Matrix3Xd p_B(3, p_W.cols());
  for (int round = 0; round < kMostAlternations; ++round) {
    for (std::size_t i = 0; i < X_BF.size(); ++i)
      p_B.col(static_cast<int>(i)) = X_BF[i] * found.X_FT.translation();
    const Pose X_WB = TRY(fit_transform(p_W, p_B));
    found.X_WB = X_WB;
    const double step = solve_point(p_W, X_BF, mean_R, found);
    if (!std::isfinite(step))
      return refused("base and tool: the positions do not determine the tool point");
    if (step < kLastStep) break;
  }
  return found;
}

Result<Pose> locate_tool(const std::vector<Pose>& X_WT, const std::vector<Pose>& X_WF) {
  TRAMMEL_CHECK(X_WT.size() == X_WF.size());
  if (X_WT.empty()) return refused("tool: no full pose to find it from");
  Matrix3 sum = Matrix3::Zero();
  Vector3 point = Vector3::Zero();
  for (std::size_t i = 0; i < X_WT.size(); ++i) {
    const Pose X_FT = X_WF[i].inverse() * X_WT[i];
    sum += X_FT.linear();
    point += X_FT.translation();
  }
  return make_pose(nearest_rotation(sum), point / static_cast<double>(X_WT.size()));
}

Result<Vector3> locate_tool_point(const Eigen::Matrix3Xd& p_W, const std::vector<Pose>& X_WF) {
  TRAMMEL_CHECK(p_W.cols() == static_cast<int>(X_WF.size()));
  if (X_WF.empty()) return refused("tool: no position to find it from");
  return mean_point(p_W, X_WF);
}

}  // namespace trammel
