#include "server/bias/process/local_experts.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "server/base/check.h"
#include "server/bias/process/halves.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kMostExact = 5000;  // an exact process of so many takes 100 MB per output; twice as
                                    // many points take four times that
constexpr Index kMostOfAnExpert = 1200;  // neighbours: twice as many take twice the time and lower
                                         // the error by a tenth (decision 28)
constexpr double kKnownExactly =
    1e-12;  // of the prior variance; keeps the precision at a training point finite

VarianceForm form_of(VarianceForm wanted, std::size_t experts) {
  if (experts == 1) return wanted;
  if (wanted == VarianceForm::kServed || wanted == VarianceForm::kServedAsPart)
    return VarianceForm::kCompressedOnly;
  return wanted == VarianceForm::kLearned ? VarianceForm::kCompressed : wanted;
}

/// Groups of rows at one joint vector; each group belongs to one expert, so that it can be left out
/// as a whole.
std::vector<std::vector<Index>> neighbourhoods(const Kernel& kernel, const VectorXd& parameters,
                                               const MatrixXd& q) {
  if (q.rows() <= kMostExact) return halved(q, q.rows());
  const std::vector<PoseGroup> poses = pose_groups(q);
  return halved(joints_as_seen_by(kernel, parameters, q), poses,
                std::max<Index>(1, kMostOfAnExpert * std::ssize(poses) / q.rows()));
}

}  // namespace

std::optional<LocalExperts> LocalExperts::condition(const std::shared_ptr<const Kernel>& kernel,
                                                    const MatrixXd& q, const VectorXd& y,
                                                    const VectorXd& noise_shape,
                                                    const GpHyperparameters& hyperparameters,
                                                    VarianceForm form) {
  LocalExperts local;
  local.size_ = q.rows();
  local.members_ = neighbourhoods(*kernel, hyperparameters.kernel, q);
  for (const std::vector<Index>& points : local.members_) {
    auto expert =
        GaussianProcess::condition(kernel, q(points, Eigen::all), y(points), noise_shape(points),
                                   hyperparameters, form_of(form, local.members_.size()));
    if (!expert) return std::nullopt;
    local.experts_.push_back(*std::move(expert));
  }
  return local;
}

std::optional<LocalExperts> LocalExperts::with(const MatrixXd& q, const VectorXd& y,
                                               const VectorXd& noise_shape) const {
  std::vector<std::vector<Index>> fresh(experts_.size());
  std::vector<std::vector<PosteriorVariance>> known;
  for (const GaussianProcess& expert : experts_) known.push_back(expert.variance(q));
  for (Index i = 0; i < q.rows(); ++i) {
    std::size_t best = 0;
    for (std::size_t k = 1; k < experts_.size(); ++k) {
      const auto row = static_cast<std::size_t>(i);
      if (known[k][row].posterior < known[best][row].posterior) best = k;
    }
    fresh[best].push_back(i);
  }
  LocalExperts grown;
  grown.size_ = size_ + q.rows();
  grown.members_ = members_;
  for (std::size_t k = 0; k < experts_.size(); ++k) {
    auto expert = experts_[k].with(q(fresh[k], Eigen::all), y(fresh[k]), noise_shape(fresh[k]));
    if (!expert) return std::nullopt;
    grown.experts_.push_back(*std::move(expert));
    for (const Index i : fresh[k]) grown.members_[k].push_back(size_ + i);
  }
  return grown;
}

LocalExperts LocalExperts::without(const std::vector<Index>& points) const {
  std::vector<Index> place(
      static_cast<std::size_t>(size_));  // of every point when these are gone; -1: gone
  std::iota(place.begin(), place.end(), Index{0});
  for (const Index point : points) place[static_cast<std::size_t>(point)] = -1;
  Index next = 0;
  for (Index& where : place) where = where < 0 ? -1 : next++;

  TRAMMEL_CHECK(next > 0);
  LocalExperts rest;
  rest.size_ = next;
  for (std::size_t k = 0; k < experts_.size(); ++k) {
    std::vector<Index> gone;
    std::vector<Index> members;
    for (std::size_t i = 0; i < members_[k].size(); ++i) {
      const Index where = place[static_cast<std::size_t>(members_[k][i])];
      if (where < 0) {
        gone.push_back(static_cast<Index>(i));
      } else {
        members.push_back(where);
      }
    }
    if (members.empty()) continue;
    rest.experts_.push_back(experts_[k].without(gone));
    rest.members_.push_back(std::move(members));
  }
  return rest;
}

LocalExperts::Committee LocalExperts::committee(const MatrixXd& q) const {
  const Index count = q.rows();
  VectorXd precision = VectorXd::Zero(count);
  VectorXd moment = VectorXd::Zero(count);
  VectorXd confidence = VectorXd::Zero(count);  // Σ β
  VectorXd prior(count);
  VectorXd mean(count);
  for (const GaussianProcess& expert : experts_) {
    const std::vector<PosteriorVariance> variance = expert.variance(q, nullptr, mean.data());
    for (Index i = 0; i < count; ++i) {
      const PosteriorVariance& at = variance[static_cast<std::size_t>(i)];
      const double posterior = std::max(at.posterior, kKnownExactly * at.prior);
      const double beta = 0.5 * std::log(at.prior / posterior);
      prior[i] = at.prior;
      confidence[i] += beta;
      precision[i] += beta / posterior;
      moment[i] += beta * mean[i] / posterior;
    }
  }
  const VectorXd total = precision + (1.0 - confidence.array()).matrix().cwiseQuotient(prior);
  return {moment.cwiseQuotient(total), total.cwiseInverse().cwiseMin(prior), prior};
}

void LocalExperts::mean(const MatrixXd& q, double* out) const {
  if (experts_.size() == 1) return experts_.front().mean(q, out);
  Eigen::Map<VectorXd>(out, q.rows()) = committee(q).mean;
}

std::vector<PosteriorVariance> LocalExperts::variance(const MatrixXd& q, double* mean) const {
  if (experts_.size() == 1) return experts_.front().variance(q, nullptr, mean);
  const Committee joined = committee(q);
  if (mean != nullptr) Eigen::Map<VectorXd>(mean, q.rows()) = joined.mean;
  std::vector<PosteriorVariance> variances;
  for (Index i = 0; i < q.rows(); ++i) variances.push_back({joined.posterior[i], joined.prior[i]});
  return variances;
}

double LocalExperts::log_likelihood() const {
  double total = 0;
  for (const GaussianProcess& expert : experts_) total += expert.log_likelihood();
  return total;
}

VectorXd LocalExperts::leave_one_out_mean() const {
  VectorXd mean(size_);
  for (std::size_t k = 0; k < experts_.size(); ++k)
    mean(members_[k]) = experts_[k].leave_one_out_mean();
  return mean;
}

VectorXd LocalExperts::leave_one_out_variance() const {
  VectorXd variance(size_);
  for (std::size_t k = 0; k < experts_.size(); ++k)
    variance(members_[k]) = experts_[k].leave_one_out_variance();
  return variance;
}

VectorXd LocalExperts::leave_one_out_share() const {
  VectorXd share(size_);
  for (std::size_t k = 0; k < experts_.size(); ++k)
    share(members_[k]) = experts_[k].leave_one_out_share();
  return share;
}

}  // namespace trammel
