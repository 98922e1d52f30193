#include "server/plan/plan.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <tuple>

#include "server/plan/approach.h"
#include "server/plan/clearance.h"
#include "server/plan/contact_posture.h"
#include "server/plan/optimal_design.h"
#include "server/plan/visibility.h"
#include "server/robot/passive_joint.h"

namespace trammel {

Result<JointRanges> planning_ranges(const Cell& cell) {
  if (!cell.joint_ranges.empty()) return cell.joint_ranges;
  JointRanges ranges;
  for (int i = 0; i < cell.robot.size(); ++i) {
    const Joint& joint = cell.robot.joint(i);
    if (!std::isfinite(joint.lower) || !std::isfinite(joint.upper)) {
      return refused("cell {}: joint {} has no limits", cell.name, i + 1)
          .of("joint_ranges_deg")
          .next(
              "give joint_ranges_deg; or, where bars hold the joint and nobody commands it, write "
              "passive: true in its row of the robot file");
    }
    ranges.emplace_back(joint.lower, joint.upper);
  }
  return ranges;
}

Eigen::MatrixXd latin_hypercube(const JointRanges& ranges, int count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  Eigen::MatrixXd q(count, static_cast<Eigen::Index>(ranges.size()));
  std::vector<int> slice(static_cast<std::size_t>(count));
  for (std::size_t j = 0; j < ranges.size(); ++j) {
    std::iota(slice.begin(), slice.end(), 0);
    std::shuffle(slice.begin(), slice.end(), random);
    for (int i = 0; i < count; ++i) {
      const double share = (slice[static_cast<std::size_t>(i)] + unit(random)) / count;
      q(i, static_cast<Eigen::Index>(j)) =
          ranges[j].first + share * (ranges[j].second - ranges[j].first);
    }
  }
  return q;
}

namespace {

constexpr int kCandidates = 4000;  // candidates to choose from: the time of a plan grows with them
constexpr int kCheckCandidates = 800;      // likewise, of a check: each is held against every cause
constexpr int kWorkingPoses = 200;         // poses over which the size of an effect is measured
constexpr int kCandidatesForEachPose = 4;  // at least: fewer leave hardly a choice
// The factor by which a hypercube is drawn larger than wanted at most.
constexpr int kLargestFactor = 512;  // of poses: fewer than 1 in 1000 fits then
constexpr int kLargestDesignFactor =
    64;  // factor on the candidates: they are numerous already, and each is linearised

/// The poses that the cell allows, for every tool that will be used.
class Filter {
 public:
  static Result<Filter> of(const Cell& cell, const std::vector<std::string>& tools) {
    Filter filter(cell);
    for (const std::string& tool : tools) {
      filter.X_FT_.push_back(cell.tools.at(tool).value_or(Pose::Identity()));
      Visibility visibility = TRY(Visibility::of(cell, tool));
      filter.visibility_.push_back(std::move(visibility));
      filter.clearance_.emplace_back(cell, tool);
    }
    return filter;
  }

  /// True if the candidate may be planned and approached in each of these ways. Counts the
  /// candidate.
  bool keeps(const JointVector& q, const std::vector<Sides>& ways, DrawCount& count) const {
    ++count.drawn;
    std::vector<JointVector> visited = {q};
    for (const Sides& sides : ways) {
      const std::optional<JointVector> bump = bump_pose(cell_.robot, q, sides);
      if (!bump) return ++count.no_way, false;
      visited.push_back(*bump);
    }
    const auto inside = [&](const JointVector& v) { return inside_workspace(v); };
    if (!std::all_of(visited.begin(), visited.end(), inside)) return ++count.outside, false;
    const auto touches = [&](const JointVector& v) {
      return std::any_of(clearance_.begin(), clearance_.end(),
                         [&](const Clearance& one) { return one.touch_at(v).has_value(); });
    };
    if (std::any_of(visited.begin(), visited.end(), touches)) return ++count.touching, false;
    const auto sees = [&](const Visibility& visibility) { return visibility.sees(q); };
    if (!std::all_of(visibility_.begin(), visibility_.end(), sees)) return ++count.unseen, false;
    return ++count.kept, true;
  }

