#include "server/bias/process/gaussian_process.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "server/base/check.h"
#include "server/bias/process/inducing_points.h"
#include "server/numerics/numerics.h"
#include "server/numerics/seeded_random.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kSmallestSignal =
    1e-9;  // m; keeps log σ_f finite for an output that is exactly zero
constexpr double kLeastLogRatio =
    -20.0;  // of η: with less noise thousands of smooth points are not positive definite

// The compressed variance.
constexpr double kUnexplained =
    1e-3;  // of the noise variance, at any training point: far too small to matter
constexpr double kMostKept = 0.75;        // of the points: with more, little time would be saved
constexpr Index kMostKeptPoints = 2000;   // finding them takes time with the square of their number
constexpr Index kFewestToCompress = 200;  // below that the exact variance is fast enough

// The variance that is served.
constexpr Index kMostServedPoints =
    400;                           // with more, all points in single precision are nearly as fast
constexpr double kFewTell = 0.02;  // of the variance: the part that few points may leave out
constexpr Index kLeftOutPoints = 128;  // left-out points at which near points are tested
constexpr Index kAsked = 64;  // joint vectors between the points, for the test of few points
// Allowance by which few points may be too small between the tested places. Measured: 0.2 % of a
// standard deviation, and 1e-5 of the noise variance.
constexpr double kFewSlack = 1.004;
constexpr double kFewSlackOfNoise = 1e-4;
// A share of the smallest noise's root: five standard deviations of 2 tᵀδ, where δ is the error of
// t by rounding to single precision (6e-8).
constexpr double kRounded = 3.5e-7;
constexpr double kMostRounding = 1e-3;  // of the variance of a measurement

bool is_served(VarianceForm form) {
  return form == VarianceForm::kServed || form == VarianceForm::kServedAsPart ||
         form == VarianceForm::kLearned;
}

// Joint vectors as they may be asked for: on the way from a training pose to another, and anywhere
// in their range.
MatrixXd asked_for(const MatrixXd& q) {
  SeededRandom random(1);
  const auto any = [&] {
    return static_cast<Index>(random.next() % static_cast<std::uint64_t>(q.rows()));
  };
  const Eigen::RowVectorXd low = q.colwise().minCoeff();
  const Eigen::RowVectorXd high = q.colwise().maxCoeff();
  MatrixXd asked(kAsked, q.cols());
  for (Index i = 0; i < kAsked; ++i) {
    if (i % 2 == 0) {
      const Index from = any();
      asked.row(i) = q.row(from) + random.uniform(0, 1) * (q.row(any()) - q.row(from));
    } else {
      for (Index j = 0; j < q.cols(); ++j) asked(i, j) = random.uniform(low[j], high[j]);
    }
  }
  return asked;
}

// [R + η diag(w), Yᵀ; Y, 0], lower triangle, padding zero.
void assemble_augmented(const Kernel& kernel, const VectorXd& parameters,
                        const AlignedMatrix& features, double ratio, const VectorXd& noise_shape,
                        const MatrixXd& y, AlignedMatrix* matrix) {
  const Index n = noise_shape.size();
  const Index ld = matrix->rows();
  for (Index j = 0; j < n; j += kTile) {
    const Index cols = std::min(kTile, n - j);
    for (Index i = j; i < n; i += 4 * kTile) {
      kernel.tile(parameters, rows_of(features, i, std::min(4 * kTile, n - i)),
                  rows_of(features, j, cols), matrix->data() + i + j * ld, ld);
    }
  }
  for (Index j = 0; j < n; ++j) {
    (*matrix)(j, j) += ratio * noise_shape[j];
    matrix->map().col(j).segment(n, y.cols()) = y.row(j);
    matrix->map().col(j).tail(ld - n - y.cols()).setZero();
  }
  matrix->map().rightCols(matrix->cols() - n).setZero();
}

AlignedMatrix augmented_storage(Index n, Index outputs) { return factor_storage(n + outputs); }

AlignedMatrix feature_table(const Kernel& kernel, const MatrixXd& q) {
  return {padded_rows(q.rows()), kernel.feature_count(q.cols())};
}

// Targets need no padding: they are the second argument of a kernel.
MatrixXd target_features(const Kernel& kernel, const VectorXd& parameters, const MatrixXd& q) {
  MatrixXd table(q.rows(), kernel.feature_count(q.cols()));
  kernel.features(parameters, q, table.data(), table.rows());
  return table;
}

}  // namespace

