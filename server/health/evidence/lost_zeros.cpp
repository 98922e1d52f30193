#include "server/health/evidence/lost_zeros.h"

#include <algorithm>
#include <cmath>

#include "server/health/evidence/refitted_rows.h"

namespace trammel::health {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t kMostZeros = 8;  // of an arm: 2^8 sets
constexpr int kMostSteps = 12;
constexpr double kSettled = 1e-3;      // whitened square of a step
constexpr double kFarthestTurn = 0.3;  // rad, of a step: beyond it nothing is linear

/// Keeps only the parts of both that are orthogonal to `free`, which is unrestricted.
void take_out(const MatrixXd& free, MatrixXd& J, VectorXd& residual) {
  if (free.cols() == 0) return;
  const Eigen::HouseholderQR<MatrixXd> qr(free);
  const MatrixXd Q = qr.householderQ() * MatrixXd::Identity(free.rows(), free.cols());
  J -= Q * (Q.transpose() * J);
  residual -= Q * (Q.transpose() * residual);
}

}  // namespace

ZerosSearch::ZerosSearch(const CauseEffects& effects, const CheckRows& rows,
                         std::vector<std::size_t> zeros, bool new_tool)
    : effects_(effects),
      rows_(rows),
      zeros_(std::move(zeros)),
      new_tool_(new_tool),
      factor_(rows.covariance) {
  for (const PoseContext& context : rows.contexts) physics_.push_back(effects.at(context).X_BT);
  const RefittedRows refitted(rows.covariance, rows.by_base);
  tool_numbers_ = static_cast<int>(
      refitted.directions(rows.by_cause(Eigen::all, effects.tool_columns())).cols());
}

ZerosSearch::Linear ZerosSearch::linear(const VectorXd& at, const Pose& X_BB, bool warmth) const {
  Linear now{VectorXd(rows_.residual.size()), MatrixXd(rows_.by_base.rows(), rows_.by_base.cols()),
             MatrixXd(rows_.by_cause.rows(), rows_.by_cause.cols())};
  for (std::size_t i = 0; i < rows_.poses(); ++i) {
    const Index first = rows_.first[i], count = rows_.count[i];
    const PoseEffects there = warmth ? effects_.at(rows_.contexts[i], at)
                                     : effects_.without_warmth(rows_.contexts[i], at);
    now.by_base.middleRows(first, count) = there.by_base.topLeftCorner(count, now.by_base.cols());
    now.by_cause.middleRows(first, count) = there.by_cause.topRows(count);
    // The model's bias moves with the arm.
    const Pose& was = rows_.predicted[i];
    const Vector3 p_B = was.translation() + there.X_BT.translation() - physics_[i].translation();
    const Vector3 measured_B =
        X_BB.inverse() * (was.translation() + rows_.residual.segment<3>(first));
    now.residual.segment<3>(first) = measured_B - p_B;
    if (count == 3) continue;
    const Matrix3 R_B = there.X_BT.linear() * physics_[i].linear().transpose() * was.linear();
    const Matrix3 measured_R = rotation_exp(rows_.residual.segment<3>(first + 3)) * was.linear();
    now.residual.segment<3>(first + 3) =
        rotation_log(X_BB.linear().transpose() * measured_R * R_B.transpose());
  }
  return now;
}

ZerosFit ZerosSearch::begun(unsigned chosen, bool tool, const std::vector<int>& bad) const {
  ZerosFit one;
  one.tool = tool;
  one.bad = bad;
  for (std::size_t k = 0; k < zeros_.size(); ++k) {
    if ((chosen >> k & 1U) == 0) continue;
    one.zeros.push_back(zeros_[k]);
    one.columns.push_back(effects_.causes()[zeros_[k]].columns.front());
  }
  one.numbers = static_cast<int>(one.zeros.size()) + (tool ? tool_numbers_ : 0);
  const auto& columns = effects_.tool_columns();
  if (tool || new_tool_) one.columns.insert(one.columns.end(), columns.begin(), columns.end());
  one.at = VectorXd::Zero(effects_.size());
  return one;
}

