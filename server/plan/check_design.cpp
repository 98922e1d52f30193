#include "server/plan/check_design.h"

#include <algorithm>
#include <cmath>

namespace trammel {

namespace {

using Eigen::Index;

constexpr double kWorstCounts =
    4;  // power of the mean over the signals: towards the largest of them
constexpr double kWeakPrior =
    1e-6;  // of base and tool, per squared sigma: so that few poses have an invertible matrix
constexpr int kRounds = 3;                 // of exchanges
constexpr double kWorthAnExchange = 1e-3;  // of the criterion

/// Effects at one pose, over sigma: of base and tool (f columns) and of the signals (s columns).
struct Whitened {
  Eigen::MatrixXd frames;   // R x f
  Eigen::MatrixXd signals;  // R x s
};

Whitened whitened(const CauseEffects& effects, const std::vector<CauseSignal>& signals,
                  const PoseContext& pose, const CheckTest& test) {
  const PoseEffects at = effects.at(pose);
  const Index rows = test.orientation ? 6 : 3;
  Vector6 weight;
  weight << Vector3::Constant(1 / test.sigma), Vector3::Constant(1 / test.sigma_rotation);
  const std::vector<Index>& tool = effects.tool_columns();
  const auto tools = static_cast<Index>(test.new_tool ? tool.size() : 0);
  Eigen::MatrixXd frames(6, 6 + tools);
  frames.leftCols<6>() = at.by_base;
  if (tools > 0) frames.rightCols(tools) = at.by_cause(Eigen::all, tool);
  Eigen::MatrixXd moved(6, static_cast<Index>(signals.size()));
  for (Index s = 0; s < moved.cols(); ++s)
    moved.col(s) = signal_at(signals[static_cast<std::size_t>(s)], effects, at, pose.q);
  return {(weight.asDiagonal() * frames).topRows(rows),
          (weight.asDiagonal() * moved).topRows(rows)};
}

/// Sums over poses from which every signal's lambda follows: s² - b' A⁻¹ b.
struct Sums {
  Eigen::MatrixXd frames;  // f x f
  Eigen::MatrixXd shared;  // f x s
  Eigen::VectorXd square;  // s

  Sums(Index f, Index s)
      : frames(kWeakPrior * Eigen::MatrixXd::Identity(f, f)),
        shared(Eigen::MatrixXd::Zero(f, s)),
        square(Eigen::VectorXd::Zero(s)) {}
  void add(const Whitened& pose, double sign = 1) {
    frames.noalias() += sign * pose.frames.transpose() * pose.frames;
    shared.noalias() += sign * pose.frames.transpose() * pose.signals;
    square += sign * pose.signals.colwise().squaredNorm().transpose();
  }
  [[nodiscard]] Eigen::VectorXd strengths() const {
    const Eigen::LLT<Eigen::MatrixXd> factor(frames);
    const Eigen::MatrixXd half = factor.matrixL().solve(shared);
    return (square - half.colwise().squaredNorm().transpose()).cwiseMax(0.0);
  }
};

/// Small where every signal is seen well: sum of (needed / lambda)^4.
class NeededVariances {
 public:
  explicit NeededVariances(Eigen::VectorXd needed) : needed_(std::move(needed)) {}
  [[nodiscard]] double of(const Sums& sums) const {
    constexpr double kBlind = 1e-6;  // share of the needed strength
    const Eigen::ArrayXd strength = sums.strengths().array().max(kBlind * needed_.array());
    return (needed_.array() / strength).pow(kWorstCounts).sum();
  }
  [[nodiscard]] double with(const Sums& sums, const Whitened& pose) const {
    Sums more = sums;
    more.add(pose);
    return of(more);
  }

