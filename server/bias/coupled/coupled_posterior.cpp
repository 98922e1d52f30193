#include "server/bias/coupled/coupled_posterior.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/base/check.h"
#include "server/bias/process/inducing_points.h"
#include "server/measurement/pose_groups.h"
#include "server/numerics/numerics.h"
#include "server/numerics/seeded_random.h"

namespace trammel {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr Index kRun =
    10;  // consecutive poses that are left out together, since they share a drift
constexpr Index kThreefold = 3;  // parts of the cross-validation: two thirds still tell the weights
constexpr Index kTargets = 64;  // targets at once: the matrices pass through the cache once for all
                                // of them

// δ: the covariances that are left out; σ²: the least noise variance. |Δ kᵀM⁻¹k| <= 2 σ_f |δ|/σ +
// |δ|²/σ², and the standard deviations of R A⁻¹ Rᵀ change by |δ|/σ at most. With |δ| = kPassedOver
// σ³/σ_f both stay below the noise.
constexpr double kPassedOver = 1e-3;
constexpr Index kWorthPassing = 8;  // leaving poses out pays if at most one in so many matters

// A share of the noise variance. Few points may leave at most this share of any pose unexplained.
// Their error in the columns then changes a posterior variance by less than this share, too.
constexpr double kUnexplained = 1e-4;
constexpr Index kWorthFew = 3;  // few points pay if they are less than one in so many

// Joint vectors between the poses at which R from near points is tested. The resulting variance may
// be below and above that from all poses by these shares of the variance of a measurement.
constexpr Index kTried = 64;
constexpr double kNearTooSmall = 0.005;
constexpr double kNearTooLarge = 0.02;

AlignedMatrix packed_inverse_root(const MatrixXd& A) {
  const Index p = A.rows();
  const Numerics& n = numerics();
  AlignedMatrix packed(n.packed_size(p), 1);
  if (p == 0) return packed;
  AlignedMatrix matrix = factor_storage(p);
  matrix.map().topLeftCorner(p, p).triangularView<Eigen::Lower>() = A;
  AlignedMatrix work(n.work_size(p), 1);
  double log_det = 0;
  const bool positive = n.inverse_root(p, 0, matrix.data(), matrix.rows(), work.data(), &log_det);
  TRAMMEL_CHECK(positive);
  for (Index first = 0; first < p; first += n.packed_rows)
    n.pack_lower(p, first, matrix.data(), matrix.rows(), packed.data() + n.packed_size(first));
  return packed;
}

/// Lower triangle of -`matrix`, row after row.
template <typename Matrix>
std::vector<double> minus_triangle(const Matrix& matrix, Index n) {
  std::vector<double> rows;
  rows.reserve(static_cast<std::size_t>(n * (n + 1) / 2));
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j <= i; ++j) rows.push_back(-matrix(i, j));
  }
  return rows;
}

/// kᵀ M⁻¹ k where only the rows `near` (rising) of k are not 0.
double quadratic(const std::vector<double>& triangle, const std::vector<Index>& near,
                 const double* k) {
  double sum = 0;
  for (std::size_t a = 0; a < near.size(); ++a) {
    const double* row = triangle.data() + near[a] * (near[a] + 1) / 2;
    double off = 0;
    for (std::size_t b = 0; b < a; ++b) off += row[near[b]] * k[near[b]];
    sum += k[near[a]] * (2 * off + row[near[a]] * k[near[a]]);
  }
  return sum;
}

}  // namespace

