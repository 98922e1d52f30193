#include "server/diagnose/tell/slow_change.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/base/units.h"
#include "server/diagnose/tell/wording.h"
#include "server/diagnose/thresholds.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t kMostSteps = 6;  // with more steps the change is not stepwise
constexpr double kLeastLeft = 1e-9;    // share: rounding

/// Something that moves, and which of all columns are its functions.
struct Mover {
  std::string what;  // for people
  int joint = -1;    // 0-based, the joint of the zero
  std::vector<Index> columns;
};

/// The joint of a function of its zero: `q3`, `time`.
int joint_of(const Unnamed& one) {
  const auto on = std::find_if(one.depends_on.begin(), one.depends_on.end(),
                               [](const std::string& name) { return name.starts_with("q"); });
  return on == one.depends_on.end() ? -1 : std::stoi(on->substr(1)) - 1;
}

std::vector<Mover> movers_of(const SearchResult& found, Index nuisance) {
  std::vector<Mover> movers;
  Index next = nuisance;
  for (const Unnamed& one : found.unnamed) {
    const Index first = std::exchange(next, next + one.columns.cols());
    if (one.wanderer.empty()) continue;
    auto mover = std::find_if(movers.begin(), movers.end(),
                              [&](const Mover& m) { return m.what == one.wanderer; });
    if (mover == movers.end()) mover = movers.insert(mover, {one.wanderer, joint_of(one), {}});
    for (Index k = first; k < next; ++k) mover->columns.push_back(k);
  }
  return movers;
}

/// The strength that a step along `always` from each pose on explains; none at the first.
VectorXd explained_from(const LinearProblem& problem, const VectorXd& always,
                        const Background& rest, const VectorXd& data) {
  const VectorXd projected = rest.project(data);
  VectorXd explained = VectorXd::Zero(problem.poses());
  VectorXd shared = VectorXd::Zero(rest.root().cols());
  double along = 0;
  double own = 0;
  for (Index i = problem.poses() - 1; i >= 1; --i) {
    const Index row = problem.first_row(i);
    const Index count = problem.row_count(i);
    const auto way = always.segment(row, count);
    along += way.dot(projected.segment(row, count));
    own += way.squaredNorm();
    shared.noalias() += rest.root().middleRows(row, count).transpose() * way;
    explained(i) = along * along / (1 + std::max(0.0, own - shared.squaredNorm()));
  }
  return explained;
}

/// The size of the motion by its function: rad for a joint's zero, m for anything else.
double size_of(const LinearProblem& problem, const Mover& mover, const VectorXd& effect) {
  if (mover.joint < 0) return problem.positions(effect).colwise().norm().maxCoeff();
  double low = 0;
  double high = 0;
  for (Index i = 0; i < problem.poses(); ++i) {
    const auto way =
        problem.by_joint().col(mover.joint).segment(problem.first_row(i), problem.row_count(i));
    if (!(way.squaredNorm() > 0)) continue;
    const double gone =
        way.dot(effect.segment(problem.first_row(i), problem.row_count(i))) / way.squaredNorm();
    low = std::min(low, gone);
    high = std::max(high, gone);
  }
  return high - low;
}

std::string size_said(const Mover& mover, double size) {
  return mover.joint < 0 ? fmt::format("{:.2g} mm", to_mm(size))
                         : fmt::format("{:.2g} deg", to_deg(size));
}

bool is_more_than_warmth(const Mover& mover, double size) {
  return size > (mover.joint < 0 ? thresholds::kWarmthMoves : thresholds::kWarmthTurns);
}

/// One mover in words, by its course and its size.
std::string said(const LinearProblem& problem, const Background& all, const Mover& mover,
                 double size) {
  if (mover.joint >= 0) {
    std::vector<Index> others;
    for (Index k = 0; k < all.columns().cols(); ++k) {
      if (std::find(mover.columns.begin(), mover.columns.end(), k) == mover.columns.end())
        others.push_back(k);
    }
    const Background rest = all.part(others);
    const VectorXd always =
        problem.by_joint().col(mover.joint);  // per rad: nothing is expected of its size
    const VectorXd& data = problem.residual();
    const auto steps =
        steps_along(problem, always, rest, data, data.dot(VectorXd(all.project(data))));
    std::vector<std::string> poses;
    for (const Index i : steps)
      poses.push_back(problem.batch().measurements[static_cast<std::size_t>(i)].pose_id);
    if (!poses.empty())
      return fmt::format(
          "{} moved in steps, by {} in all, from pose{} {} on: it slips, as brakes and couplings "
          "do",
          mover.what, size_said(mover, size), poses.size() > 1 ? "s" : "", fmt::join(poses, ", "));
  }
  if (is_more_than_warmth(mover, size))
    return fmt::format(
        "{} moved by {} while the batch was measured, which is more than parts move that warm up",
        mover.what, size_said(mover, size));
  return fmt::format(
      "{} moved slowly while the batch was measured, by {}, as parts do that warm up", mover.what,
      size_said(mover, size));
}

}  // namespace

std::vector<Index> steps_along(const LinearProblem& problem, const VectorXd& always,
                               const Background& rest, const VectorXd& data, double smooth_leaves) {
  // Twice the log likelihood of the residual; the noise is estimated from the data as well.
  const auto gain = [&](double from, double to) {
    return static_cast<double>(data.size()) * std::log(from / to);
  };
  const double price =
      2 * std::log(static_cast<double>(problem.poses())) + 2 * thresholds::kUnnamedMargin;
  MatrixXd columns = rest.columns();
  double left = data.dot(VectorXd(rest.project(data)));
  std::vector<Index> steps;
  while (steps.size() <= kMostSteps) {
    Index at = 0;
    const double gained = explained_from(problem, always, Background(columns), data).maxCoeff(&at);
    const double leaves = std::max(left - gained, kLeastLeft * left);
    if (gain(left, leaves) < price) break;
    left = leaves;
    steps.push_back(at);
    columns.conservativeResize(Eigen::NoChange, columns.cols() + 1);
    columns.rightCols(1) = always;
    columns.rightCols(1).topRows(problem.first_row(at)).setZero();
  }
  const bool is_better = gain(smooth_leaves, left) > static_cast<double>(steps.size()) * price;
  if (steps.size() > kMostSteps || !is_better) return {};
  std::sort(steps.begin(), steps.end());
  // A change that began so near to the first pose was always there.
  std::erase_if(steps, [&](Index at) {
    return static_cast<double>(at) < thresholds::kAtOnce * static_cast<double>(problem.poses());
  });
  return steps;
}

std::string what_moves(const SearchResult& found, const LinearProblem& problem,
                       const Background& all, const Surrogates& unrecorded) {
  const VectorXd numbers = all.estimate(problem.residual());
  std::vector<std::string> said_of;
  for (const Mover& mover : movers_of(found, problem.nuisance().cols())) {
    const VectorXd effect =
        all.columns()(Eigen::all, mover.columns) * VectorXd(numbers(mover.columns));
    said_of.push_back(said(problem, all, mover, size_of(problem, mover, effect)));
  }
  if (said_of.empty()) return "";
  return fmt::format("{}; {}", fmt::join(said_of, ", and "), what_slow_changes_need(unrecorded));
}

}  // namespace trammel::cause_search