ProfiledLikelihood::ProfiledLikelihood(std::shared_ptr<const Kernel> kernel, GpData data,
                                       GpPrior prior)
    : kernel_(std::move(kernel)),
      data_(std::move(data)),
      prior_(std::move(prior)),
      poses_(pose_groups(data_.q)) {
  TRAMMEL_CHECK(data_.y.rows() == size() && data_.noise_shape.size() == size());
  matrix_ = augmented_storage(size(), data_.y.cols());
  features_ = feature_table(*kernel_, data_.q);
  alpha_ = {padded_rows(size()), data_.y.cols()};
  work_ = {numerics().work_size(size() + data_.y.cols()), 1};
}

bool ProfiledLikelihood::evaluate(const VectorXd& parameters, ObjectiveValue* out) {
  const Index n = size();
  const Index outputs = data_.y.cols();
  const Index count = parameters.size() - 1;
  if (!parameters.allFinite() || parameters.cwiseAbs().maxCoeff() > kMostLogParameter) return false;
  if (parameters[count] < kLeastLogRatio) return false;
  const double log_ratio = parameters[count];
  const double ratio = std::exp(log_ratio);

  const VectorXd kernel_parameters = parameters.head(count);
  kernel_->features(kernel_parameters, data_.q, features_.data(), features_.rows());
  assemble_augmented(*kernel_, kernel_parameters, features_, ratio, data_.noise_shape, data_.y,
                     &matrix_);
  double log_det = 0;
  if (!numerics().sweep(n, outputs, matrix_.data(), matrix_.rows(), work_.data(), &log_det))
    return false;

  alpha_.map().topRows(n) = matrix_.map().block(n, 0, outputs, n).transpose();
  const auto points = static_cast<double>(n);
  signal_variance_.resize(outputs);
  VectorXd weights(outputs);
  out->value = 0.5 * static_cast<double>(outputs) * log_det;
  double noise_slope = 0;  // of the noise prior, along log η at fixed σ_f²
  for (Index d = 0; d < outputs; ++d) {
    const double quadratic = data_.y.col(d).dot(alpha_.map().col(d).head(n));
    const double variance = std::max(quadratic, 0.0) / points + kSmallestSignal * kSmallestSignal;
    signal_variance_[d] = variance;
    out->value += 0.5 * points * (std::log(variance) + 1.0 + kLogTwoPi);
    // The prior of the noise is one of log σ_n = ½ (log η + log σ_f²), and σ_f² depends on the
    // parameters, too.
    const double below =
        std::min(0.5 * (log_ratio + std::log(variance)) - std::log(prior_.noise_stddev), 0.0);
    out->value += 0.5 * std::pow(below / prior_.noise_spread, 2);
    const double slope = below / (prior_.noise_spread * prior_.noise_spread);
    noise_slope += 0.5 * slope;
    weights[d] = (1.0 + slope / points) / variance;
  }

  out->gradient = contract(kernel_parameters, ratio, weights);
  out->gradient[count] += noise_slope;
  for (Index p = 0; p <= count; ++p) {
    const double centre = p < count ? prior_.parameter_centre[p] : prior_.log_ratio_centre;
    const double spread = p < count ? prior_.parameter_spread : prior_.log_ratio_spread;
    const double away = (parameters[p] - centre) / spread;
    out->value += 0.5 * away * away;
    out->gradient[p] += away / spread;
  }
  return std::isfinite(out->value) && out->gradient.allFinite();
}

