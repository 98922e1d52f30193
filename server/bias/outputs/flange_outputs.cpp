#include <algorithm>
#include <cmath>
#include <utility>

#include "server/base/check.h"
#include "server/bias/flange/flange_search.h"
#include "server/bias/outputs/bias_outputs.h"
#include "server/numerics/numerics.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kTargetsAtATime = 64;     // their covariances with all numbers are six megabytes
constexpr double kLeastVariance = 1e-10;  // share of the prior, above the level of rounding

/// The error of the flange, conditioned on the measured numbers of its twist (flange/README.md).
class FlangeOutputs final : public BiasOutputs {
 public:
  FlangeOutputs(KernelPtr kernel, FlangeViews views, const MatrixXd& y, FlangeSolution solution,
                const CoupledHyperparameters& at)
      : kernel_(std::move(kernel)),
        views_(std::move(views)),
        parameters_(twist_parameters(at)),
        variance_(twist_variance(at)),
        noise_(std::exp(2 * at.outputs.front().log_noise_stddev)),
        log_likelihood_(solution.log_likelihood),
        features_(std::move(solution.features)),
        precision_(-solution.eliminated.map().topLeftCorner(views_.size, views_.size)) {
    weigh(solution.alpha);
    leave_out(numbers_of(views_, y).of_twist, solution.alpha, y.rows());
  }

  MatrixXd mean(const MatrixXd& q, const std::vector<BiasFeatures>& features) const override {
    TRAMMEL_CHECK(static_cast<Index>(features.size()) == q.rows());
    const MatrixXd twist = twist_mean(q);
    MatrixXd mean(q.rows(), kOfOneUnit);
    for (Index i = 0; i < q.rows(); ++i)
      mean.row(i) = (seen(features, i) * twist.col(i)).transpose();
    return mean;
  }

  std::vector<OutputPrediction> predict(const MatrixXd& q,
                                        const std::vector<BiasFeatures>& features) const override {
    const MatrixXd means = mean(q, features);
    std::vector<OutputPrediction> predictions;
    for (Index first = 0; first < q.rows(); first += kTargetsAtATime) {
      const Index many = std::min(kTargetsAtATime, q.rows() - first);
      const MatrixXd cross = cross_covariance(q.middleRows(first, many), features, first);
      const MatrixXd explained = precision_.selfadjointView<Eigen::Lower>() * cross;
      for (Index i = 0; i < many; ++i) {
        const Matrix3 prior = prior_at(seen(features, first + i));
        Matrix3 covariance =
            prior - cross.middleCols<3>(3 * i).transpose() * explained.middleCols<3>(3 * i);
        covariance.diagonal() =
            covariance.diagonal().cwiseMax(kLeastVariance * prior.diagonal()).eval();
        const VectorXd mean = means.row(first + i).transpose();
        predictions.push_back(
            {mean, covariance, share_of(covariance.diagonal(), prior.diagonal()), mean});
      }
    }
    return predictions;
  }

  VectorXd noise_variance() const override { return VectorXd::Constant(kOfOneUnit, noise_); }
  VectorXd log_likelihood() const override { return VectorXd::Constant(1, log_likelihood_); }
  MatrixXd leave_one_out_mean() const override { return leave_one_out_mean_; }
  MatrixXd leave_one_out_variance() const override { return leave_one_out_variance_; }
  VectorXd leave_one_out_share() const override { return leave_one_out_share_; }

  // A joint vector with a left-out row is left out completely.
  std::optional<MatrixXd> left_out_error(const MatrixXd& y,
                                         const std::vector<Index>& points) const override {
    const std::vector<std::size_t> gone = views_with(points);
    std::vector<Index> numbers;
    for (const std::size_t v : gone) add_numbers_of(views_.views[v], &numbers);
    const VectorXd z = numbers_of(views_, y).of_twist;
    const VectorXd alpha = precision_.selfadjointView<Eigen::Lower>() * z;
    const VectorXd missed = precision_of(numbers).llt().solve(alpha(numbers));
    MatrixXd error = MatrixXd::Zero(y.rows(), kOfOneUnit);
    Index first = 0;
    for (const std::size_t v : gone) {
      const FlangeView& view = views_.views[v];
      const VectorXd even = even_rows(views_, view, y);
      const VectorXd seen = view.basis.transpose() * even;
      spread(view, even - view.basis * (seen - missed.segment(first, seen.size())), &error);
      first += seen.size();
    }
    return error(points, Eigen::all);
  }

