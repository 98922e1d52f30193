#include "server/diagnose/search/slow_rival.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/diagnose/search/naming.h"
#include "server/diagnose/thresholds.h"
#include "server/numerics/product.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kSoon = 1e-3;       // share of the batch's time: too early for a drift to show
constexpr double kLeastTime = 1e-6;  // s
constexpr double kChoice =
    1.5;  // nat: the price of choosing one of five courses; a step pays for its place instead
constexpr int kRounds = 2;  // rounds that alternate between motion and course
/// The lags of warming up, in shares of the batch's time; the last one is a steady motion.
constexpr double kLags[] = {0.1, 0.2, 0.4, 0.8, 100};

bool is_step(const Cause& cause) {
  return !cause.pose_id.empty() && record_of(cause).lasting == causes::Lasting::kFromAPose;
}

bool is_drift(const Cause& cause) {
  const CauseRecord& record = record_of(cause);
  return record.scope == causes::Scope::kSession &&
         record.lasting == causes::Lasting::kOfTheSession && record.needs.time &&
         !record.needs.velocity;
}

/// The columns of a step or a drift, as if it had gone all the way at every pose.
MatrixXd gone_all_the_way(const Family& family, const Best& best, const LinearProblem& problem,
                          bool at_once) {
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

/// The part of the way that `effect` has gone at each pose, where `motion` is all the way.
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

/// The part of the way that something has gone at each pose.
struct Course {
  VectorXd way;  // N
  bool of_temperature = false;
};

/// The elapsed share of the batch's time at each pose; the share of its poses if some have no time.
VectorXd shares_of_time(const LinearProblem& problem) {
  const auto& poses = problem.batch().measurements;
  const VectorXd by_row = VectorXd::LinSpaced(problem.poses(), 0, 1);
  if (!std::all_of(poses.begin(), poses.end(),
                   [](const Measurement& m) { return m.context.time.has_value(); }))
    return by_row;
  VectorXd time(problem.poses());
  for (Index i = 0; i < time.size(); ++i)
    time(i) = *poses[static_cast<std::size_t>(i)].context.time;
  const double all = time.maxCoeff() - time.minCoeff();
  return all < kLeastTime ? by_row : VectorXd((time.array() - time.minCoeff()) / all);
}

std::optional<Course> course_of_temperature(const LinearProblem& problem) {
  const auto& poses = problem.batch().measurements;
  if (!std::all_of(poses.begin(), poses.end(),
                   [](const Measurement& m) { return m.context.temperature.has_value(); }))
    return std::nullopt;
  VectorXd way(problem.poses());
  for (Index i = 0; i < way.size(); ++i)
    way(i) = *poses[static_cast<std::size_t>(i)].context.temperature;
  const double span = way.maxCoeff() - way.minCoeff();
  if (span < thresholds::kSameTemperature) return std::nullopt;
  return Course{(way.array() - way(0)) / span, true};
}

std::vector<Course> courses_of(const LinearProblem& problem) {
  const VectorXd share = shares_of_time(problem);
  std::vector<Course> courses;
  for (const double lag : kLags)
    courses.push_back({(1 - (-share.array() / lag).exp()) / (1 - std::exp(-1 / lag)), false});
  if (std::optional<Course> warm = course_of_temperature(problem))
    courses.push_back(std::move(*warm));
  return courses;
}

MatrixXd on_course(const LinearProblem& problem, const MatrixXd& always, const VectorXd& way) {
  MatrixXd columns = always;
  for (Index i = 0; i < problem.poses(); ++i)
    columns.middleRows(problem.first_row(i), problem.row_count(i)) *= way(i);
  return columns;
}

/// Columns fitted to the data, and their gain.
struct Fitted {
  VectorXd size;
  double evidence = 0;  // nat
};
Fitted fitted(const Standing& standing, const MatrixXd& columns) {
  const MatrixXd projected = standing.background.project(columns);
  MatrixXd information = transposed_product(columns, projected);
  information.diagonal().array() += 1;
  const MatrixXd inverse = inverse_factor_of(information);
  const VectorXd along = inverse * (projected.transpose() * standing.problem.residual());
  return {inverse.transpose() * along,
          log_evidence(along.squaredNorm(), static_cast<double>(columns.cols()))};
}

std::vector<std::string> depending(int joint, bool on_temperature) {
  std::vector<std::string> on = {on_temperature ? "temperature" : "time"};
  if (joint >= 0) on.insert(on.begin(), fmt::format("q{}", joint + 1));
  return on;
}

std::string wanderer_of(const Cause& cause) {
  switch (part_of(cause)) {
    case causes::Part::kTool:
      return "the tool";
    case causes::Part::kPayload:
      return "the payload";
    default:
      break;
  }
  return cause.joint >= 0 ? fmt::format("the zero of joint {}", cause.joint + 1)
                          : "the instrument or the base";
}

/// A step or a drift, and the part that it moves.
struct Mover {
  const Family& family;
  const Best& best;
  Cause cause;
  MatrixXd always;  // the full motion at every pose
};

/// The best of a few courses of warming up. The recorded temperature is named if it fits clearly
/// better than the time.
SlowRival warming_up(const Standing& standing, const Mover& mover) {
  SlowRival best;
  double least = -std::numeric_limits<double>::infinity();
  for (const Course& course : courses_of(standing.problem)) {
    const MatrixXd columns = on_course(standing.problem, mover.always, course.way);
    const Fitted fit = fitted(standing, columns);
    if (fit.evidence - (course.of_temperature ? thresholds::kUnnamedMargin : 0) <= least) continue;
    least = fit.evidence;
    best = {columns * fit.size.cwiseAbs().asDiagonal(),
            depending(mover.cause.joint, course.of_temperature), wanderer_of(mover.cause),
            fit.evidence - mover.best.evidence};
  }
  return best;
}

/// Tries any smooth course of the motion. Both are scored as if the motion were known, because the
/// cause was fitted with a known motion. Empty if no time passes.
std::optional<SlowRival> moving_smoothly(const Standing& standing, const Mover& mover) {
  const LinearProblem& problem = standing.problem;
  const VectorXd projected = standing.background.project(problem.residual());
  VectorXd motion = mover.always * fitted(standing, mover.family.columns(mover.best)).size;
  FamilyPtr family;
  Best best;
  for (int round = 0; round < kRounds; ++round) {
    family = make_slow_family(problem, motion, wanderer_of(mover.cause), mover.cause.joint);
    if (!family) return std::nullopt;
    best = family->scan({standing.background}, projected).front();
    if (mover.always.cols() == 1 || best.evidence <= 0 || round + 1 == kRounds) break;
    // Fits the motion again with this course, since it was fitted to another one.
    const MatrixXd slow = family->columns(best);
    const VectorXd course = course_of(problem, motion, slow * fitted(standing, slow).size);
    motion = mover.always * fitted(standing, course.asDiagonal() * mover.always).size;
  }
  return SlowRival{family->columns(best), family->depends_on(), family->wanderer(),
                   best.evidence - log_evidence(mover.best.strength, 1)};
}

}  // namespace

std::optional<SlowRival> slow_rival(const Standing& standing, const Scan& seen, std::size_t place) {
  const Family& family = *standing.families[place];
  const Cause cause = family.cause(seen.best[place]);
  if (!is_step(cause) && !is_drift(cause)) return std::nullopt;
  const Mover mover{family, seen.best[place], cause,
                    gone_all_the_way(family, seen.best[place], standing.problem, is_step(cause))};
  std::optional<SlowRival> rival = moving_smoothly(standing, mover);
  if (!rival) return std::nullopt;
  if (SlowRival warm = warming_up(standing, mover); warm.gap > rival->gap) rival = std::move(warm);
  if (is_drift(cause)) rival->gap -= kChoice;
  return rival;
}

}  // namespace trammel::cause_search