// ½ tr(G dM) with G = outputs M⁻¹ - Σ_d weight_d α_d α_dᵀ, from the lower triangle: off-diagonal
// elements count once, diagonal ones half.
VectorXd ProfiledLikelihood::contract(const VectorXd& parameters, double ratio,
                                      const VectorXd& output_weights) {
  const Index n = size();
  const Index ld = matrix_.rows();
  const auto outputs = static_cast<double>(data_.y.cols());
  VectorXd gradient = VectorXd::Zero(parameters.size() + 1);
  AlignedMatrix tile(kTile, kTile);
  Eigen::Map<MatrixXd> g = tile.map();
  VectorXd column_weights(output_weights.size());
  for (Index j = 0; j < n; j += kTile) {
    const Index cols = std::min(kTile, n - j);
    for (Index i = j; i < n; i += kTile) {
      const Index rows = std::min(kTile, n - i);
      for (Index c = 0; c < cols; ++c) {
        column_weights = output_weights.cwiseProduct(alpha_.map().row(j + c).transpose());
        numerics().weight_column(rows, -outputs, matrix_.data() + i + (j + c) * ld,
                                 column_weights.size(), alpha_.data() + i, alpha_.rows(),
                                 column_weights.data(), g.col(c).data());
        g.col(c).tail(kTile - rows).setZero();
        if (i > j) continue;
        g.col(c).head(c).setZero();
        g(c, c) *= 0.5;
        gradient[parameters.size()] += ratio * data_.noise_shape[j + c] * g(c, c);
      }
      kernel_->tile_gradient(parameters, rows_of(features_, i, rows), rows_of(features_, j, cols),
                             g.data(), kTile, gradient.data());
    }
  }
  return gradient;
}

double ProfiledLikelihood::leave_one_out_rms() const {
  double total = 0;
  for (const PoseGroup& pose : poses_) {
    if (pose.size() == 1) {
      const Index i = pose.front();
      total += alpha_.map().row(i).squaredNorm() / (matrix_(i, i) * matrix_(i, i));
      continue;
    }
    const MatrixXd block = -matrix_.map()(pose, pose);  // of M⁻¹, lower triangle
    const MatrixXd alpha = alpha_.map()(pose, Eigen::all);
    total += block.llt().solve(alpha).squaredNorm();
  }
  return std::sqrt(total / static_cast<double>(size()));
}

std::optional<GaussianProcess> GaussianProcess::condition(std::shared_ptr<const Kernel> kernel,
                                                          const MatrixXd& q, const VectorXd& y,
                                                          const VectorXd& noise_shape,
                                                          const GpHyperparameters& hyperparameters,
                                                          VarianceForm form) {
  const Index n = q.rows();
  GaussianProcess gp;
  gp.kernel_ = std::move(kernel);
  gp.parameters_ = hyperparameters.kernel;
  gp.size_ = n;
  gp.features_ = std::make_shared<AlignedMatrix>(feature_table(*gp.kernel_, q));
  gp.kernel_->features(gp.parameters_, q, gp.features_->data(), gp.features_->rows());
  gp.signal_variance_ = std::exp(2.0 * hyperparameters.log_signal_stddev);
  gp.noise_variance_ = std::exp(2.0 * hyperparameters.log_noise_stddev);
  const double ratio = gp.noise_variance_ / gp.signal_variance_;
  gp.q_ = q;
  gp.y_ = y;
  gp.noise_ = ratio * noise_shape;

  AlignedMatrix matrix = augmented_storage(n, 1);
  AlignedMatrix work(numerics().work_size(n + 1), 1);
  assemble_augmented(*gp.kernel_, gp.parameters_, *gp.features_, ratio, noise_shape, y, &matrix);
  if (!numerics().inverse_root(n, 1, matrix.data(), matrix.rows(), work.data(), &gp.log_det_))
    return std::nullopt;

  gp.weights_ = {padded_rows(n), 1};
  gp.weights_.map().col(0).head(n) = -matrix.map().row(n).head(n).transpose();
  gp.inverse_diagonal_.resize(n);  // of M⁻¹ = L⁻ᵀ L⁻¹
  for (Index i = 0; i < n; ++i)
    gp.inverse_diagonal_[i] = matrix.map().col(i).segment(i, n - i).squaredNorm();
  gp.exact_ = VarianceTable(gp.features_, n, std::move(matrix));
  gp.finish(form);
  if (is_served(form)) gp.make_served(asked_for(q), form == VarianceForm::kServedAsPart);
  if (form != VarianceForm::kLearned && is_served(form) && (gp.near_ > 0 || gp.compressed_))
    gp.exact_ = {};
  return gp;
}

void GaussianProcess::finish(VarianceForm form) {
  const auto weights = weights_.map().col(0).head(size_);
  log_likelihood_ = -0.5 * (y_.dot(weights) / signal_variance_ + log_det_ +
                            static_cast<double>(size_) * (std::log(signal_variance_) + kLogTwoPi));
  VectorXd prior(size_);
  kernel_->diagonal(parameters_, rows_of(*features_, 0, size_), prior.data());
  leave_one_out_mean_ = y_ - weights.cwiseQuotient(inverse_diagonal_);
  left_out_variance_ = inverse_diagonal_.cwiseInverse();
  leave_poses_out();
  leave_one_out_share_ =
      (left_out_variance_ - noise_).cwiseQuotient(prior).cwiseMax(0.0).cwiseMin(1.0);
  if (form == VarianceForm::kCompressed || form == VarianceForm::kCompressedOnly)
    compress(kMostKeptPoints);
  if (form == VarianceForm::kCompressedOnly && compressed_) exact_ = {};
}