std::optional<CoupledPosterior> CoupledPosterior::condition(std::shared_ptr<const Kernel> kernel,
                                                            const LinearBlocks& blocks,
                                                            const CoupledData& data,
                                                            const CoupledHyperparameters& at,
                                                            VarianceForm form) {
  std::optional<CoupledSolution> solution = solve(*kernel, blocks, data, at);
  if (!solution) return std::nullopt;
  const Index n = data.q.rows();
  const Index p = blocks.column_count();
  CoupledPosterior posterior;
  posterior.points_ = n;
  posterior.hyperparameters_ = at.outputs;
  for (const AlignedMatrix& matrix : solution->eliminated) {
    posterior.explained_.emplace_back(matrix.map().block(n + 1, 0, p, n));
  }
  posterior.leave_out(*solution, data);
  posterior.column_scale_ = solution->column_scale;
  posterior.prior_.resize(n, data.y.cols());
  posterior.weights_ = solution->weights.cwiseProduct(solution->column_scale);
  posterior.log_likelihood_ = solution->log_likelihood;
  for (Index d = 0; d < data.y.cols(); ++d) {
    const auto output = static_cast<std::size_t>(d);
    const VectorXd own = data.y.col(d) - data.columns[output] * posterior.weights_;
    const bool is_served = form == VarianceForm::kServed || form == VarianceForm::kLearned;
    const VarianceForm kept = is_served                           ? VarianceForm::kServedAsPart
                              : form == VarianceForm::kCompressed ? VarianceForm::kCompressedOnly
                                                                  : form;
    auto process =
        GaussianProcess::condition(kernel, data.q, own, data.noise_shape, at.outputs[output], kept);
    if (!process) return std::nullopt;
    posterior.outputs_.push_back(std::move(*process));
    VectorXd prior(n);
    kernel->diagonal(at.outputs[output].kernel,
                     {solution->features[output].data(), n, solution->features[output].rows()},
                     prior.data());
    posterior.prior_.col(d) = std::exp(2 * at.outputs[output].log_signal_stddev) * prior;
    posterior.prior_.col(d).noalias() +=
        data.columns[output].cwiseAbs2() * posterior.column_scale_.cwiseAbs2();
    posterior.inverse_.emplace_back();
    const bool smooth = posterior.outputs_.back().variance_points() < n;
    if (kept == VarianceForm::kCompressedOnly && !smooth)
      posterior.inverse_.back() = minus_triangle(solution->eliminated[output].map(), n);
    const double noise =
        std::exp(at.outputs[output].log_noise_stddev) * std::sqrt(data.noise_shape.minCoeff());
    const double signal = std::exp(at.outputs[output].log_signal_stddev);
    posterior.passed_over_.push_back(kPassedOver * std::pow(noise, 3) / signal);
  }
  posterior.kernel_ = std::move(kernel);
  posterior.packed_root_ = packed_inverse_root(solution->A);
  posterior.features_ = std::move(solution->features);
  posterior.few_.resize(posterior.outputs_.size());
  posterior.rows_.resize(posterior.outputs_.size());
  if (form == VarianceForm::kServed || form == VarianceForm::kLearned) {
    for (std::size_t d = 0; d < posterior.outputs_.size(); ++d) {
      posterior.explain_by_near(d, data, *solution);
      if (posterior.rows_[d].rows() == 0) posterior.explain_by_few(d, data.noise_shape);
    }
  }
  return posterior;
}

// The columns of a joint vector between two poses are interpolated from those of the poses. The
// part of kᵀ M⁻¹ H that near points miss does not depend on them.
void CoupledPosterior::explain_by_near(std::size_t output, const CoupledData& data,
                                       const CoupledSolution& solution) {
  if (!outputs_[output].is_near_enough()) return;
  const MatrixXd& H = data.columns[output];
  SeededRandom random(1);
  const auto any = [&] {
    return static_cast<Index>(random.next() % static_cast<std::uint64_t>(points_));
  };
  MatrixXd q(kTried, data.q.cols()), columns(kTried, H.cols());
  for (Index i = 0; i < kTried; ++i) {
    const Index a = any(), b = any();
    q.row(i) = 0.5 * (data.q.row(a) + data.q.row(b));
    columns.row(i) = 0.5 * (H.row(a) + H.row(b));
  }
  const auto d = static_cast<Index>(output);
  const auto variance_of = [&](const Part& part) -> VectorXd {
    return part.known + solution.root.matrixL().solve(part.R).colwise().squaredNorm().transpose();
  };
  const VectorXd of_all = variance_of(part_of(q, columns, d));
  rows_[output] = (H * column_scale_.asDiagonal()).eval().sparseView();
  const VectorXd more = variance_of(near_part_of(q, columns, d)) - of_all;
  const Eigen::ArrayXd measured =
      of_all.array() + outputs_[output].noise_variance() * data.noise_shape.mean();
  const bool enough =
      (more.array() >= -kNearTooSmall * measured && more.array() <= kNearTooLarge * measured).all();
  if (enough) {
    explained_[output].resize(0, 0);
  } else {
    rows_[output].resize(0, 0);
  }
}

