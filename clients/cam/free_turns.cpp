#include "clients/cam/free_turns.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "clients/cam/nominal_targets.h"
#include "clients/cam/receipt.h"
#include "server/base/units.h"
#include "server/exchange/si.h"
#include "server/robot/free_turn.h"

namespace trammel::cam {

namespace {

constexpr double kWorthAPathsTurn = 0.98;     // of the sum of squared sigmas without
constexpr double kLongerWay = 1.5;            // of a joint between two targets
constexpr double kShortWay = from_deg(5);     // that any joint may have
constexpr double kWayUnknown = from_deg(30);  // of a joint, if the previous one is not known

/// The answer for a target with the tool turned.
struct Outcome {
  std::string status, doubt;
  double sigma_mm = kNotKnown;
  std::optional<JointVector> q;  ///< corrected; empty: it stays unchanged
};

/// Targets that turn together, and the steps from one to the next.
struct TurningPath {
  std::vector<std::size_t> targets;
  std::vector<std::pair<std::size_t, std::size_t>> steps;
  bool stays = false;  ///< one of the targets stays unchanged
};

/// Joins numbers. All joined numbers have a common root.
class Joined {
 public:
  explicit Joined(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
  }
  std::size_t root(std::size_t one) {
    while (parent_[one] != one) one = parent_[one] = parent_[parent_[one]];
    return one;
  }
  void join(std::size_t a, std::size_t b) { parent_[root(a)] = root(b); }

 private:
  std::vector<std::size_t> parent_;
};

std::vector<TurningPath> paths_of(const Program& program) {
  Joined joined(program.targets.size());
  std::vector<std::pair<std::size_t, std::size_t>> steps;
  const auto is_pose = [&](std::size_t t) { return !is_joints(program.targets[t].coordinates); };
  std::optional<std::size_t> before;
  std::vector<std::size_t> broken;  // targets beside one that stays unchanged
  for (std::size_t m = 0; m < program.moves.size(); ++m) {
    const ProgramMove& move = program.moves[m];
    if (m > 0 && program.moves[m - 1].file != move.file) before.reset();
    if (move.left_some) {
      if (before) broken.push_back(*before);
      broken.insert(broken.end(), move.targets.begin(), move.targets.end());
      before.reset();
    }
    for (const std::size_t t : move.targets) {
      if (!is_pose(t)) {
        before.reset();
        continue;
      }
      if (before && program.targets[t].linear) {
        joined.join(*before, t);
        steps.emplace_back(*before, t);
      }
      if (t != move.targets.front() && is_pose(move.targets.front()))
        joined.join(move.targets.front(), t);
      before = t;
    }
  }
  std::map<std::size_t, TurningPath> paths;
  for (std::size_t t = 0; t < program.targets.size(); ++t) {
    if (is_pose(t)) paths[joined.root(t)].targets.push_back(t);
  }
  for (const auto& step : steps) paths[joined.root(step.first)].steps.push_back(step);
  for (const std::size_t t : broken) {
    if (is_pose(t)) paths[joined.root(t)].stays = true;
  }
  std::vector<TurningPath> all;
  for (auto& [root, path] : paths) all.push_back(std::move(path));
  return all;
}

class Turning {
 public:
  Turning(const Program& program, const ArmOfProgram& arm, const CellTools& cell,
          const AskCorrections& ask, const std::string& tool, const std::string& payload)
      : program_(program), arm_(arm), cell_(cell), ask_(ask), tool_(tool), payload_(payload) {
    made_.program = program;
    made_.deg.assign(program.targets.size(), 0);
  }

  Result<FreeTurns> turn() {
    const std::vector<TurningPath> paths = paths_of(program_);
    std::vector<Outcome> outcomes = TRY(outcomes_at(0));
    as_it_is_ = std::move(outcomes);
    std::vector<int> best(paths.size(), 0);
    std::vector<double> least;
    for (const TurningPath& path : paths) least.push_back(worth_turning(path));
    for (int step = -kFreeTurns; step <= kFreeTurns; ++step) {
      if (step == 0) continue;
      const std::vector<Outcome> turned = TRY(outcomes_at(step));
      for (std::size_t p = 0; p < paths.size(); ++p) {
        const double now = spread(paths[p], turned);
        if (!(now < least[p]) || !may_turn(paths[p], turned)) continue;
        least[p] = now;
        best[p] = step;
      }
    }
    for (std::size_t p = 0; p < paths.size(); ++p) {
      for (const std::size_t t : paths[p].targets) set(t, best[p]);
    }
    return std::move(made_);
  }

