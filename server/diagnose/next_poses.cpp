#include "server/diagnose/next_poses.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "server/plan/plan.h"

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kPool = 240;
constexpr int kRandomSets = 20;
constexpr double kWorthwhile = 0.9;

/// The family of `cause` among those of `problem`, of the kinds that look the same on other poses.
const Family* family_of(const std::vector<FamilyPtr>& families, const Cause& cause) {
  for (const FamilyPtr& family : families) {
    if (!family->named() || !family->predicts()) continue;
    const Cause one = family->cause(family->typical());
    if (one.cause == cause.cause && one.joint == cause.joint && one.parameter == cause.parameter) return family.get();
  }
  return nullptr;
}

bool stays_itself(const Cause& cause) { return cause.pose_id.empty() && cause.cause != "joint_map"; }

/// Planned poses, as if measured where the model has them, in the context of the batch.
Result<MeasurementBatch> pool_of(const SearchResult& found, std::uint64_t seed) {
  const Cell& cell = *found.before.model.cell;
  const Result<MatrixXd> planned = plan_poses(cell, {.count = kPool, .seed = seed});
  if (!planned) return tl::make_unexpected(planned.error());
  MeasurementBatch pool;
  pool.id = "next";
  const auto& done = found.all.measurements;
  std::mt19937_64 random(seed);
  for (Index i = 0; i < planned->rows(); ++i) {
    const Measurement& like = done[static_cast<std::size_t>(i) % done.size()];
    Measurement m;
    m.context = like.context;
    m.context.q = planned->row(i).transpose();
    m.context.velocity.reset();
    for (int& direction : m.context.direction) direction = random() % 2 == 0 ? 1 : -1;
    m.context.index = static_cast<int>(done.size() + static_cast<std::size_t>(i));
    const Pose X_WT = found.before.model.pose_W(m.context);
    m.p_W = X_WT.translation();
    if (like.R_WT) m.R_WT = X_WT.linear();
    pool.measurements.push_back(std::move(m));
  }
  return pool;
}

/// Columns of everything that is free when a finding is doubted: the model's parameters, the rivals, and last the
/// finding itself.
struct Doubted {
  MatrixXd columns;
  Index own = 0;  // the last ones
};
std::optional<Doubted> doubted(const LinearProblem& problem, const std::vector<FamilyPtr>& families,
                               const Accepted& finding) {
  std::vector<MatrixXd> blocks = {problem.nuisance()};
  for (const Cause& other : finding.could_also_be) {
    if (!stays_itself(other)) continue;
    const Family* family = family_of(families, other);
    if (family == nullptr) continue;
    Best best = family->typical();
    if (other.order) best.at = *other.order;
    blocks.push_back(family->columns(best));
  }
  const Family* own = family_of(families, finding.cause);
  if (blocks.size() < 2 || own == nullptr) return std::nullopt;
  Best best = finding.best;
  blocks.push_back(own->columns(best));
  Index count = 0;
  for (const MatrixXd& block : blocks) count += block.cols();
  Doubted all{MatrixXd(problem.rows(), count), blocks.back().cols()};
  Index next = 0;
  for (const MatrixXd& block : blocks) {
    all.columns.middleCols(next, block.cols()) = block;
    next += block.cols();
  }
  return all;
}

/// The uncertainty of the finding's effect over the poses measured, and how one more pose lowers it.
class Uncertainty {
 public:
  Uncertainty(const Doubted& doubted, const MatrixXd& weight) : weight_(weight), own_(doubted.own) {
    const Index P = doubted.columns.cols();
    covariance_ = (doubted.columns.transpose() * doubted.columns + MatrixXd::Identity(P, P))
                      .llt()
                      .solve(MatrixXd::Identity(P, P));
  }
  double variance() const { return (covariance_.bottomRightCorner(own_, own_) * weight_).trace(); }
  double variance_with(const MatrixXd& rows) const {
    const MatrixXd gain = covariance_.bottomRows(own_) * rows.transpose();
    const MatrixXd innovation = rows * covariance_ * rows.transpose() + MatrixXd::Identity(rows.rows(), rows.rows());
    return variance() - (gain * innovation.llt().solve(gain.transpose()) * weight_).trace();
  }
  void add(const MatrixXd& rows) {
    const MatrixXd across = covariance_ * rows.transpose();
    const MatrixXd innovation = rows * across + MatrixXd::Identity(rows.rows(), rows.rows());
    covariance_ -= across * innovation.llt().solve(across.transpose());
  }