Index CoupledPosterior::outputs_from_near_points() const {
  return std::count_if(rows_.begin(), rows_.end(),
                       [](const auto& rows) { return rows.rows() > 0; });
}

// With R_xx ≈ R_xu R_uu⁻¹ R_ux.
void CoupledPosterior::explain_by_few(std::size_t output, const VectorXd& noise) {
  const GpHyperparameters& at = hyperparameters_[output];
  const double ratio = std::exp(2 * (at.log_noise_stddev - at.log_signal_stddev));
  const Index most = points_ / kWorthFew;
  const std::vector<Index> points = spanning_points(*kernel_, at.kernel, features_[output], points_,
                                                    kUnexplained * ratio * noise.minCoeff(), most);
  if (static_cast<Index>(points.size()) == most) return;
  const auto few = InducingPoints::at(*kernel_, at.kernel, features_[output], points);
  if (!few) return;
  const Index r = few->size();
  const AlignedMatrix basis =
      few->basis(*kernel_, at.kernel, rows_of(features_[output], 0, points_));
  const MatrixXd by_basis = explained_[output] * basis.map().topLeftCorner(r, points_).transpose();
  explained_[output] = by_basis * few->root().map().topLeftCorner(r, r);
  few_[output] = {few->features().copy(), r};
}

// B: the rows and columns of C⁻¹ that belong to the left-out poses. Their covariance is B⁻¹, their
// error B⁻¹ α.
void CoupledPosterior::leave_out(const CoupledSolution& solution, const CoupledData& data) {
  const Index outputs = data.y.cols();
  leave_one_out_mean_.resize(points_, outputs);
  leave_one_out_variance_.resize(points_, outputs);
  std::vector<MatrixXd> halves;  // L⁻¹ Hᵀ M⁻¹
  for (const MatrixXd& explained : explained_)
    halves.emplace_back(solution.root.matrixL().solve(explained));
  // Errors and their variances, output by output.
  const auto left_out = [&](const std::vector<Index>& poses) {
    const auto count = static_cast<Index>(poses.size());
    MatrixXd stacked(solution.A.rows(), outputs * count);
    VectorXd alpha(outputs * count);
    for (Index d = 0; d < outputs; ++d) {
      stacked.middleCols(d * count, count) = halves[static_cast<std::size_t>(d)](Eigen::all, poses);
      alpha.segment(d * count, count) = solution.alpha.col(d)(poses);
    }
    MatrixXd B = MatrixXd::Zero(outputs * count, outputs * count);
    B.selfadjointView<Eigen::Lower>().rankUpdate(stacked.transpose(), -1.0);
    for (Index d = 0; d < outputs; ++d) {
      B.block(d * count, d * count, count, count).triangularView<Eigen::Lower>() -=
          solution.eliminated[static_cast<std::size_t>(d)].map()(poses, poses);
    }
    const Index size = B.rows();
    AlignedMatrix matrix = factor_storage(size + 1);
    matrix.map().topLeftCorner(size, size).triangularView<Eigen::Lower>() = B;
    matrix.map().row(size).head(size) = alpha.transpose();
    AlignedMatrix work(numerics().work_size(size + 1), 1);
    double log_det = 0;
    const bool positive =
        numerics().inverse_root(size, 1, matrix.data(), matrix.rows(), work.data(), &log_det);
    TRAMMEL_CHECK(positive);
    VectorXd variance(size);
    for (Index i = 0; i < size; ++i)
      variance[i] = matrix.map().col(i).segment(i, size - i).squaredNorm();
    return std::pair<VectorXd, VectorXd>(-matrix.map().row(size).head(size).transpose(), variance);
  };
  for (const PoseGroup& pose : pose_groups(data.q)) {
    const auto count = static_cast<Index>(pose.size());
    const auto [error, variance] = left_out(pose);
    leave_one_out_mean_(pose, Eigen::all) =
        data.y(pose, Eigen::all) - error.reshaped(count, outputs);
    leave_one_out_variance_(pose, Eigen::all) = variance.reshaped(count, outputs);
  }
  double surprise = 0;
  for (Index fold = 0; fold < kThreefold; ++fold) {
    std::vector<Index> poses;
    for (Index i = 0; i < points_; ++i) {
      if (i / kRun % kThreefold == fold) poses.push_back(i);
    }
    if (poses.empty()) break;
    const auto [error, variance] = left_out(poses);
    surprise += error.cwiseAbs2().cwiseQuotient(variance).sum();
  }
  surprise_ = surprise / static_cast<double>(points_ * outputs);
}

