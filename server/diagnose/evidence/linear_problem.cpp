#include "server/diagnose/evidence/linear_problem.h"

#include <algorithm>
#include <cmath>

#include "server/base/check.h"
#include "server/numerics/product.h"

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kCut = 3;                // sigmas, beyond which a row's size no longer counts in the noise
constexpr double kMeanBelowCut = 0.9950;  // of min(z^2, kCut^2), z standard normal

/// The surplus s at which the rows' squares, cut off at kCut, average to what white noise has, given the share of
/// freedom the fit has left. Zero where there is none.
double robust_surplus(const VectorXd& residual, const VectorXd& sigma, double share) {
  const double wanted = kMeanBelowCut * share * static_cast<double>(residual.size());
  const auto excess = [&](double s) {
    const auto square = residual.array().square() / (sigma.array().square() + s * s);
    return square.min(kCut * kCut).sum() - wanted;
  };
  if (residual.size() == 0 || excess(0) <= 0) return 0;
  double low = 0;
  double high = residual.norm();
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (low + high);
    (excess(middle) > 0 ? low : high) = middle;
  }
  return high;
}

Result<ErrorSourcePtr> possible(const std::string& spec, const PhysicalModel& model) {
  Result<ErrorSourcePtr> source = make_error_source(spec, *model.cell);
  if (!source) return source;
  const bool there = std::any_of(model.sources.begin(), model.sources.end(), [&](const ErrorSourcePtr& own) {
    return are_forms_of_one(own->name(), (*source)->name());
  });
  if (there) return refused("error source {} is in the model", spec);
  return source;
}

VectorXd scales_of(const std::vector<Parameter>& parameters) {
  VectorXd scales(static_cast<Index>(parameters.size()));
  for (std::size_t k = 0; k < parameters.size(); ++k) scales(static_cast<Index>(k)) = parameters[k].prior_scale;
  return scales;
}

}  // namespace

LinearProblem::LinearProblem(const PhysicalModel& model, const MeasurementBatch& batch,
                             const std::vector<Parameter>& priors, const std::vector<std::string>& further)
    : model_(model), batch_(&batch), priors_(priors) {
  TRAMMEL_CHECK(static_cast<int>(priors.size()) == model.parameter_count());
  // All wanted sources act at once, each at zero: then none changes what another does.
  PhysicalModel extended = model;
  std::vector<ErrorSourcePtr> added;
  const CauseRecord& slip = first_searched_by(causes::SearchFamily::kZeroStep);
  for (int joint = 0; joint < model.cell->robot.size(); ++joint) {
    // A joint that has slipped before the first pose is off everywhere: its column is the joint's own.
    added.push_back(*make_error_source(fmt::format("{}:{}@1", slip.spelling, joint + 1), *model.cell));
  }
  const auto joints = static_cast<Index>(added.size());
  for (const std::string& spec : further) {
    Result<ErrorSourcePtr> source = possible(spec, model);
    if (!source) continue;
    effects_.push_back({spec, (*source)->parameters(), {}});
    added.push_back(std::move(*source));
  }
  for (const ErrorSourcePtr& source : added) {
    add_source(extended, source);
  }
  std::vector<Index> places;
  for (const ErrorSourcePtr& source : added) {
    Index first = 0;
    for (const ErrorSourcePtr& other : extended.sources) {
      if (other == source) break;
      first += static_cast<Index>(other->parameters().size());
    }
    places.push_back(first);
  }
  fill(extended, places, joints);
  whiten();
}