 private:
  void set(std::size_t t, int step) {
    const ProgramTarget& target = program_.targets[t];
    if (is_joints(target.coordinates)) return;
    made_.program.targets[t].numbers =
        step == 0 ? target.numbers
                  : numbers_of(target.coordinates,
                               turned_freely(pose_of(target.coordinates, target.numbers), step),
                               target.numbers);
    made_.deg[t] = to_deg(step * kFreeTurn);
  }

  Result<std::vector<Outcome>> outcomes_at(int step) {
    for (std::size_t t = 0; t < program_.targets.size(); ++t) set(t, step);
    const NominalTargets nominal =
        TRY(nominal_targets(made_.program, arm_, cell_, tool_, payload_));
    std::vector<Outcome> outcomes(program_.targets.size());
    for (const TargetGroup& group : groups_of(made_.program, nominal)) {
      std::vector<exchange::AskedTarget> targets;
      for (const std::size_t t : group.targets) targets.push_back(nominal.targets[t].asked);
      const auto answer = TRY(ask_(group.tool, group.payload, targets));
      for (std::size_t k = 0; k < group.targets.size(); ++k) {
        const std::size_t t = group.targets[k];
        const exchange::CorrectedTarget& item = answer.items[k];
        outcomes[t] = {item.status, nominal.targets[t].doubt, item.sigma_mm, std::nullopt};
        if (is_answered(item))
          outcomes[t].q = exchange::si_from_degrees(item.joints_deg, arm_.robot());
      }
    }
    return outcomes;
  }

  /// The sum of the squared sigmas; not a number if one of them is not known.
  static double spread(const TurningPath& path, const std::vector<Outcome>& outcomes) {
    double sum = 0;
    for (const std::size_t t : path.targets) {
      sum += outcomes[t].q ? outcomes[t].sigma_mm * outcomes[t].sigma_mm : kNotKnown;
    }
    return sum;
  }

  /// The limit that another turn must stay below. Any turn is better than one that leaves a target
  /// uncorrected.
  [[nodiscard]] double worth_turning(const TurningPath& path) const {
    const bool reached = std::all_of(path.targets.begin(), path.targets.end(),
                                     [&](std::size_t t) { return as_it_is_[t].q.has_value(); });
    return reached ? kWorthAPathsTurn * spread(path, as_it_is_)
                   : std::numeric_limits<double>::infinity();
  }

  [[nodiscard]] bool may_turn(const TurningPath& path, const std::vector<Outcome>& turned) const {
    if (path.stays) return false;
    for (const std::size_t t : path.targets) {
      const Outcome &was = as_it_is_[t], &now = turned[t];
      if (!now.q || now.doubt != (was.q ? was.doubt : "")) return false;
      if (was.q && now.status != was.status && now.status != "ok") return false;
      if (!stands_clear(arm_.robot(), *now.q)) return false;
      const std::vector<double> before = was.q ? arm_.to_axes(*was.q) : std::vector<double>();
      if (!keeps_configuration(program_.targets[t].configuration, before, arm_.to_axes(*now.q)))
        return false;
    }
    return std::all_of(path.steps.begin(), path.steps.end(), [&](const auto& step) {
      const auto& [from, to] = step;
      const double now = (*turned[to].q - *turned[from].q).cwiseAbs().maxCoeff();
      if (!as_it_is_[to].q || !as_it_is_[from].q) return now <= kWayUnknown;
      const double before = (*as_it_is_[to].q - *as_it_is_[from].q).cwiseAbs().maxCoeff();
      return now <= kLongerWay * before + kShortWay;
    });
  }

  const Program& program_;
  const ArmOfProgram& arm_;
  const CellTools& cell_;
  const AskCorrections& ask_;
  const std::string &tool_, &payload_;
  std::vector<Outcome> as_it_is_;
  FreeTurns made_;
};

}  // namespace

Result<FreeTurns> turn_freely(const Program& program, const ArmOfProgram& arm,
                              const CellTools& cell, const AskCorrections& ask,
                              const std::string& tool, const std::string& payload) {
  return Turning(program, arm, cell, ask, tool, payload).turn();
}

}  // namespace trammel::cam