MatrixXd CoupledPosterior::own_mean(const MatrixXd& q) const {
  MatrixXd mean(q.rows(), static_cast<Index>(outputs_.size()));
  for (Index d = 0; d < mean.cols(); ++d)
    outputs_[static_cast<std::size_t>(d)].mean(q, mean.col(d).data());
  return mean;
}

std::vector<CoupledPrediction> CoupledPosterior::predict(
    const MatrixXd& q, const std::vector<MatrixXd>& columns) const {
  std::vector<CoupledPrediction> predictions;
  for (Index first = 0; first < q.rows(); first += kTargets) {
    const Index count = std::min(kTargets, q.rows() - first);
    std::vector<MatrixXd> few;
    for (const MatrixXd& all : columns) few.emplace_back(all.middleRows(first, count));
    predict_few(q.middleRows(first, count), few, &predictions);
  }
  return predictions;
}

void CoupledPosterior::predict_few(const MatrixXd& q, const std::vector<MatrixXd>& columns,
                                   std::vector<CoupledPrediction>* out) const {
  const auto outputs = static_cast<Index>(columns.size());
  const MatrixXd own = own_mean(q);
  MatrixXd means = own;
  std::vector<Part> parts;
  for (Index d = 0; d < outputs; ++d) {
    const MatrixXd& H = columns[static_cast<std::size_t>(d)];
    for (Index i = 0; i < q.rows(); ++i) means(i, d) += H.row(i).dot(weights_);
    parts.push_back(part_of(q, H, d));
  }
  for (Index i = 0; i < q.rows(); ++i) {
    CoupledPrediction at{means.row(i).transpose(), own.row(i).transpose(),
                         shared_covariance(parts, i), VectorXd(outputs)};
    for (Index d = 0; d < outputs; ++d) {
      const Part& part = parts[static_cast<std::size_t>(d)];
      at.covariance(d, d) += part.known[i];
      at.prior[d] = part.prior[i];
    }
    out->push_back(std::move(at));
  }
}

