#include "server/bias/process/inducing_points.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "server/numerics/numerics.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kPanel = 48;  // candidates at a time: their columns are computed together
constexpr double kPanelShare =
    0.25;  // share of the variance that the best candidate explains: below it a new panel is better

AlignedMatrix gathered(const AlignedMatrix& features, const std::vector<Index>& rows) {
  AlignedMatrix table(padded_rows(static_cast<Index>(rows.size())), features.cols());
  for (std::size_t i = 0; i < rows.size(); ++i)
    table.map().row(static_cast<Index>(i)) = features.map().row(rows[i]);
  return table;
}

FeatureBlock all_of(const AlignedMatrix& features, Index count) {
  return {features.data(), count, features.rows()};
}

// The points with the most remaining variance. Among equal points the first one.
std::vector<Index> candidates(const VectorXd& left, double tolerance) {
  std::vector<Index> order(static_cast<std::size_t>(left.size()));
  std::iota(order.begin(), order.end(), Index{0});
  const auto panel = order.begin() + std::min(kPanel, left.size());
  std::partial_sort(order.begin(), panel, order.end(), [&left](Index a, Index b) {
    return left[a] != left[b] ? left[a] > left[b] : a < b;
  });
  order.erase(panel, order.end());
  std::erase_if(order, [&](Index i) { return left[i] <= tolerance; });
  return order;
}

// Pivoted Cholesky of the candidates' block. Returns the positions taken, and their factor.
std::vector<Index> take(MatrixXd block, double least, Index most, MatrixXd* factor) {
  std::vector<Index> taken;
  MatrixXd lower = MatrixXd::Zero(block.rows(), block.rows());
  VectorXd left = block.diagonal();
  while (static_cast<Index>(taken.size()) < most) {
    Index pivot = 0;
    const double best = left.maxCoeff(&pivot);
    if (!(best > least)) break;
    const auto j = static_cast<Index>(taken.size());
    lower.col(j) = (block.col(pivot) - lower.leftCols(j) * lower.row(pivot).head(j).transpose()) /
                   std::sqrt(best);
    left -= lower.col(j).cwiseAbs2();
    left[pivot] = 0;
    taken.push_back(pivot);
  }
  *factor =
      lower(taken, Eigen::seqN(0, static_cast<Index>(taken.size()))).triangularView<Eigen::Lower>();
  return taken;
}

}  // namespace

std::vector<Index> spanning_points(const Kernel& kernel, const VectorXd& parameters,
                                   const AlignedMatrix& features, Index count, double tolerance,
                                   Index most) {
  const Index rows = padded_rows(count);
  AlignedMatrix phi(rows, most);
  AlignedMatrix columns(rows, padded_rows(kPanel));
  AlignedMatrix work(numerics().multiply_work_size(rows, kPanel), 1);
  VectorXd left(count);
  kernel.diagonal(parameters, all_of(features, count), left.data());
  std::vector<Index> points;
  while (static_cast<Index>(points.size()) < most) {
    const std::vector<Index> panel = candidates(left, tolerance);
    if (panel.empty()) break;
    const auto width = static_cast<Index>(panel.size());
    const auto done = static_cast<Index>(points.size());
    const AlignedMatrix chosen = gathered(features, panel);
    kernel.tile(parameters, all_of(features, count), all_of(chosen, width), columns.data(), rows);
    AlignedMatrix phi_panel(padded_rows(width), std::max<Index>(done, 1));
    for (Index i = 0; i < width; ++i)
      phi_panel.map().row(i).head(done) =
          phi.map().row(panel[static_cast<std::size_t>(i)]).head(done);
    numerics().multiply_transposed(rows, width, done, -1.0, phi.data(), rows, phi_panel.data(),
                                   phi_panel.rows(), false, columns.data(), rows, work.data());
    MatrixXd factor;
    const double least = std::max(tolerance, kPanelShare * left[panel.front()]);
    const std::vector<Index> taken =
        take(columns.map()(panel, Eigen::seqN(0, width)), least, most - done, &factor);
    if (taken.empty()) break;
    const auto more = static_cast<Index>(taken.size());
    auto fresh = phi.map().middleCols(done, more);
    fresh.topRows(count) = columns.map()(Eigen::seqN(0, count), taken);
    factor.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(fresh);
    left -= fresh.topRows(count).rowwise().squaredNorm();
    for (const Index position : taken) {
      points.push_back(panel[static_cast<std::size_t>(position)]);
      left[points.back()] = 0;
    }
  }
  return points;
}