 private:
  Eigen::VectorXd needed_;
};

std::size_t best_of(const NeededVariances& criterion, const Sums& sums,
                    const std::vector<Whitened>& poses, const std::vector<bool>& taken,
                    double* value) {
  std::size_t best = 0;
  *value = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (taken[i]) continue;
    const double here = criterion.with(sums, poses[i]);
    if (here < *value) *value = here, best = i;
  }
  return best;
}

/// Removes one pose after the other and adds the best one instead.
void exchange(const NeededVariances& criterion, const std::vector<Whitened>& poses, Sums& sums,
              std::vector<bool>& taken, std::vector<std::size_t>& chosen) {
  double value = criterion.of(sums);
  for (int round = 0; round < kRounds; ++round) {
    const double before = value;
    for (std::size_t& one : chosen) {
      sums.add(poses[one], -1);
      taken[one] = false;
      one = best_of(criterion, sums, poses, taken, &value);
      sums.add(poses[one]);
      taken[one] = true;
    }
    if (value > (1 - kWorthAnExchange) * before) return;
  }
}

/// The lambda at which a test of so many numbers sees a signal.
double needed_strength(int freedom, const CheckTest& test) {
  const double size = smallest_seen({1.0e12}, freedom, test.false_alarm, test.power).value_or(1e-6);
  return size * size * 1e12;
}

std::vector<SmallestEffect> smallest_of(const CauseEffects& effects,
                                        const std::vector<CauseSignal>& signals,
                                        const Eigen::VectorXd& strengths, int poses,
                                        const CheckTest& test) {
  std::vector<SmallestEffect> smallest;
  for (std::size_t cause = 0; cause < effects.causes().size(); ++cause) {
    std::vector<double> own;
    for (std::size_t s = 0; s < signals.size(); ++s)
      if (signals[s].cause == cause) own.push_back(strengths(static_cast<Index>(s)));
    if (own.empty()) continue;
    const CauseEffects::Entry& entry = effects.causes()[cause];
    smallest.push_back(
        {entry.cause, smallest_seen(own, freedom_of(entry, poses), test.false_alarm, test.power)});
  }
  return smallest;
}

Sums sums_for(const CauseEffects& effects, const std::vector<CauseSignal>& signals,
              const CheckTest& test) {
  const auto tool = static_cast<Index>(test.new_tool ? effects.tool_columns().size() : 0);
  return {6 + tool, static_cast<Index>(signals.size())};
}

}  // namespace

int freedom_of(const CauseEffects::Entry& entry, int poses) {
  return entry.cause.any_function ? poses : static_cast<int>(entry.columns.size());
}

Result<CheckDesign> check_design(const CauseEffects& effects,
                                 const std::vector<CauseSignal>& signals,
                                 const std::vector<PoseContext>& candidates, int count,
                                 const CheckTest& test) {
  if (static_cast<int>(candidates.size()) < count) {
    return refused("a check of {} poses, {} can be measured", count, candidates.size())
        .of("--check")
        .beyond(count, candidates.size());
  }
  std::vector<Whitened> poses;
  for (const PoseContext& candidate : candidates)
    poses.push_back(whitened(effects, signals, candidate, test));
  Eigen::VectorXd needed(static_cast<Index>(signals.size()));
  for (Index s = 0; s < needed.size(); ++s) {
    const auto& entry = effects.causes()[signals[static_cast<std::size_t>(s)].cause];
    needed(s) = needed_strength(freedom_of(entry, count), test);
  }
  const NeededVariances criterion(needed);
  Sums sums = sums_for(effects, signals, test);
  std::vector<bool> taken(poses.size(), false);
  CheckDesign design;
  double value = 0;
  while (static_cast<int>(design.chosen.size()) < count) {
    const std::size_t best = best_of(criterion, sums, poses, taken, &value);
    sums.add(poses[best]);
    taken[best] = true;
    design.chosen.push_back(best);
  }
  exchange(criterion, poses, sums, taken, design.chosen);
  design.smallest = smallest_of(effects, signals, sums.strengths(), count, test);
  return design;
}

std::vector<SmallestEffect> smallest_effects(const CauseEffects& effects,
                                             const std::vector<CauseSignal>& signals,
                                             const std::vector<PoseContext>& poses,
                                             const CheckTest& test) {
  Sums sums = sums_for(effects, signals, test);
  for (const PoseContext& pose : poses) sums.add(whitened(effects, signals, pose, test));
  return smallest_of(effects, signals, sums.strengths(), static_cast<int>(poses.size()), test);
}

}  // namespace trammel