CoupledPosterior::Part CoupledPosterior::near_part_of(const MatrixXd& q, const MatrixXd& columns,
                                                      Index d) const {
  const auto output = static_cast<std::size_t>(d);
  Part part{column_scale_.asDiagonal() * columns.transpose(), VectorXd(q.rows()),
            VectorXd(q.rows())};
  std::vector<NearWeights> near;
  const std::vector<PosteriorVariance> own = outputs_[output].variance(q, &near);
  for (Index i = 0; i < q.rows(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    part.known[i] = own[at].posterior;
    part.prior[i] = own[at].prior + part.R.col(i).squaredNorm();
    for (std::size_t a = 0; a < near[at].points.size(); ++a)
      part.R.col(i) -= near[at].weights[static_cast<Index>(a)] *
                       rows_[output].row(near[at].points[a]).transpose();
  }
  return part;
}

CoupledPosterior::Part CoupledPosterior::part_of(const MatrixXd& q, const MatrixXd& columns,
                                                 Index d) const {
  const auto output = static_cast<std::size_t>(d);
  if (rows_[output].rows() > 0) return near_part_of(q, columns, d);
  const GpHyperparameters& at = hyperparameters_[output];
  const double signal = std::exp(2 * at.log_signal_stddev);
  MatrixXd targets(q.rows(), kernel_->feature_count(q.cols()));
  kernel_->features(at.kernel, q, targets.data(), q.rows());
  const AlignedMatrix& known_of = few_[output] ? few_[output]->features : features_[output];
  const Index points = few_[output] ? few_[output]->size : points_;
  AlignedMatrix cross(padded_rows(points), q.rows());
  kernel_->tile(at.kernel, rows_of(known_of, 0, points), {targets.data(), q.rows(), q.rows()},
                cross.data(), cross.rows());
  Part part{column_scale_.asDiagonal() * columns.transpose(), VectorXd(q.rows()),
            VectorXd(q.rows())};
  kernel_->diagonal(at.kernel, {targets.data(), q.rows(), q.rows()}, part.prior.data());
  part.prior *= signal;
  part.known = part.prior;
  part.prior += part.R.colwise().squaredNorm().transpose();
  std::vector<Index> far_reaching;
  for (Index i = 0; i < q.rows(); ++i) {
    auto k = cross.map().col(i).head(points);
    k *= signal;
    if (inverse_[output].empty()) {
      far_reaching.push_back(i);
      continue;
    }
    const std::vector<Index> near = near_poses(k.data(), output);
    if (static_cast<Index>(near.size()) * kWorthPassing > points) {
      far_reaching.push_back(i);
      continue;
    }
    for (const Index pose : near) part.R.col(i) -= k[pose] * explained_[output].col(pose);
    part.known[i] =
        std::clamp(part.known[i] - quadratic(inverse_[output], near, k.data()), 0.0, part.known[i]);
  }
  if (far_reaching.empty()) return part;
  const MatrixXd k = cross.map().topRows(points)(Eigen::all, far_reaching);
  const MatrixXd explained = explained_[output] * k;
  const std::vector<PosteriorVariance> own = outputs_[output].variance(q(far_reaching, Eigen::all));
  for (std::size_t i = 0; i < far_reaching.size(); ++i) {
    part.R.col(far_reaching[i]) -= explained.col(static_cast<Index>(i));
    part.known[far_reaching[i]] = own[i].posterior;
  }
  return part;
}

std::vector<Index> CoupledPosterior::near_poses(const double* k, std::size_t output) const {
  std::vector<Index> near;
  const double most = passed_over_[output] * passed_over_[output];  // sum of squares
  double passed = 0;
  std::vector<std::pair<double, Index>> smallest_first;
  for (Index i = 0; i < points_; ++i) {
    const double square = k[i] * k[i];
    if (square * static_cast<double>(2 * points_) < most) {
      passed += square;
    } else {
      smallest_first.emplace_back(square, i);
    }
  }
  std::sort(smallest_first.begin(), smallest_first.end());
  for (const auto& [square, i] : smallest_first) {
    passed += square;
    if (passed > most) near.push_back(i);
  }
  std::sort(near.begin(), near.end());
  return near;
}

// From |L⁻¹ r_d|² and |L⁻¹ (r_d + r_e)|², kTargetBlock of them at once.
MatrixXd CoupledPosterior::shared_covariance(const std::vector<Part>& parts, Index i) const {
  const auto outputs = static_cast<Index>(parts.size());
  const Index p = weights_.size();
  MatrixXd covariance = MatrixXd::Zero(outputs, outputs);
  if (p == 0) return covariance;
  std::vector<std::pair<Index, Index>> pairs;
  for (Index d = 0; d < outputs; ++d) {
    for (Index e = 0; e <= d; ++e) pairs.emplace_back(d, e);
  }
  Eigen::Matrix<double, kTargetBlock, Eigen::Dynamic> block(kTargetBlock, p);
  for (std::size_t first = 0; first < pairs.size(); first += kTargetBlock) {
    const std::size_t count = std::min<std::size_t>(kTargetBlock, pairs.size() - first);
    block.setZero();
    for (std::size_t b = 0; b < count; ++b) {
      const auto [d, e] = pairs[first + b];
      block.row(static_cast<Index>(b)) = parts[static_cast<std::size_t>(d)].R.col(i).transpose();
      if (e != d)
        block.row(static_cast<Index>(b)) += parts[static_cast<std::size_t>(e)].R.col(i).transpose();
    }
    double squares[kTargetBlock];
    numerics().square_norms(p, packed_root_.data(), kTargetBlock, block.data(), squares);
    for (std::size_t b = 0; b < count; ++b)
      covariance(pairs[first + b].first, pairs[first + b].second) = squares[b];
  }
  for (const auto& [d, e] : pairs) {
    if (e != d)
      covariance(e, d) = covariance(d, e) =
          0.5 * (covariance(d, e) - covariance(d, d) - covariance(e, e));
  }
  return covariance;
}

}  // namespace trammel