std::optional<InducingPoints> InducingPoints::at(const Kernel& kernel, const VectorXd& parameters,
                                                 const AlignedMatrix& features,
                                                 const std::vector<Index>& rows) {
  InducingPoints points;
  const auto r = static_cast<Index>(rows.size());
  points.size_ = r;
  points.features_ = gathered(features, rows);
  const FeatureBlock own = all_of(points.features_, r);
  points.root_ = {padded_rows(r), padded_rows(r)};
  AlignedMatrix work(numerics().work_size(r), 1);
  kernel.tile(parameters, own, own, points.root_.data(), points.root_.rows());
  double log_det = 0;
  for (Index j = r; j < points.root_.cols(); ++j) points.root_.map().col(j).setZero();
  points.root_.map().bottomRows(points.root_.rows() - r).setZero();
  if (!numerics().inverse_root(r, 0, points.root_.data(), points.root_.rows(), work.data(),
                               &log_det))
    return std::nullopt;
  points.root_.map().triangularView<Eigen::StrictlyUpper>().setZero();
  points.root_.map().bottomRows(points.root_.rows() - r).setZero();
  points.normal_ = {padded_rows(r + 1), padded_rows(r + 1)};
  points.normal_.map().diagonal().head(r).setOnes();
  points.moment_ = VectorXd::Zero(r);
  return points;
}

AlignedMatrix InducingPoints::basis(const Kernel& kernel, const VectorXd& parameters,
                                    const FeatureBlock& block) const {
  AlignedMatrix covariance(padded_rows(block.rows), padded_rows(size_));
  kernel.tile(parameters, block, all_of(features_, size_), covariance.data(), covariance.rows());
  AlignedMatrix phi(padded_rows(size_), padded_rows(block.rows));
  AlignedMatrix work(numerics().multiply_work_size(size_, block.rows), 1);
  numerics().multiply_transposed(size_, block.rows, size_, 1.0, root_.data(), root_.rows(),
                                 covariance.data(), covariance.rows(), false, phi.data(),
                                 phi.rows(), work.data());
  return phi;
}

void InducingPoints::learn(const Kernel& kernel, const VectorXd& parameters,
                           const FeatureBlock& block, const VectorXd& noise, const VectorXd& y) {
  AlignedMatrix phi = basis(kernel, parameters, block);
  phi.map().rightCols(phi.cols() - block.rows).setZero();
  for (Index i = 0; i < block.rows; ++i) {
    phi.map().col(i) /= std::sqrt(noise[i]);
    moment_ += phi.map().col(i).head(size_) * (y[i] / std::sqrt(noise[i]));
    square_ += y[i] * y[i] / noise[i];
  }
  AlignedMatrix work(numerics().multiply_work_size(size_, size_), 1);
  numerics().multiply_transposed(size_, size_, block.rows, 1.0, phi.data(), phi.rows(), phi.data(),
                                 phi.rows(), true, normal_.data(), normal_.rows(), work.data());
}

std::optional<InducingPoints::Posterior> InducingPoints::posterior() const {
  const Index r = size_;
  Posterior posterior;
  posterior.inverse = {normal_.rows(), normal_.cols()};
  posterior.inverse.map() = normal_.map();
  posterior.inverse.map().row(r).head(r) = moment_.transpose();
  AlignedMatrix work(numerics().work_size(r + 1), 1);
  if (!numerics().sweep(r, 1, posterior.inverse.data(), posterior.inverse.rows(), work.data(),
                        &posterior.log_det))
    return std::nullopt;
  posterior.response = posterior.inverse.map().row(r).head(r).transpose();
  posterior.quadratic = square_ - moment_.dot(posterior.response);
  const auto w = root_.map().topLeftCorner(r, r).triangularView<Eigen::Lower>();
  posterior.weights = w.transpose() * posterior.response;

  // I - B⁻¹ = SᵀS with S lower triangular is a Cholesky factor from the last row upwards; then G =
  // S W.
  MatrixXd known = posterior.inverse.map().topLeftCorner(r, r).selfadjointView<Eigen::Lower>();
  known.diagonal().array() += 1.0;
  const Eigen::LLT<MatrixXd> factor(known.reverse());
  if (factor.info() != Eigen::Success) return std::nullopt;
  AlignedMatrix s(padded_rows(r), r);
  s.map().topRows(r) = MatrixXd(factor.matrixL()).reverse().transpose();
  AlignedMatrix w_transposed(padded_rows(r), r);
  w_transposed.map().topRows(r) = root_.map().topLeftCorner(r, r).transpose();
  AlignedMatrix root(padded_rows(r), padded_rows(r));
  AlignedMatrix multiply_work(numerics().multiply_work_size(r, r), 1);
  numerics().multiply_transposed(r, r, r, 1.0, s.data(), s.rows(), w_transposed.data(),
                                 w_transposed.rows(), true, root.data(), root.rows(),
                                 multiply_work.data());
  posterior.variance =
      VarianceTable(std::make_shared<AlignedMatrix>(features_.copy()), r, std::move(root));
  return posterior;
}

}  // namespace trammel