void LinearProblem::fill(const PhysicalModel& extended, const std::vector<Index>& places, Index joints) {
  first_row_ = {0};
  for (const Measurement& m : batch_->measurements) first_row_.push_back(first_row_.back() + (m.R_WT ? 6 : 3));
  const Index R = first_row_.back();
  residual_.resize(R);
  weight_.resize(R);
  by_joint_.resize(R, joints);
  nuisance_.resize(R, static_cast<Index>(priors_.size()));
  for (Effect& effect : effects_) effect.columns.resize(R, static_cast<Index>(effect.parameters.size()));
  std::vector<bool> is_added(static_cast<std::size_t>(extended.parameter_count()), false);
  for (std::size_t k = 0; k < places.size(); ++k) {
    const Index count =
        static_cast<Index>(k) < joints ? 1 : effects_[k - static_cast<std::size_t>(joints)].columns.cols();
    for (Index i = 0; i < count; ++i) is_added[static_cast<std::size_t>(places[k] + i)] = true;
  }
  std::vector<Index> own;
  for (std::size_t k = 0; k < is_added.size(); ++k) {
    if (!is_added[k]) own.push_back(static_cast<Index>(k));
  }
  const Tracker& tracker = model_.cell->tracker;
  MatrixXd J;
  for (Index i = 0; i < poses(); ++i) {
    const Measurement& m = batch_->measurements[static_cast<std::size_t>(i)];
    const Pose X_WT = extended.pose_W(m.context, extended.values, &J);
    const Index row = first_row(i);
    const Index count = row_count(i);
    residual_.segment<3>(row) = m.p_W - X_WT.translation();
    weight_.segment<3>(row).setConstant(m.sigma.value_or(tracker.sigma));
    if (m.R_WT) {
      residual_.segment<3>(row + 3) = rotation_log(*m.R_WT * X_WT.linear().transpose());
      weight_.segment<3>(row + 3).setConstant(tracker.sigma_rotation);
    }
    nuisance_.middleRows(row, count) = J(Eigen::seqN(0, count), own);
    for (Index joint = 0; joint < joints; ++joint) {
      by_joint_.col(joint).segment(row, count) = J.col(places[static_cast<std::size_t>(joint)]).head(count);
    }
    for (std::size_t k = 0; k < effects_.size(); ++k) {
      effects_[k].columns.middleRows(row, count) =
          J.block(0, places[k + static_cast<std::size_t>(joints)], count, effects_[k].columns.cols());
    }
  }
}

void LinearProblem::whiten() {
  std::vector<Index> position, rotation;
  for (Index i = 0; i < poses(); ++i) {
    for (Index k = 0; k < row_count(i); ++k) (k < 3 ? position : rotation).push_back(first_row(i) + k);
  }
  const VectorXd scales = scales_of(priors_);
  // How much freedom the fit takes: the trace of its hat matrix, prior included.
  const MatrixXd scaled = weight_.cwiseInverse().asDiagonal() * nuisance_ * scales.asDiagonal();
  MatrixXd information = transposed_product(scaled, scaled);
  const Index P = scales.size();
  information.diagonal().array() += 1;
  const Eigen::LLT<MatrixXd> factor(information);
  const double freedom = static_cast<double>(P) - factor.solve(MatrixXd::Identity(P, P)).trace();
  const double share = std::max(0.05, 1 - freedom / static_cast<double>(rows()));
  // The noise is what no parameter explains, whether the model stands at its best fit already or not.
  const VectorXd right = scaled.transpose() * residual_.cwiseQuotient(weight_);
  const VectorXd left = residual_ - weight_.asDiagonal() * (scaled * factor.solve(right));
  const double surplus = robust_surplus(left(position), weight_(position), share);
  const double surplus_rotation = robust_surplus(left(rotation), weight_(rotation), share);
  const auto weigh = [&](const std::vector<Index>& some, double beyond) {
    if (some.empty()) return Spread{};
    const auto count = static_cast<double>(some.size());
    const double stated = weight_(some).norm() / std::sqrt(count);
    double sum = 0;
    for (const Index row : some) {
      const double sigma = std::hypot(weight_(row), beyond);
      sum += sigma * sigma;
      weight_(row) = 1 / sigma;
    }
    return Spread{std::sqrt(sum / count), stated, share * count};
  };
  position_ = weigh(position, surplus);
  rotation_ = weigh(rotation, surplus_rotation);

  residual_ = residual_.cwiseProduct(weight_).eval();
  nuisance_ = (weight_.asDiagonal() * nuisance_ * scales.asDiagonal()).eval();
  by_joint_ = (weight_.asDiagonal() * by_joint_).eval();
  for (Effect& effect : effects_) {
    effect.columns = (weight_.asDiagonal() * effect.columns * scales_of(effect.parameters).asDiagonal()).eval();
  }
}

Eigen::Matrix3Xd LinearProblem::positions(const VectorXd& whitened) const {
  Eigen::Matrix3Xd p(3, poses());
  for (Index i = 0; i < poses(); ++i) {
    p.col(i) = whitened.segment<3>(first_row(i)).cwiseQuotient(weight_.segment<3>(first_row(i)));
  }
  return p;
}

double LinearProblem::position_rms(const VectorXd& whitened) const {
  return std::sqrt(positions(whitened).squaredNorm() / static_cast<double>(poses()));
}

}  // namespace trammel