 private:
  /// Rows and columns of C⁻¹ (rising), with both triangles.
  MatrixXd precision_of(const std::vector<Index>& numbers) const {
    const MatrixXd triangle = precision_(numbers, numbers);
    return triangle.selfadjointView<Eigen::Lower>();
  }
  static void add_numbers_of(const FlangeView& view, std::vector<Index>* numbers) {
    for (Index k = 0; k < view.view.rows(); ++k) numbers->push_back(view.first + k);
  }

  static double share_of(const Vector3& known, const Vector3& prior) {
    return known.cwiseQuotient(prior).cwiseMax(0.0).cwiseMin(1.0).maxCoeff();
  }

  TwistRow seen(const std::vector<BiasFeatures>& features, Index i) const {
    return seen_through(features[static_cast<std::size_t>(i)], views_.reference_F);
  }
  Matrix3 prior_at(const TwistRow& seen) const {
    return seen * variance_.asDiagonal() * seen.transpose();
  }

  std::vector<std::size_t> views_with(const std::vector<Index>& points) const {
    std::vector<std::size_t> found;
    for (std::size_t v = 0; v < views_.views.size(); ++v) {
      const std::vector<Index>& rows = views_.views[v].rows;
      const auto asked = [&](Index row) {
        return std::binary_search(points.begin(), points.end(), row);
      };
      if (std::any_of(rows.begin(), rows.end(), asked)) found.push_back(v);
    }
    return found;
  }

  /// Puts the even rows of a view where they belong in `out` (N x 3), in m again.
  void spread(const FlangeView& view, const VectorXd& even, MatrixXd* out) const {
    for (std::size_t k = 0; k < view.rows.size(); ++k)
      out->row(view.rows[k]) = std::sqrt(views_.noise_shape[view.rows[k]]) *
                               even.segment<3>(3 * static_cast<Index>(k)).transpose();
  }

  AlignedMatrix features_at(const MatrixXd& q, std::size_t kernel) const {
    AlignedMatrix features(padded_rows(q.rows()), kernel_->feature_count(q.cols()));
    kernel_->features(parameters_[kernel], q, features.data(), features.rows());
    return features;
  }

  /// Computes the weight of each joint vector in the mean of each number of the twist.
  void weigh(const VectorXd& alpha) {
    const Index count = views_.q.rows();
    weights_ = AlignedMatrix(padded_rows(count), 6);
    for (Index i = 0; i < count; ++i) {
      const FlangeView& view = views_.views[static_cast<std::size_t>(i)];
      const Vector6 twist = view.view.transpose() * alpha.segment(view.first, view.view.rows());
      for (Index d = 0; d < 6; ++d) weights_(i, d) = variance_[d] * twist[d];
    }
  }

  // 6 x M
  MatrixXd twist_mean(const MatrixXd& q) const {
    const Index count = views_.q.rows();
    MatrixXd twist(6, q.rows());
    VectorXd mean(q.rows());
    for (std::size_t c = 0; c < kTwistKernels; ++c) {
      const AlignedMatrix targets = features_at(q, c);
      for (Index d = 0; d < 6; ++d) {
        if (kernel_of(d) != c) continue;
        kernel_->weighted_sum(parameters_[c], rows_of(features_[c], 0, count),
                              rows_of(targets, 0, q.rows()), weights_.data() + d * weights_.rows(),
                              mean.data());
        twist.row(d) = mean.transpose();
      }
    }
    return twist;
  }

  /// Covariance of the three coordinates of each target (rows of `q`) with all numbers: size x 3 M.
  MatrixXd cross_covariance(const MatrixXd& q, const std::vector<BiasFeatures>& features,
                            Index first) const {
    const Index count = views_.q.rows();
    std::vector<AlignedMatrix> k;
    for (std::size_t c = 0; c < kTwistKernels; ++c) {
      const AlignedMatrix targets = features_at(q, c);
      k.emplace_back(padded_rows(count), q.rows());
      kernel_->tile(parameters_[c], rows_of(features_[c], 0, count), rows_of(targets, 0, q.rows()),
                    k.back().data(), k.back().rows());
    }
    MatrixXd cross(views_.size, 3 * q.rows());
    for (Index t = 0; t < q.rows(); ++t) {
      const TwistRow at = seen(features, first + t);
      for (Index i = 0; i < count; ++i) {
        const FlangeView& view = views_.views[static_cast<std::size_t>(i)];
        Vector6 weight;
        for (Index d = 0; d < 6; ++d) weight[d] = variance_[d] * k[kernel_of(d)](i, t);
        const TwistRows weighed = view.view * weight.asDiagonal();
        cross.block(view.first, 3 * t, view.view.rows(), 3) = weighed.lazyProduct(at.transpose());
      }
    }
    return cross;
  }

