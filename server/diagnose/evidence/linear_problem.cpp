#include "server/diagnose/evidence/linear_problem.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "server/base/check.h"
#include "server/diagnose/evidence/background.h"
#include "server/error_sources/spelling.h"
#include "server/measurement/pose_groups.h"
#include "server/numerics/product.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kCut =
    3;  // standard deviations, beyond which a row's size no longer counts in the noise
constexpr double kMeanBelowCut = 0.9950;  // of min(z^2, kCut^2), z standard normal
constexpr double kLeastFreedom =
    0.05;  // smallest assumed share of freedom, however many parameters a fit has
constexpr int kHalvings = 60;  // of an interval: the full precision of a double

/// The surplus s at which the mean of the rows' squares, cut off at kCut, is that of white noise,
/// given the share of freedom that the fit leaves. Zero if there is no surplus.
double robust_surplus(const VectorXd& residual, const VectorXd& sigma, double share) {
  const double wanted = kMeanBelowCut * share * static_cast<double>(residual.size());
  const auto excess = [&](double s) {
    const auto square = residual.array().square() / (sigma.array().square() + s * s);
    return square.min(kCut * kCut).sum() - wanted;
  };
  if (residual.size() == 0 || excess(0) <= 0) return 0;
  double low = 0;
  double high = residual.norm();
  for (int k = 0; k < kHalvings; ++k) {
    const double middle = 0.5 * (low + high);
    (excess(middle) > 0 ? low : high) = middle;
  }
  return high;
}

/// The source that `spec` names, if this model can have it in addition to its own.
Result<ErrorSourcePtr> possible(const std::string& spec, const PhysicalModel& model) {
  Result<ErrorSourcePtr> source = make_error_source(spec, *model.cell);
  if (!source) return source;
  const bool there = std::any_of(
      model.sources.begin(), model.sources.end(),
      [&](const ErrorSourcePtr& own) { return are_forms_of_one(own->name(), (*source)->name()); });
  if (there) return refused("{} is in the model", in_words(spec)).with_text(spec);
  return source;
}

/// Place of `source`'s first parameter among all of the model's.
Index first_place(const PhysicalModel& model, const ErrorSourcePtr& source) {
  Index first = 0;
  for (const ErrorSourcePtr& other : model.sources) {
    if (other == source) break;
    first += static_cast<Index>(other->parameters().size());
  }
  return first;
}

/// Adds `source` with no effect yet. A source with an expected effect (the weight of the links)
/// starts with that effect.
void add_at_zero(PhysicalModel& model, const ErrorSourcePtr& source,
                 const MeasurementBatch& batch) {
  const Pose without = model.pose_W(batch.measurements.front().context);
  const Index first = add_source(model, source);
  if (model.pose_W(batch.measurements.front().context).isApprox(without, 1e-12)) return;
  const std::vector<Parameter>& parameters = source->parameters();
  for (std::size_t k = 0; k < parameters.size(); ++k)
    if (!parameters[k].is_place) model.values(first + static_cast<Index>(k)) = 0;
}

/// The measured pose less `X_WT`: 3 numbers (m), or 6 with the rotation (rad).
VectorXd distance_of(const Measurement& m, const Pose& X_WT) {
  VectorXd distance(m.R_WT ? 6 : 3);
  distance.head<3>() = m.p_W - X_WT.translation();
  if (m.R_WT) distance.tail<3>() = rotation_log(*m.R_WT * X_WT.linear().transpose());
  return distance;
}

/// `nuisance`: the effects of the parameters, SI, in units of their `scales`. `sigma`: of each row.
LinearProblem::Leftover leftover_of(const VectorXd& residual, const MatrixXd& nuisance,
                                    const VectorXd& scales, const VectorXd& sigma) {
  MatrixXd scaled = sigma.cwiseInverse().asDiagonal() * nuisance * scales.asDiagonal();
  MatrixXd information = gram(scaled);
  information.diagonal().array() += 1;
  MatrixXd inverse = inverse_factor_of(information);
  // The trace of the fit's hat matrix, priors included.
  const double taken = static_cast<double>(scales.size()) - inverse.squaredNorm();
  const VectorXd right = scaled.transpose() * residual.cwiseQuotient(sigma);
  return {residual - sigma.asDiagonal() * (scaled * (inverse.transpose() * (inverse * right))),
          std::max(kLeastFreedom, 1 - taken / static_cast<double>(residual.size())),
          std::move(scaled), std::move(inverse)};
}

}  // namespace

VectorXd scales_of(const std::vector<Parameter>& parameters) {
  VectorXd scales(static_cast<Index>(parameters.size()));
  for (std::size_t k = 0; k < parameters.size(); ++k)
    scales(static_cast<Index>(k)) = parameters[k].prior_scale;
  return scales;
}

