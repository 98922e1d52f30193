#include <algorithm>
#include <cmath>
#include <utility>

#include "server/base/check.h"
#include "server/bias/process/gaussian_process.h"
#include "server/numerics/inverse_root.h"
#include "server/numerics/numerics.h"

namespace trammel {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

GaussianProcess GaussianProcess::like(Index size) const {
  GaussianProcess gp;
  gp.kernel_ = kernel_;
  gp.parameters_ = parameters_;
  gp.signal_variance_ = signal_variance_;
  gp.noise_variance_ = noise_variance_;
  gp.log_det_ = log_det_;
  gp.size_ = size;
  gp.features_ = std::make_shared<AlignedMatrix>(padded_rows(size), features_->cols());
  gp.weights_ = {padded_rows(size), 1};
  gp.y_.resize(size);
  gp.noise_.resize(size);
  gp.inverse_diagonal_ = VectorXd::Zero(size);
  return gp;
}

std::optional<GaussianProcess> GaussianProcess::with(const MatrixXd& q, const VectorXd& y,
                                                     const VectorXd& noise_shape,
                                                     VarianceForm form) const {
  TRAMMEL_CHECK(y.size() == q.rows() && noise_shape.size() == q.rows());
  const Index size = size_ + q.rows();
  GaussianProcess gp = like(size);
  gp.features_->map().topRows(size_) = features_->map().topRows(size_);
  kernel_->features(parameters_, q, gp.features_->data() + size_, gp.features_->rows());
  gp.q_.resize(size, q.cols());
  gp.q_ << q_, q;
  gp.y_ << y_, y;
  gp.noise_ << noise_, noise_variance_ / signal_variance_ * noise_shape;
  gp.weights_.map().topRows(size_) = weights_.map().topRows(size_);
  gp.inverse_diagonal_.head(size_) = inverse_diagonal_;

  InverseRoot root(root_rows(q.rows()), size_);
  AlignedMatrix covariance(gp.features_->rows(), 1);
  for (Index i = size_; i < size; ++i) {
    const FeatureBlock before = {gp.features_->data(), i, gp.features_->rows()};
    const FeatureBlock fresh = {gp.features_->data() + i, 1, gp.features_->rows()};
    double variance = 0;
    kernel_->diagonal(parameters_, fresh, &variance);
    kernel_->tile(parameters_, before, fresh, covariance.data(), covariance.rows());
    const auto row = root.append(covariance.map().col(0).head(i), variance + gp.noise_[i]);
    if (!row) return std::nullopt;
    gp.weights_.map().col(0).head(i + 1) += *row * row->dot(gp.y_.head(i + 1));
    gp.inverse_diagonal_.head(i + 1) += row->cwiseAbs2();
    gp.log_det_ -= 2.0 * std::log((*row)[i]);
  }
  gp.exact_ = VarianceTable(gp.features_, size, root.rows());
  gp.finish(form);
  return gp;
}

// (M⁻¹)_pp⁻¹ (M⁻¹ y)_p with M⁻¹ = Gᵀ G, G = L⁻¹: Rasmussen & Williams, eqs. 5.10-5.12, for several
// points at once.
VectorXd GaussianProcess::left_out_error(const VectorXd& y,
                                         const std::vector<Index>& points) const {
  TRAMMEL_CHECK(y.size() == size_);
  const std::vector<double> rows = root_rows(0);
  const auto count = static_cast<Index>(points.size());
  MatrixXd columns = MatrixXd::Zero(size_, count);
  VectorXd whitened(size_);
  for (Index i = 0; i < size_; ++i) {
    const Eigen::Map<const VectorXd> row(rows.data() + i * (i + 1) / 2, i + 1);
    whitened[i] = row.dot(y.head(i + 1));
    for (Index c = 0; c < count; ++c) {
      const Index point = points[static_cast<std::size_t>(c)];
      if (point <= i) columns(i, c) = row[point];
    }
  }
  MatrixXd inverse = MatrixXd::Zero(count, count);
  inverse.selfadjointView<Eigen::Lower>().rankUpdate(columns.transpose());
  return Eigen::LLT<MatrixXd>(inverse).solve(columns.transpose() * whitened);
}

GaussianProcess GaussianProcess::without(const std::vector<Index>& points,
                                         VarianceForm form) const {
  InverseRoot root(root_rows(0), size_);
  VectorXd weights = weights_.map().col(0).head(size_);
  VectorXd inverse_diagonal = inverse_diagonal_;
  std::vector<Index> kept(static_cast<std::size_t>(size_));
  for (Index i = 0; i < size_; ++i) kept[static_cast<std::size_t>(i)] = i;
  double log_det = log_det_;
  // The last one first: the indices of the others stay valid.
  for (auto point = points.rbegin(); point != points.rend(); ++point) {
    TRAMMEL_CHECK(*point >= 0 && *point < static_cast<Index>(kept.size()));
    const VectorXd gone = root.remove(*point);
    weights -= gone * (weights[*point] / gone[*point]);
    inverse_diagonal -= gone.cwiseAbs2();
    log_det += 2.0 * std::log(gone[*point]);
    kept.erase(kept.begin() + *point);
    const Index left = root.size();
    for (VectorXd* values : {&weights, &inverse_diagonal}) {
      std::copy(values->begin() + *point + 1, values->end(), values->begin() + *point);
      values->conservativeResize(left);
    }
  }
  const Index size = root.size();
  GaussianProcess gp = like(size);
  gp.features_->map().topRows(size) = features_->map()(kept, Eigen::all);
  gp.q_ = q_(kept, Eigen::all);
  gp.y_ = y_(kept);
  gp.noise_ = noise_(kept);
  gp.weights_.map().col(0).head(size) = weights;
  gp.inverse_diagonal_ = inverse_diagonal;
  gp.log_det_ = log_det;
  gp.exact_ = VarianceTable(gp.features_, size, root.rows());
  gp.finish(form);
  return gp;
}

}  // namespace trammel