  // The rows are predicted without any row of their joint vector, as in every other bias. A target
  // has no such rows.
  void leave_out(const VectorXd& z, const VectorXd& alpha, Index rows) {
    leave_one_out_mean_ = leave_one_out_variance_ = MatrixXd::Zero(rows, kOfOneUnit);
    leave_one_out_share_.resize(rows);
    for (const FlangeView& view : views_.views) {
      const Index r = view.view.rows();
      std::vector<Index> numbers;
      add_numbers_of(view, &numbers);
      const MatrixXd unknown =
          precision_of(numbers).llt().solve(MatrixXd::Identity(r, r));  // noise included
      const VectorXd mean = z.segment(view.first, r) - unknown * alpha.segment(view.first, r);
      const MatrixXd known =
          view.basis * (unknown - noise_ * MatrixXd::Identity(r, r)) * view.basis.transpose();
      spread(view, view.basis * mean, &leave_one_out_mean_);
      for (std::size_t k = 0; k < view.rows.size(); ++k) {
        const Index row = view.rows[k];
        const Vector3 of_row =
            views_.noise_shape[row] * known.diagonal().segment<3>(3 * static_cast<Index>(k));
        leave_one_out_variance_.row(row).array() =
            of_row.transpose().array() + views_.noise_shape[row] * noise_;
        leave_one_out_share_[row] =
            share_of(of_row, prior_at(views_.seen[static_cast<std::size_t>(row)]).diagonal());
      }
    }
  }

  KernelPtr kernel_;
  FlangeViews views_;
  std::vector<VectorXd> parameters_;
  Vector6 variance_;
  double noise_;
  double log_likelihood_;
  std::vector<AlignedMatrix> features_;
  MatrixXd precision_;     // C⁻¹, lower triangle
  AlignedMatrix weights_;  // M x 6, padded
  MatrixXd leave_one_out_mean_, leave_one_out_variance_;
  VectorXd leave_one_out_share_;
};

/// The mean of the rows of each joint vector, as data for a kernel without levers.
OutputData without_levers(const FlangeViews& views, const OutputData& data) {
  const Index count = views.q.rows();
  OutputData mean{views.q, MatrixXd::Zero(count, data.y.cols()), VectorXd(count), {}};
  for (Index i = 0; i < count; ++i) {
    double weight = 0;
    for (const Index row : views.views[static_cast<std::size_t>(i)].rows) {
      weight += 1 / data.noise_shape[row];
      mean.y.row(i) += data.y.row(row) / data.noise_shape[row];
    }
    mean.y.row(i) /= weight;
    mean.noise_shape[i] = 1 / weight;
  }
  return mean;
}

}  // namespace

BiasOutputsPtr condition_flange(const KernelPtr& kernel, const OutputData& data,
                                const CoupledHyperparameters& at) {
  FlangeViews views = views_of(data.q, data.noise_shape, data.features);
  auto solution = solve(*kernel, views, numbers_of(views, data.y), at);
  if (!solution) return nullptr;
  return std::make_shared<FlangeOutputs>(kernel, std::move(views), data.y, *std::move(solution),
                                         at);
}

std::optional<CoupledSearchResult> search_flange_outputs(const KernelPtr& kernel,
                                                         const OutputData& data,
                                                         const VectorXd& metrology_stddev,
                                                         const SearchOptions& options,
                                                         const CoupledHyperparameters* last) {
  const FlangeViews views = views_of(data.q, data.noise_shape, data.features);
  if (last != nullptr)
    return search_flange(kernel, views, data.y, *last, metrology_stddev[0], options, true);
  SearchOptions plain = options;
  if (options.progress)
    plain.progress = [&](double share) { return options.progress(0.3 * share); };
  auto found =
      search_independent(kernel, without_levers(views, data), metrology_stddev, plain, nullptr);
  if (!found || found->given_up) return found;
  SearchOptions rest = options;
  if (options.progress)
    rest.progress = [&](double share) { return options.progress(0.3 + 0.7 * share); };
  return search_flange(kernel, views, data.y, found->found, metrology_stddev[0], rest, false);
}

}  // namespace trammel