 private:
  MatrixXd covariance_;
  MatrixXd weight_;
  Index own_;
};

MatrixXd rows_of(const LinearProblem& problem, const Doubted& doubted, Index pose) {
  return doubted.columns.middleRows(problem.first_row(pose), problem.row_count(pose));
}

}  // namespace

NextPoses next_poses_for(const SearchResult& found, const LinearProblem& before, const DiagnoseOptions& options) {
  const auto finding = std::find_if(found.accepted.begin(), found.accepted.end(), [](const Accepted& one) {
    return !one.could_also_be.empty() && stays_itself(one.cause);
  });
  if (finding == found.accepted.end() || options.next_poses <= 0) return {};
  const std::optional<Doubted> now = doubted(before, make_families(before), *finding);
  const Result<MeasurementBatch> pool = pool_of(found, options.seed);
  if (!now || !pool) return {};
  const LinearProblem later(found.before.model, *pool, found.before.priors,
                            candidate_sources(*found.before.model.cell, found.all, nullptr));
  const std::optional<Doubted> then = doubted(later, make_families(later), *finding);
  if (!then || then->columns.cols() != now->columns.cols()) return {};

  const MatrixXd own = now->columns.rightCols(now->own);
  const MatrixXd information = own.transpose() * own + MatrixXd::Identity(now->own, now->own);
  const VectorXd fitted = information.llt().solve(own.transpose() * before.residual());
  const double size = std::max(1e-12, (own * fitted).norm());
  const MatrixXd weight = own.transpose() * own / (size * size);

  NextPoses next;
  next.separates = {finding->cause};
  next.separates.insert(next.separates.end(), finding->could_also_be.begin(), finding->could_also_be.end());
  Uncertainty uncertainty(*now, weight);
  next.stddev_now = std::sqrt(uncertainty.variance());
  std::vector<bool> taken(static_cast<std::size_t>(later.poses()), false);
  for (int k = 0; k < options.next_poses; ++k) {
    Index best = -1;
    double lowest = uncertainty.variance();
    for (Index i = 0; i < later.poses(); ++i) {
      if (taken[static_cast<std::size_t>(i)]) continue;
      const double variance = uncertainty.variance_with(rows_of(later, *then, i));
      if (best < 0 || variance < lowest) {
        lowest = variance;
        best = i;
      }
    }
    if (best < 0) break;
    taken[static_cast<std::size_t>(best)] = true;
    uncertainty.add(rows_of(later, *then, best));
    next.q.push_back(pool->measurements[static_cast<std::size_t>(best)].context.q);
  }
  next.stddev_expected = std::sqrt(uncertainty.variance());
  // What no pose tells apart needs something else, as the finding's action says.
  if (next.stddev_expected > kWorthwhile * next.stddev_now) return {};

  std::mt19937_64 random(options.seed);
  double sum = 0;
  for (int set = 0; set < kRandomSets; ++set) {
    Uncertainty drawn(*now, weight);
    for (std::size_t k = 0; k < next.q.size(); ++k)
      drawn.add(rows_of(later, *then, static_cast<Index>(random() % static_cast<std::uint64_t>(later.poses()))));
    sum += std::sqrt(drawn.variance());
  }
  next.stddev_random = sum / kRandomSets;
  return next;
}

}  // namespace trammel