void GaussianProcess::leave_poses_out() {
  std::vector<PoseGroup> several = pose_groups(q_);
  std::erase_if(several, [](const PoseGroup& pose) { return pose.size() == 1; });
  if (several.empty()) return;
  const std::vector<double> root = root_rows(0);
  for (const PoseGroup& pose : several) {
    const auto count = static_cast<Index>(pose.size());
    MatrixXd block = MatrixXd::Zero(count, count);  // of M⁻¹ = Gᵀ G, G = L⁻¹
    VectorXd part = VectorXd::Zero(count);
    for (Index i = pose.front(); i < size_; ++i) {
      const double* row = root.data() + i * (i + 1) / 2;
      for (Index c = 0; c < count; ++c) {
        const Index point = pose[static_cast<std::size_t>(c)];
        part[c] = point <= i ? row[point] : 0.0;
      }
      block.selfadjointView<Eigen::Lower>().rankUpdate(part);
    }
    const MatrixXd left = block.llt().solve(MatrixXd::Identity(count, count));
    leave_one_out_mean_(pose) = y_(pose) - left * weights_.map().col(0)(pose);
    left_out_variance_(pose) = left.diagonal();
  }
}

std::vector<double> GaussianProcess::root_rows(Index more) const {
  if (exact_.size() == size_) return exact_.rows(more);
  AlignedMatrix matrix = augmented_storage(size_, 1);
  AlignedMatrix work(numerics().work_size(size_ + 1), 1);
  assemble_augmented(*kernel_, parameters_, *features_, 1.0, noise_, y_, &matrix);
  double log_det = 0;
  const bool positive =
      numerics().inverse_root(size_, 1, matrix.data(), matrix.rows(), work.data(), &log_det);
  TRAMMEL_CHECK(positive);  // it was positive definite before
  return VarianceTable(features_, size_, std::move(matrix)).rows(more);
}

void GaussianProcess::compress(Index at_most) {
  if (size_ < kFewestToCompress) return;
  const Index most = std::min(at_most, static_cast<Index>(kMostKept * static_cast<double>(size_)));
  const double tolerance = kUnexplained * noise_.minCoeff();
  const std::vector<Index> points =
      spanning_points(*kernel_, parameters_, *features_, size_, tolerance, most);
  if (static_cast<Index>(points.size()) == most) return;
  auto few = InducingPoints::at(*kernel_, parameters_, *features_, points);
  if (!few) return;
  const FeatureBlock all = rows_of(*features_, 0, size_);
  few->learn(*kernel_, parameters_, all, noise_, y_);
  auto posterior = few->posterior();
  if (!posterior) return;
  // Widened so that it is nowhere below the exact variance at the data, D - D² diag(M⁻¹).
  const VectorXd known = noise_ - noise_.cwiseAbs2().cwiseProduct(inverse_diagonal_);
  VectorXd share(size_);
  VectorXd prior(size_);
  posterior->variance.shares(*kernel_, parameters_, all, share.data(), prior.data());
  posterior->variance.widen(std::max(1.0, known.cwiseQuotient(share).maxCoeff()));
  compressed_ = std::move(posterior->variance);
}

NearPoints GaussianProcess::near_points(Index count) const {
  return {*kernel_, parameters_, *features_, noise_, count};
}

VectorXd GaussianProcess::at_most(const VectorXd& left, bool as_part) const {
  const double noise = noise_.mean();
  VectorXd most = (1 + kFewTell) * left;
  if (as_part) {
    most.array() += kFewTell * noise;
  } else {
    most += kFewTell * left.cwiseMin(noise);
  }
  return most;
}