MatrixXd ZerosSearch::freeing(const std::vector<int>& bad) const {
  Index numbers = 0;
  for (const int pose : bad) numbers += rows_.count[static_cast<std::size_t>(pose)];
  MatrixXd free = MatrixXd::Zero(rows_.residual.size(), numbers);
  Index column = 0;
  for (const int pose : bad) {
    const auto i = static_cast<std::size_t>(pose);
    free.block(rows_.first[i], column, rows_.count[i], rows_.count[i]).setIdentity();
    column += rows_.count[i];
  }
  return factor_.matrixL().solve(free);
}

void ZerosSearch::fit(ZerosFit& one) const {
  const auto k = static_cast<Index>(one.columns.size());
  const Index b = rows_.by_base.cols();
  const MatrixXd free = freeing(one.bad);
  VectorXd precision(k);  // of the prior
  precision.setConstant(std::pow(kWidest, -2));
  precision.head(static_cast<Index>(one.zeros.size())).setConstant(std::pow(kWidestZero, -2));
  for (int step = 0; step < kMostSteps; ++step) {
    const Linear now = linear(one.at, one.X_BB, false);
    MatrixXd J(now.residual.size(), b + k);
    J << now.by_base, now.by_cause(Eigen::all, one.columns);
    J = factor_.matrixL().solve(J);
    VectorXd residual = factor_.matrixL().solve(now.residual);
    take_out(free, J, residual);
    MatrixXd information = J.transpose() * J;
    information.diagonal().tail(k) += precision;
    VectorXd gradient = J.transpose() * residual;
    gradient.tail(k) -= precision.cwiseProduct(VectorXd(one.at(one.columns)));
    const Eigen::LDLT<MatrixXd> solver(information);
    VectorXd by = solver.solve(gradient);
    one.covariance = solver.solve(MatrixXd::Identity(b + k, b + k)).bottomRightCorner(k, k);
    const Vector3 turn = rows_.base_turns() ? Vector3(by.segment<3>(3)) : Vector3::Zero();
    double farthest = turn.cwiseAbs().maxCoeff();
    for (std::size_t z = 0; z < one.zeros.size(); ++z)
      farthest = std::max(farthest,
                          std::abs(by(b + static_cast<Index>(z))) * effects_.scale(one.columns[z]));
    const bool is_settled = (J * by).squaredNorm() < kSettled;
    one.left = is_settled ? (residual - J * by).squaredNorm() : residual.squaredNorm();
    const double part = std::min(1.0, kFarthestTurn / std::max(farthest, kFarthestTurn));
    by *= part;
    one.X_BB = one.X_BB * make_pose(rotation_exp(part * turn), by.head<3>());
    for (Index c = 0; c < k; ++c) one.at(one.columns[static_cast<std::size_t>(c)]) += by(b + c);
    if (is_settled) return;
  }
}

std::vector<ZerosFit> ZerosSearch::all(const std::vector<int>& bad) const {
  std::vector<ZerosFit> fits;
  if (zeros_.size() > kMostZeros) return fits;
  for (const bool tool : {false, true}) {
    if (tool && (new_tool_ || tool_numbers_ == 0)) continue;
    for (unsigned chosen = tool ? 0 : 1; chosen < 1U << zeros_.size(); ++chosen) {
      fits.push_back(begun(chosen, tool, bad));
      fit(fits.back());
    }
  }
  return fits;
}

CheckRows ZerosSearch::around(const ZerosFit& fit) const {
  Linear there = linear(fit.at, fit.X_BB, true);
  CheckRows rows = rows_;
  rows.residual = there.residual + there.by_cause * fit.at;
  rows.by_base = std::move(there.by_base);
  rows.by_cause = std::move(there.by_cause);
  return rows;
}

}  // namespace trammel::health