 private:
  explicit Filter(const Cell& cell) : cell_(cell) {}

  /// Inside the workspace by the nominal robot.
  bool inside_workspace(const JointVector& q) const {
    if (!cell_.workspace) return true;
    const Pose X_BF = cell_.robot.flange_pose(q);
    return std::all_of(X_FT_.begin(), X_FT_.end(), [&](const Pose& X_FT) {
      const Vector3 p = X_BF * X_FT.translation();
      return (p.array() >= cell_.workspace->lower.array()).all() &&
             (p.array() <= cell_.workspace->upper.array()).all();
    });
  }

  const Cell& cell_;
  std::vector<Pose> X_FT_;
  std::vector<Visibility> visibility_;
  std::vector<Clearance> clearance_;
};

struct Drawn {
  std::vector<JointVector> q;
  DrawCount count;
};

/// `wanted` joint vectors that pass the filter, from a Latin hypercube. The hypercube doubles until
/// it is large enough, up to `largest_factor` times as many as wanted. Refuses if even the largest
/// one has fewer than `needed`. `prepare` gives the joints to try in place of the drawn ones, if
/// there are any. `ways_of` gives the approaches of the next one, by its number.
template <typename Prepare, typename WaysOf>
Result<Drawn> draw(const Cell& cell, const Filter& filter, int wanted, int needed,
                   int largest_factor, std::uint64_t seed, const Prepare& prepare,
                   const WaysOf& ways_of) {
  const JointRanges ranges = TRY(planning_ranges(cell));
  Drawn drawn;
  for (int factor = 1; factor <= largest_factor && static_cast<int>(drawn.q.size()) < wanted;
       factor *= 2) {
    drawn = {};
    const Eigen::MatrixXd candidates = latin_hypercube(ranges, wanted * factor, seed);
    for (Eigen::Index i = 0; i < candidates.rows(); ++i) {
      JointVector q = candidates.row(i).transpose();
      if (cell.robot.joint_outside_limits(q)) {
        ++drawn.count.drawn;
        ++drawn.count.no_way;
        continue;
      }
      std::optional<JointVector> prepared = prepare(std::move(q));
      if (!prepared) {
        ++drawn.count.drawn;
        ++drawn.count.no_way;
        continue;
      }
      if (filter.keeps(*prepared, ways_of(*prepared, drawn.q.size()), drawn.count))
        drawn.q.push_back(std::move(*prepared));
    }
  }
  const DrawCount& count = drawn.count;
  if (count.kept < needed) {
    return refused(
               "cell {}: of {} poses drawn from the joint ranges {} can be measured, {} are "
               "needed; {} leave the workspace, {} touch a stated obstacle, {} are out of the "
               "tracker's sight, {} are beyond a joint limit or too near to it to be approached",
               cell.name, count.drawn, count.kept, needed, count.outside, count.touching,
               count.unseen, count.no_way)
        .of("count")
        .beyond(count.kept, needed);
  }
  drawn.q.resize(static_cast<std::size_t>(std::min(wanted, count.kept)));
  return drawn;
}

Status check_count(const PlanOptions& options) {
  if (options.count >= 1) return {};
  return failure(ErrorCode::kUsage, "a plan of {} poses, at least 1 is needed", options.count)
      .of("--count")
      .beyond(options.count, 1);
}

/// The settings that all poses of a plan share.
struct Planning {
  std::shared_ptr<const Cell> cell;
  std::vector<std::string> tools, payloads;
  bool twice = false;    // each pose from above and from below
  bool one_way = false;  // each pose from below