/// The model with every wanted source at zero, so that no source changes the effect of another.
struct LinearProblem::Extended {
  PhysicalModel model;
  std::vector<Index> joints;   // place of each joint's own angle among the parameters
  std::vector<Index> effects;  // first place of each wanted source
  std::vector<Index> own;      // places of the parameters that the model had before
};

LinearProblem::LinearProblem(const PhysicalModel& model, const MeasurementBatch& batch,
                             const std::vector<Parameter>& priors,
                             const std::vector<std::string>& further, Weighed weighed)
    : model_(model), batch_(&batch), priors_(priors) {
  TRAMMEL_CHECK(static_cast<int>(priors.size()) == model.parameter_count());
  first_row_ = {0};
  for (const Measurement& m : batch_->measurements)
    first_row_.push_back(first_row_.back() + (m.R_WT ? 6 : 3));
  differentiate(extended_by(further));
  whiten(weighed);
}

LinearProblem::Extended LinearProblem::extended_by(const std::vector<std::string>& further) {
  std::vector<ErrorSourcePtr> joints, wanted;
  const CauseRecord& slip = first_searched_by(causes::SearchFamily::kZeroStep);
  for (int joint = 0; joint < model_.cell->robot.size(); ++joint) {
    // A joint that has slipped before the first pose is off everywhere: its column is the joint's
    // own.
    joints.push_back(
        *make_error_source(fmt::format("{}:{}@1", slip.spelling, joint + 1), *model_.cell));
  }
  for (const std::string& spec : further) {
    Result<ErrorSourcePtr> source = possible(spec, model_);
    if (!source) continue;
    effects_.push_back({spec, (*source)->parameters(), {}});
    wanted.push_back(std::move(*source));
  }
  Extended extended{model_, {}, {}, {}};
  for (const ErrorSourcePtr& source : joints) add_source(extended.model, source);
  for (const ErrorSourcePtr& source : wanted) add_at_zero(extended.model, source, *batch_);
  std::vector<bool> is_own(static_cast<std::size_t>(extended.model.parameter_count()), true);
  const auto take = [&](const ErrorSourcePtr& source) {
    const Index first = first_place(extended.model, source);
    std::fill_n(is_own.begin() + first, source->parameters().size(), false);
    return first;
  };
  std::transform(joints.begin(), joints.end(), std::back_inserter(extended.joints), take);
  std::transform(wanted.begin(), wanted.end(), std::back_inserter(extended.effects), take);
  for (std::size_t k = 0; k < is_own.size(); ++k) {
    if (is_own[k]) extended.own.push_back(static_cast<Index>(k));
  }
  return extended;
}

/// Residuals, derivatives and stated standard deviations of all poses, SI.
void LinearProblem::differentiate(const Extended& extended) {
  const Index R = first_row_.back();
  residual_.resize(R);
  sigma_.resize(R);
  by_joint_.resize(R, static_cast<Index>(extended.joints.size()));
  nuisance_.resize(R, static_cast<Index>(priors_.size()));
  for (Effect& effect : effects_)
    effect.columns.resize(R, static_cast<Index>(effect.parameters.size()));
  MatrixXd J;
  for (Index i = 0; i < poses(); ++i) {
    const Measurement& m = batch_->measurements[static_cast<std::size_t>(i)];
    measure(i, extended.model.pose_W(m.context, extended.model.values, &J));
    const Index row = first_row(i);
    const Index count = row_count(i);
    nuisance_.middleRows(row, count) = J(Eigen::seqN(0, count), extended.own);
    by_joint_.middleRows(row, count) = J(Eigen::seqN(0, count), extended.joints);
    for (std::size_t k = 0; k < effects_.size(); ++k) {
      MatrixXd& columns = effects_[k].columns;
      columns.middleRows(row, count) = J.block(0, extended.effects[k], count, columns.cols());
    }
  }
}

/// Sets how far `pose` is measured from `X_WT`, and the standard deviations that its measurement is
/// said to have.
void LinearProblem::measure(Index pose, const Pose& X_WT) {
  const Measurement& m = batch_->measurements[static_cast<std::size_t>(pose)];
  const Tracker& tracker = model_.cell->tracker;
  const Index row = first_row(pose);
  residual_.segment(row, row_count(pose)) = distance_of(m, X_WT);
  sigma_.segment<3>(row).setConstant(m.sigma.value_or(tracker.sigma));
  if (m.R_WT) sigma_.segment<3>(row + 3).setConstant(tracker.sigma_rotation);
}

VectorXd LinearProblem::residual_of(const PhysicalModel& model) const {
  VectorXd residual(rows());
  for (Index i = 0; i < poses(); ++i) {
    const Measurement& m = batch_->measurements[static_cast<std::size_t>(i)];
    residual.segment(first_row(i), row_count(i)) = distance_of(m, model.pose_W(m.context));
  }
  return residual.cwiseProduct(weight_);
}

