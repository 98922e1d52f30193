#include "server/diagnose/search/slow_rival.h"

#include <algorithm>

#include "server/numerics/product.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kSoon = 1e-3;   // of the batch's time: too early for a drift to have gone anywhere
constexpr double kPlaces = 1.5;  // nat: what choosing one of five places is worth
constexpr int kRounds = 2;       // of motion and course by turns

bool is_step(const Cause& cause) {
  return !cause.pose_id.empty() && record_of(cause).lasting == causes::Lasting::kFromAPose;
}

bool is_drift(const Cause& cause) {
  const CauseRecord& record = record_of(cause);
  return record.scope == causes::Scope::kSession && record.lasting == causes::Lasting::kOfTheSession &&
         record.needs.time && !record.needs.velocity;
}

/// Sizes of `columns` as fitted to the data.
VectorXd fitted_sizes(const Standing& standing, const MatrixXd& columns) {
  const MatrixXd projected = standing.background.project(columns);
  MatrixXd information = transposed_product(columns, projected);
  information.diagonal().array() += 1;
  return information.llt().solve(projected.transpose() * standing.problem.residual());
}

/// The columns of a step or a drift, as if it had gone all the way at every pose.
MatrixXd gone_all_the_way(const Family& family, const Best& best, const LinearProblem& problem, bool at_once) {
  if (at_once) return family.columns({.pose = 0});
  MatrixXd columns = family.columns(best);
  const auto& poses = problem.batch().measurements;
  const double start = *poses.front().context.time;
  const double all = *poses.back().context.time - start;
  for (Index i = 0; i < problem.poses(); ++i) {
    const double share = (*poses[static_cast<std::size_t>(i)].context.time - start) / all;
    columns.middleRows(problem.first_row(i), problem.row_count(i)) *= share > kSoon ? 1 / share : 0;
  }
  return columns;
}

/// How far `effect` has gone at each pose, where `motion` is all the way.
VectorXd course_of(const LinearProblem& problem, const VectorXd& motion, const VectorXd& effect) {
  VectorXd course = VectorXd::Zero(problem.rows());
  for (Index i = 0; i < problem.poses(); ++i) {
    const Index row = problem.first_row(i);
    const Index count = problem.row_count(i);
    const auto way = motion.segment(row, count);
    if (const double square = way.squaredNorm(); square > 0)
      course.segment(row, count).setConstant(way.dot(effect.segment(row, count)) / square);
  }
  return course;
}

std::string wanderer_of(const Cause& cause) {
  switch (record_of(cause).part) {
    case causes::Part::kTool:
      return "the tool";
    case causes::Part::kPayload:
      return "the payload";
    default:
      break;
  }
  return cause.joint >= 0 ? fmt::format("the zero of joint {}", cause.joint + 1) : "the instrument or the base";
}

}  // namespace

std::optional<SlowRival> slow_rival(const Standing& standing, const Scan& seen, std::size_t place) {
  const Family& family = *standing.families[place];
  const Best& best = seen.best[place];
  const Cause cause = family.cause(best);
  if (!is_step(cause) && !is_drift(cause)) return std::nullopt;
  const LinearProblem& problem = standing.problem;
  const MatrixXd always = gone_all_the_way(family, best, problem, is_step(cause));
  const VectorXd projected = standing.background.project(problem.residual());
  VectorXd motion = always * fitted_sizes(standing, family.columns(best));
  SlowRival rival;
  for (int round = 0; round < kRounds; ++round) {
    rival.family = make_slow_family(problem, motion, wanderer_of(cause), cause.joint);
    if (!rival.family) return std::nullopt;
    rival.best = rival.family->scan({standing.background}, projected).front();
    if (always.cols() == 1 || rival.best.evidence <= 0 || round + 1 == kRounds) break;
    // The motion anew, as it is by this course: it was fitted to another one.
    const MatrixXd slow = rival.family->columns(rival.best);
    const VectorXd course = course_of(problem, motion, slow * fitted_sizes(standing, slow));
    motion = always * fitted_sizes(standing, course.asDiagonal() * always);
  }
  rival.gap = rival.best.evidence - log_evidence(best.strength, 1) + (is_step(cause) ? kPlaces : 0);
  return rival;
}

}  // namespace trammel::cause_search