  /// The ways to approach the pose with this number.
  [[nodiscard]] std::vector<Sides> ways(const JointVector& q, std::size_t number) const {
    const auto joints = static_cast<std::size_t>(q.size());
    if (twice) return {Sides(joints, -1), Sides(joints, 1)};
    if (one_way) return {Sides(joints, 1)};
    return {possible_sides(cell->robot, q, planned_sides(cell->robot, static_cast<int>(number)))};
  }
};

Result<std::vector<std::string>> resolved(const Cell& cell, const std::vector<std::string>& asked,
                                          Result<std::string> (*resolve)(const Cell&,
                                                                         const std::string&)) {
  std::vector<std::string> names;
  for (const std::string& name : asked.empty() ? std::vector<std::string>{""} : asked) {
    const std::string known = TRY(resolve(cell, name));
    names.push_back(known);
  }
  return names;
}

/// Each pose once for each way of approach. Tools and payloads take turns.
std::vector<PoseContext> contexts_of(const Planning& planning, const std::vector<JointVector>& q) {
  std::vector<PoseContext> contexts;
  for (std::size_t i = 0; i < q.size(); ++i) {
    for (Sides& sides : planning.ways(q[i], i)) {
      PoseContext context;
      context.q = q[i];
      context.direction = std::move(sides);
      context.tool = planning.tools[i % planning.tools.size()];
      context.payload = planning.payloads[i / planning.tools.size() % planning.payloads.size()];
      contexts.push_back(std::move(context));
    }
  }
  return contexts;
}

/// Gives each chosen pose the sides of its place in the plan, if the arm stays in the workspace on
/// the way. Otherwise the choice would leave some joint more often on one side.
void come_in_turn(const Planning& planning, const Filter& filter, std::vector<PoseContext>& poses) {
  if (planning.twice) return;
  DrawCount count;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    std::vector<Sides> ways = planning.ways(poses[i].q, i);
    if (filter.keeps(poses[i].q, ways, count)) poses[i].direction = std::move(ways.front());
  }
}

std::vector<PlannedPose> planned(const Planning& planning, std::vector<PoseContext> contexts) {
  const std::size_t ways = planning.twice ? 2 : 1;
  std::vector<std::size_t> order(contexts.size() / ways);
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    const PoseContext& left = contexts[a * ways];
    const PoseContext& right = contexts[b * ways];
    return std::tie(left.tool, left.payload) < std::tie(right.tool, right.payload);
  });
  std::vector<PlannedPose> poses;
  for (std::size_t i = 0; i < order.size(); ++i) {
    for (std::size_t way = 0; way < ways; ++way) {
      PlannedPose pose;
      pose.context = std::move(contexts[order[i] * ways + way]);
      pose.id = fmt::format("{}{}", i + 1,
                            ways == 1                            ? ""
                            : pose.context.direction.front() > 0 ? "+"
                                                                 : "-");
      pose.context.index = static_cast<int>(poses.size());
      const Chain& robot = planning.cell->robot;
      pose.bump =
          on_program_grid(robot, bump_pose(robot, pose.context.q, pose.context.direction).value());
      for (int j = 0; j < robot.size(); ++j)
        if (is_passive(robot.joint(j))) pose.context.direction[static_cast<std::size_t>(j)] = 0;
      poses.push_back(std::move(pose));
    }
  }
  return poses;
}

Result<CausePair> pair_of(const Planning& planning, const PlanOptions& options) {
  if (options.criterion == PlanCriterion::kSeparation) {
    return make_cause_pair(planning.cell, options.cause, options.other);
  }
  PhysicalModel model = TRY(make_physical_model(planning.cell, planning.cell->model.error_sources));
  if (model.parameter_count() == 0)
    return refused("cell {}: its model has no error sources", planning.cell->name)
        .of("error_sources");
  model.values = planning_values(model);
  return CausePair{std::move(model), "", "", {}, {}};
}

Plan::Separation separation_of(const CausePair& pair, const Separability& plan,
                               const Separability& latin_hypercube,
                               const Separability& candidates) {
  Plan::Separation separation{plan, latin_hypercube, candidates, {}, ""};
  const auto shows = [](const ParameterSeparation& parameter) { return parameter.effect > 0; };
  const bool any_shows =
      std::any_of(candidates.parameters.begin(), candidates.parameters.end(), shows);
  for (const ParameterSeparation& parameter : candidates.parameters) {
    // The order of a gear's error shows only once its amplitude is known, so the plan does not
    // optimise it.
    if (any_shows && !shows(parameter)) continue;
    const bool told = parameter.strength >= kLeastStrength && parameter.share >= kLeastShare;
    if (!told) separation.hopeless.push_back(parameter.parameter);
  }
  if (!separation.hopeless.empty()) separation.needs = what_would_separate(pair.cause, pair.other);
  return separation;
}