bool GaussianProcess::near_is_enough(Index count, const VectorXd& most_of_points,
                                     const FeatureBlock& asked, const VectorXd& most) const {
  const NearPoints near = near_points(count);
  double prior = 0;
  for (Index i = 0; i < size_; i += (size_ + kLeftOutPoints - 1) / kLeftOutPoints) {
    const FeatureBlock point = rows_of(*features_, i, 1);
    kernel_->diagonal(parameters_, point, &prior);
    AlignedMatrix covariance = near.covariance_with(point);
    covariance(i, 0) = -std::numeric_limits<double>::infinity();
    if (near.left_of(covariance, prior) > most_of_points[i]) return false;
  }
  for (Index i = 0; i < asked.rows; ++i) {
    const FeatureBlock target = {asked.data + i, 1, asked.ld};
    kernel_->diagonal(parameters_, target, &prior);
    if (near.left_of(near.covariance_with(target), prior) > most[i]) return false;
  }
  return true;
}

void GaussianProcess::make_served(const MatrixXd& q, bool as_part) {
  if (size_ < kFewestToCompress) return;
  const MatrixXd targets = target_features(*kernel_, parameters_, q);
  const FeatureBlock asked = rows_of(targets, 0, q.rows());
  VectorXd left(q.rows());
  VectorXd prior(q.rows());
  exact_.shares(*kernel_, parameters_, asked, left.data(), prior.data());
  const VectorXd most = at_most(left, as_part);
  const VectorXd most_of_points = at_most(inverse_diagonal_.cwiseInverse() - noise_, as_part);
  for (const Index count : {NearPoints::kMost / 2, NearPoints::kMost}) {
    if (!near_is_enough(count, most_of_points, asked, most)) continue;
    near_ = count;
    return;
  }
  compress(kMostServedPoints);
  if (compressed_) {
    VectorXd few(q.rows());
    compressed_->shares(*kernel_, parameters_, asked, few.data(), prior.data());
    const double factor = kFewSlack * std::max(1.0, left.cwiseQuotient(few).maxCoeff());
    const double more = kFewSlackOfNoise * noise_.minCoeff();
    if ((factor * few.array() + more <= at_most(left, true).array()).all()) {
      compressed_->widen(factor, more);
      return;
    }
    compressed_.reset();
  }
  const double rounding = kRounded * prior.maxCoeff() / std::sqrt(noise_.minCoeff());
  if (rounding <= kMostRounding * (left.minCoeff() + noise_.mean()))
    compressed_ = exact_.in_single_precision(rounding);
}

void GaussianProcess::mean(const MatrixXd& q, double* out) const {
  const MatrixXd targets = target_features(*kernel_, parameters_, q);
  kernel_->weighted_sum(parameters_, rows_of(*features_, 0, size_), rows_of(targets, 0, q.rows()),
                        weights_.data(), out);
}

std::vector<PosteriorVariance> GaussianProcess::variance(const MatrixXd& q,
                                                         std::vector<NearWeights>* near,
                                                         double* mean) const {
  const MatrixXd targets = target_features(*kernel_, parameters_, q);
  VectorXd posterior(q.rows());
  VectorXd prior(q.rows());
  const FeatureBlock asked = rows_of(targets, 0, q.rows());
  if (near != nullptr) near->resize(near_ > 0 ? static_cast<std::size_t>(q.rows()) : 0);
  if (near_ > 0) {
    kernel_->diagonal(parameters_, asked, prior.data());
    const NearPoints points = near_points(near_);
    for (Index i = 0; i < q.rows(); ++i) {
      NearWeights* weights = near == nullptr ? nullptr : &(*near)[static_cast<std::size_t>(i)];
      const AlignedMatrix covariance = points.covariance_with(rows_of(targets, i, 1));
      posterior[i] = points.left_of(covariance, prior[i], weights);
      // Fused: a product of its own would be denormal for far points, and slow.
      if (mean != nullptr)
        numerics().transposed_product(size_, 1, covariance.data(), size_, 1, weights_.data(), size_,
                                      mean + i, 1);
    }
  } else {
    if (mean != nullptr) this->mean(q, mean);
    const VarianceTable& table = compressed_ ? *compressed_ : exact_;
    table.shares(*kernel_, parameters_, asked, posterior.data(), prior.data());
  }
  std::vector<PosteriorVariance> variances(static_cast<std::size_t>(q.rows()));
  for (Index i = 0; i < q.rows(); ++i)
    variances[static_cast<std::size_t>(i)] = {signal_variance_ * posterior[i],
                                              signal_variance_ * prior[i]};
  return variances;
}

}  // namespace trammel