/// Scales the measurements to rows of unit variance: adds the surplus to every standard deviation,
/// and divides by it.
void LinearProblem::whiten(Weighed weighed) {
  std::vector<Index> position, rotation;
  for (Index i = 0; i < poses(); ++i) {
    for (Index k = 0; k < row_count(i); ++k)
      (k < 3 ? position : rotation).push_back(first_row(i) + k);
  }
  const VectorXd scales = scales_of(priors_);
  // Noise is the part that no parameter explains, whether or not the model is at its best fit.
  const Leftover left = leftover_of(residual_, nuisance_, scales, sigma_);
  const auto surplus_of = [&](const std::vector<Index>& rows) {
    return weighed == Weighed::kAsStated
               ? 0
               : robust_surplus(left.residual(rows), sigma_(rows), left.share);
  };
  weight_.resize(sigma_.size());
  position_ = weigh(position, surplus_of(position), left.share);
  if (weighed == Weighed::kByWhatIsLeft) weigh_together(left);
  rotation_ = weigh(rotation, surplus_of(rotation), left.share);

  residual_ = residual_.cwiseProduct(weight_).eval();
  nuisance_ = (weight_.asDiagonal() * nuisance_ * scales.asDiagonal()).eval();
  by_joint_ = (weight_.asDiagonal() * by_joint_).eval();
  for (Effect& effect : effects_) {
    effect.columns =
        (weight_.asDiagonal() * effect.columns * scales_of(effect.parameters).asDiagonal()).eval();
  }
}

/// Weighs `rows` by their stated standard deviation plus `surplus` (SI). `share`: the share of
/// freedom that remains after the fit.
LinearProblem::Spread LinearProblem::weigh(const std::vector<Index>& rows, double surplus,
                                           double share) {
  if (rows.empty()) return {};
  const auto count = static_cast<double>(rows.size());
  const double stated = sigma_(rows).norm() / std::sqrt(count);
  double sum = 0;
  for (const Index row : rows) {
    const double sigma = std::hypot(sigma_(row), surplus);
    sum += sigma * sigma;
    weight_(row) = 1 / sigma;
  }
  return {std::sqrt(sum / count), stated, share * count};
}

/// Weights positions at one joint vector as one pose, as far as their means are off by more than
/// the scatter of single rows suggests (design effect), and counts their freedom accordingly.
void LinearProblem::weigh_together(const Leftover& left) {
  const std::vector<PoseGroup> groups = groups_seen_together(*batch_);
  if (std::ssize(groups) == poses()) return;
  VectorXd mean(3 * std::ssize(groups)), sigma(3 * std::ssize(groups));
  double taken = 0, rows_of_a_pose = 0;
  for (Index g = 0; g < std::ssize(groups); ++g) {
    const PoseGroup& group = groups[static_cast<std::size_t>(g)];
    const auto count = static_cast<double>(group.size());
    MatrixXd rows = MatrixXd::Zero(3, left.scaled.cols());
    Vector3 sum = Vector3::Zero(), variance = Vector3::Zero();
    for (const Index i : group) {
      sum += left.residual.segment<3>(first_row(i));
      variance += sigma_.segment<3>(first_row(i)).cwiseAbs2();
      rows += left.scaled.middleRows<3>(first_row(i));
    }
    mean.segment<3>(3 * g) = sum / count;
    sigma.segment<3>(3 * g) = variance.cwiseSqrt() / count;
    taken += (rows * left.root.transpose()).squaredNorm() / count;
    rows_of_a_pose += count * count / static_cast<double>(poses());
  }
  const double share = std::max(kLeastFreedom, 1 - taken / static_cast<double>(mean.size()));
  const double of_pose = robust_surplus(mean, sigma, share);
  for (const PoseGroup& group : groups) {
    const auto count = static_cast<double>(group.size());
    for (const Index i : group) {
      auto weight = weight_.segment<3>(first_row(i));
      const auto own = sigma_.segment<3>(first_row(i));
      // The sigma rises at most to its value if the poses of a group shared the whole residual.
      const Vector3 most = std::sqrt(count) * weight.cwiseInverse();
      const Vector3 together = (own.array().square() + count * of_pose * of_pose).sqrt();
      if (group.size() > 1)
        weight = together.cwiseMin(most).cwiseMax(weight.cwiseInverse()).cwiseInverse().eval();
    }
  }
  const double shared = std::min(1.0, std::pow(of_pose / position_.noise, 2));
  position_.freedom /= 1 + (rows_of_a_pose - 1) * shared * shared;
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

}  // namespace trammel::cause_search