/// Chooses among `candidates`, and compares with `latin_hypercube`.
Result<Plan> designed(const Planning& planning, const PlanOptions& options, const Filter& filter,
                      const Drawn& candidates, const Drawn& latin_hypercube) {
  const CausePair pair = TRY(pair_of(planning, options));
  const int ways = planning.twice ? 2 : 1;
  const std::vector<PoseContext> contexts = contexts_of(planning, candidates.q);
  const DesignCandidates rows = design_candidates(pair.model, contexts, options.orientation, ways);
  const Eigen::Index P = rows.rows.cols();
  const Eigen::MatrixXd prior = Eigen::MatrixXd::Identity(P, P);
  const Design design = TRY(optimal_design(rows, prior, options.count, pair.rest));

  std::vector<PoseContext> chosen;
  for (const std::size_t i : design.chosen) {
    const auto first = contexts.begin() + static_cast<std::ptrdiff_t>(i) * ways;
    chosen.insert(chosen.end(), first, first + ways);
  }
  come_in_turn(planning, filter, chosen);
  const auto information = [&](const std::vector<PoseContext>& poses) {
    return information_of(pair.model, poses, options.orientation);
  };
  const auto criterion = [&](const Eigen::MatrixXd& told) {
    const Eigen::MatrixXd known = prior + told;
    return log_det(known) - (pair.rest.empty() ? 0 : log_det(known(pair.rest, pair.rest)));
  };
  const Eigen::MatrixXd of_plan = information(chosen);
  const Eigen::MatrixXd evenly = information(contexts_of(planning, latin_hypercube.q));
  Plan plan;
  plan.draw = candidates.count;
  plan.criterion = criterion(of_plan);
  plan.criterion_of_latin_hypercube = criterion(evenly);
  if (options.criterion == PlanCriterion::kSeparation) {
    const auto told = [&](const Eigen::MatrixXd& known) { return separability(pair, known); };
    plan.separation =
        separation_of(pair, told(of_plan), told(evenly), told(rows.rows.transpose() * rows.rows));
  }
  plan.poses = planned(planning, std::move(chosen));
  return plan;
}

/// Chooses among `candidates`. They also represent the poses at which the cell works.
Result<Plan> planned_check(const Planning& planning, const PlanOptions& options,
                           const Filter& filter, const Drawn& candidates) {
  const CausePair pair = TRY(pair_of(planning, options));
  const std::vector<PoseContext> contexts = contexts_of(planning, candidates.q);
  const CauseEffects effects(pair.model, contexts);
  const auto working = std::min(contexts.size(), static_cast<std::size_t>(kWorkingPoses));
  const WorkingPoses work(
      effects, {contexts.begin(), contexts.begin() + static_cast<std::ptrdiff_t>(working)}, false);
  CheckTest test;
  test.sigma = planning.cell->tracker.sigma;
  test.sigma_rotation = planning.cell->tracker.sigma_rotation;
  test.orientation = options.orientation;
  const std::vector<CauseSignal> signals = work.signals(effects, options.seed);
  const CheckDesign design = TRY(check_design(effects, signals, contexts, options.count, test));
  std::vector<PoseContext> chosen;
  for (const std::size_t i : design.chosen) chosen.push_back(contexts[i]);
  come_in_turn(planning, filter, chosen);
  Plan plan;
  plan.draw = candidates.count;
  plan.smallest = smallest_effects(effects, signals, chosen, test);
  plan.poses = planned(planning, std::move(chosen));
  return plan;
}

/// The drawn joints as a program has them, with the tip at the point of contact if there is one.
std::optional<JointVector> planned_joints(const Planning& planning, const PlanOptions& options,
                                          JointVector q) {
  const Chain& robot = planning.cell->robot;
  if (!options.contact_B) return on_program_grid(robot, std::move(q));
  const std::optional<Pose>& X_FT = planning.cell->tools.at(planning.tools.front());
  const Vector3 p_F = X_FT ? Vector3(X_FT->translation()) : Vector3::Zero();
  std::optional<JointVector> met = contact_posture(robot, p_F, *options.contact_B, std::move(q));
  if (!met) return std::nullopt;
  return on_program_grid(robot, std::move(*met));
}

}  // namespace

Result<Eigen::MatrixXd> plan_poses(const Cell& cell, const PlanOptions& options) {
  TRY(check_count(options));
  const Filter filter = TRY(Filter::of(cell, {cell.tools.begin()->first}));
  const Drawn drawn = TRY(draw(
      cell, filter, options.count, options.count, kLargestFactor, options.seed,
      [](JointVector q) { return q; },
      [](const JointVector&, std::size_t) { return std::vector<Sides>(); }));
  Eigen::MatrixXd q(options.count, cell.robot.size());
  for (Eigen::Index i = 0; i < q.rows(); ++i)
    q.row(i) = drawn.q[static_cast<std::size_t>(i)].transpose();
  return q;
}

Result<std::vector<bool>> plannable(const Cell& cell, const Eigen::MatrixXd& q) {
  const Filter filter = TRY(Filter::of(cell, {cell.tools.begin()->first}));
  const JointRanges ranges = TRY(planning_ranges(cell));
  DrawCount count;
  std::vector<bool> may(static_cast<std::size_t>(q.rows()), true);
  for (Eigen::Index i = 0; i < q.rows(); ++i) {
    const JointVector one = q.row(i).transpose();
    bool inside = !cell.robot.joint_outside_limits(one);
    for (std::size_t j = 0; j < ranges.size(); ++j) {
      const double at = one(static_cast<Eigen::Index>(j));
      inside = inside && at >= ranges[j].first && at <= ranges[j].second;
    }
    const auto comes = [&](int side) {
      const Sides sides =
          possible_sides(cell.robot, one, Sides(static_cast<std::size_t>(one.size()), side));
      return filter.keeps(one, {sides}, count);
    };
    may[static_cast<std::size_t>(i)] = inside && (comes(-1) || comes(1));
  }
  return may;
}

namespace {

Result<Plan> chosen_plan(const std::shared_ptr<const Cell>& cell, const PlanOptions& options) {
  TRY(check_count(options));
  if (options.criterion == PlanCriterion::kCheck && options.bidirectional) {
    return failure(ErrorCode::kUsage, "a check takes each pose once").of("--bidirectional");
  }
  if (options.one_way && options.bidirectional)
    return failure(ErrorCode::kUsage, "each pose from both sides, and one way").of("--one-way");
  const auto tools = TRY(resolved(*cell, options.tools, resolve_tool));
  if (options.contact_B && tools.size() > 1)
    return failure(ErrorCode::kUsage, "contacts are planned for one tool, not {}", tools.size())
        .of("--tool");
  const auto payloads = TRY(resolved(*cell, options.payloads, resolve_payload));
  const Planning planning{cell, tools, payloads, options.bidirectional, options.one_way};
  const Filter filter = TRY(Filter::of(*cell, planning.tools));
  const auto drawn = [&](int wanted, int largest_factor) {
    return draw(
        *cell, filter, wanted, options.count, largest_factor, options.seed,
        [&](JointVector q) { return planned_joints(planning, options, std::move(q)); },
        [&](const JointVector& q, std::size_t number) { return planning.ways(q, number); });
  };
  const Drawn latin_hypercube = TRY(drawn(options.count, kLargestFactor));
  if (options.criterion == PlanCriterion::kLatinHypercube) {
    return Plan{planned(planning, contexts_of(planning, latin_hypercube.q)),
                latin_hypercube.count,
                0,
                0,
                {},
                {}};
  }
  const bool check = options.criterion == PlanCriterion::kCheck;
  const Drawn candidates = TRY(drawn(
      std::max(check ? kCheckCandidates : kCandidates, kCandidatesForEachPose * options.count),
      kLargestDesignFactor));
  if (check) return planned_check(planning, options, filter, candidates);
  return designed(planning, options, filter, candidates, latin_hypercube);
}

}  // namespace

Result<Plan> make_plan(const std::shared_ptr<const Cell>& cell, const PlanOptions& options) {
  Plan plan = TRY(chosen_plan(cell, options));
  plan.clear_of = obstacles_in_words(*cell);
  return plan;
}

}  // namespace trammel
