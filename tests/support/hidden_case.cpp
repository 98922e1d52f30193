#include "tests/support/hidden_case.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "tests/support/hidden_columns.h"
#include "tests/support/hidden_files.h"
#include "tests/support/hidden_panel.h"

namespace trammel::hidden {

namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kOutlierAtHole28_mm = 0.45;
constexpr double kRipple = 28e-6;  // rad, section 6.3

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> parts;
  std::size_t begin = 0;
  for (std::size_t end = 0; end != std::string::npos; begin = end + 1) {
    end = text.find(at, begin);
    parts.push_back(text.substr(begin, end == std::string::npos ? end : end - begin));
  }
  return parts;
}

bool contains(const std::vector<std::string>& list, const std::string& word) {
  return std::find(list.begin(), list.end(), word) != list.end();
}

/// Same text, same number, on every machine.
std::uint64_t number_of(const std::string& text) {
  std::uint64_t hash = 1469598103934665603u;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211u;
  return hash;
}

/// A case while it is drawn.
struct Draft {
  const HiddenSpec& spec;
  Random random;
  World world;
  Belief belief;
  PosePlan plan;
  HiddenTruth truth;
  std::vector<std::string> names;  ///< of the effects to draw
  bool size_given = false;         ///< effects keep the size they are drawn with
  bool permuted = false;
};

/// Causes for mixtures: those that a cell with all three usual sources can have at scattered poses.
/// A drift is excluded, since a moved tracker makes three quarters of its effect.
const std::vector<std::string> kMixable = {
    "payload",         "tool",          "gear_transmission", "encoder_eccentricity",
    "joint_map",       "backlash",      "wrist_coupling",    "link_bending",
    "thermal_growth",  "tracker_moved", "joint_slip",        "tool_changed",
    "payload_changed", "outlier"};

std::vector<std::string> draw_mixture(int count, Random& random) {
  std::vector<std::string> names;
  while (static_cast<int>(names.size()) < count) {
    const std::string& name =
        kMixable[static_cast<std::size_t>(whole(random, 0, static_cast<int>(kMixable.size()) - 1))];
    if (!contains(names, name)) names.push_back(name);
  }
  return names;
}

/// Finds the effects and the question of a kind.
void understand(Draft& draft) {
  const std::string& kind = draft.spec.kind;
  draft.truth.kind = kind;
  if (contains(null_kinds(), kind)) {
    draft.truth.question = Question::kNothing;
    if (kind == "null_structured") draft.names = {"unknown"};
    while (kind == "null_permuted" && (draft.names.empty() || draft.names[0] == "outlier")) {
      draft.names = draw_mixture(1, draft.random);  // an outlier at another pose is one as well
    }
    draft.permuted = kind == "null_permuted";
  } else if (contains(unknown_kinds(), kind)) {
    draft.truth.question = Question::kUnknown;
    draft.names = {"unknown"};
  } else if (contains(slow_kinds(), kind) || contains(foreign_kinds(), kind)) {
    draft.truth.question = Question::kUnknown;
    draft.names = {kind};
  } else if (contains(undecidable_kinds(), kind)) {
    draft.truth.question = Question::kAbstain;
    draft.names = {kind};
    draft.size_given = !kind.ends_with("_or_link") && !kind.ends_with("_or_tracker") &&
                       !kind.ends_with("_or_tool");
  } else if (contains(replica_kinds(), kind)) {
    draft.names = {kind};
    draft.size_given = true;
    if (kind == "replica_tool") draft.truth.question = Question::kAbstain;
  } else if (kind == "mixture2" || kind == "mixture3") {
    draft.names = draw_mixture(kind.back() - '0', draft.random);
  } else {
    draft.names = split(kind, '+');
  }
}

/// Sets the sources of the cell and the measurement, so that the effects can be seen.
void arrange(Draft& draft) {
  const auto has = [&](const std::string& name) { return contains(draft.names, name); };
  World& world = draft.world;
  world.sources = {"base", "geometry", "compliance"};
  if (has("compliance")) world.sources = {"base", "geometry"};
  if (has("geometry") || has("tool_or_link") || has("replica_tool")) world.sources = {"base"};
  if (has("base")) world.sources = {};
  world.orientation = draft.spec.orientation;
  draft.plan = {.count = draft.spec.poses,
                .ranges = draft.spec.ranges,
                .validation_share = draft.spec.validation_share};
  if (has("time_lag")) draft.plan.course = Course::kPath;
  if (has("tool")) draft.plan.tools = 2;
  if (has("payload")) draft.plan.loads = 2;
  if (whole(draft.random, 0, 1) == 1) draft.plan.approach = Approach::kBothSides;
  if (has("hysteresis") || has("early_reading")) draft.plan.approach = Approach::kAsItComes;
  if (has("backlash_one_side")) draft.plan.approach = Approach::kFromBelow;
  if (has("constant_warmth") || has("slow_growth")) draft.plan.constant_temperature = true;
  if (has("replica_ripple_1dim")) draft.plan.ranges = "1dim";
  if (has("replica_ripple_6dim") || has("replica_tool")) draft.plan.ranges = "6dim-l";
  if (has("replica_p28")) world.orientation = false;
}

/// Realistic errors of an arm, in the groups that the cell identifies.
VectorXd draw_arm_errors(const std::vector<std::string>& sources, Random& random) {
  constexpr double kGive[kJoints] = {1e-10, 2.8e-10, 1.5e-9, 2e-9, 2.8e-9, 2.8e-9};  // rad/Nmm
  const auto& all = arm_parameters();
  VectorXd errors = VectorXd::Zero(static_cast<Index>(all.size()));
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (!contains(sources, all[k].group)) continue;
    const auto row = static_cast<Index>(k);
    errors(row) = all[k].group == "compliance"
                      ? kGive[all[k].name.at(1) - '1'] * std::exp(0.4 * normal(random))
                      : 0.15 * all[k].unit * normal(random);
  }
  return errors;
}

void build(Draft& draft) {
  World& world = draft.world;
  world.arm = changed(drawn_arm(), draw_arm_errors(world.sources, draft.random));
  draft.belief.tools = {motion({100, 0, 150}, 0, -std::numbers::pi / 4, 0),
                        motion({-80, 60, 220}, 0.7, 0.3, -0.5)};
  draft.belief.loads = {{100, {40, -25, 140}}, {45, {-15, 20, 90}}};
  draft.belief.knows_stand = contains(draft.names, "instrument_scale");
  draft.belief.tools.resize(static_cast<std::size_t>(draft.plan.tools));
  draft.belief.loads.resize(static_cast<std::size_t>(draft.plan.loads));
  world.tools = draft.belief.tools;
  world.loads = draft.belief.loads;
  world.poses = contains(draft.names, "replica_p28") ? panel_poses(world, draft.random)
                                                     : draw_poses(draft.plan, draft.random);
}

Effect one_parameter(const HiddenCause& cause, Index which, double size, const Scene& scene,
                     Random& random) {
  Effect made = draw_effect(cause, scene, random);
  made.values.setZero();
  made.values(which) = size;
  for (std::size_t k = 0; k < made.grows.size(); ++k)
    made.grows[k] = static_cast<Index>(k) == which;
  return made;
}

/// A tool error that the last link could also have, or that link's error.
Effect tool_or_link(const Scene& scene, Random& random) {
  struct Pair {
    const char* link;
    Index tool;
    double size;
  };
  constexpr Pair kPairs[] = {{"a6", 0, 0.2}, {"d6", 2, 0.2}, {"q6", 3, 3e-4}, {"alpha6", 5, 3e-4}};
  const Pair& pair = kPairs[whole(random, 0, 3)];
  if (whole(random, 0, 1) == 1)
    return draw_effect({"geometry", 0, pair.link, -1, {}}, scene, random);
  return one_parameter({"tool", 0, "", -1, {}}, pair.tool, pair.size, scene, random);
}

/// Joint 1 loses its zero, or the tracker turns about joint 1's axis.
Effect joint1_or_tracker(const Scene& scene, Random& random) {
  const auto count = static_cast<int>(scene.poses->size());
  const int first = whole(random, count / 4, 3 * count / 4);
  if (whole(random, 0, 1) == 1) return draw_effect({"joint_slip", 1, "", first, {}}, scene, random);
  Effect made = one_parameter({"tracker_moved", 0, "", first, {}}, 3, 5e-5, scene, random);
  made.act = [first](const MeasuringPose& p, const VectorXd& v, Moment& m) {
    if (p.index < first) return;
    m.seen = m.arm.base * motion(Vector3d::Zero(), v(3), 0, 0) * m.arm.base.inverse() * m.seen;
  };
  return made;
}

/// Joint 6 loses its zero, or the tool turns about joint 6's axis.
Effect joint6_or_tool(const Scene& scene, Random& random) {
  const auto count = static_cast<int>(scene.poses->size());
  const int first = whole(random, count / 4, 3 * count / 4);
  if (whole(random, 0, 1) == 1) return draw_effect({"joint_slip", 6, "", first, {}}, scene, random);
  return one_parameter({"tool_changed", 0, "", first, {}}, 3, 1e-4, scene, random);
}

/// Off in all that a last link can be off in.
Effect tool_absorbed(const Scene& scene, Random& random) {
  Effect made = draw_effect({"tool", 0, "", -1, {}}, scene, random);
  made.values(1) = 0;
  made.values(4) = 0;
  return made;
}

Effect ripple(int joint, const Scene& scene, Random& random) {
  Effect made = draw_effect({"gear_transmission", joint, "", -1, {}}, scene, random);
  made.values.head<2>() *= kRipple / made.values.head<2>().norm();
  made.values(2) = uniform(random, 40, 75);
  return made;
}

/// The spindle's data in the robot and in the offline program differ by some millimetres.
Effect other_tool(const Scene& scene, Random& random) {
  Effect made = draw_effect({"tool", 0, "", -1, {}}, scene, random);
  for (Index k = 0; k < 3; ++k)
    made.values(k) = uniform(random, 0.8, 2.5) * (whole(random, 0, 1) == 1 ? 1 : -1);
  for (Index k = 3; k < 6; ++k) made.values(k) = 2e-3 * normal(random);
  return made;
}

Effect hole_28(const Scene& scene, Random& random) {
  Effect made = draw_effect({"outlier", 0, "", 27, {}}, scene, random);
  made.values << -kOutlierAtHole28_mm, 0.03 * normal(random), 0.03 * normal(random);
  return made;
}

Effect draw_named(const std::string& name, const Draft& draft, const Scene& scene, Random& random) {
  if (name == "unknown") {
    const bool pair = draft.spec.kind == "unknown_q2q3" ||
                      (draft.spec.kind == "null_structured" && whole(random, 0, 1));
    const std::vector<std::string> joints =
        pair ? std::vector<std::string>{"q2", "q3"} : std::vector<std::string>{"q4"};
    return draw_effect({"unknown", 0, "", -1, joints}, scene, random);
  }
  if (contains(slow_kinds(), name)) return draw_slow_effect(name, scene, random);
  if (contains(foreign_kinds(), name)) return draw_foreign_effect(name, scene, random);
  if (name == "backlash_one_side")
    return draw_effect(draw_cause("backlash", scene, random), scene, random);
  if (name == "payload_alone")
    return one_parameter({"payload", 0, "", -1, {}}, 0, 8, scene, random);
  if (name == "constant_warmth")
    return draw_effect({"thermal_growth", 0, "", -1, {}}, scene, random);
  if (name == "tool_or_link") return tool_or_link(scene, random);
  if (name == "tool_absorbed") return tool_absorbed(scene, random);
  if (name == "joint1_or_tracker") return joint1_or_tracker(scene, random);
  if (name == "joint6_or_tool") return joint6_or_tool(scene, random);
  if (name == "replica_ripple_1dim") return ripple(3, scene, random);
  if (name == "replica_ripple_6dim") return ripple(whole(random, 1, 3), scene, random);
  if (name == "replica_tool") return other_tool(scene, random);
  if (name == "replica_p28") return hole_28(scene, random);
  return draw_effect(draw_cause(name, scene, random), scene, random);
}

void draw_effects(Draft& draft) {
  World& world = draft.world;
  Scene scene{world.arm, &world.poses, draft.plan.tools, draft.plan.loads,
              !contains(draft.names, "backlash_one_side")};
  scene.arm.tool = world.tools.front();
  scene.arm.load = world.loads.front();
  for (const std::string& name : draft.names) {
    world.effects.push_back(draw_named(name, draft, scene, draft.random));
    draft.truth.causes.push_back(world.effects.back().cause);
  }
}

/// Columns scaled to a length of one thousand sigma, so that all that are not zero count as
/// directions.
MatrixXd lengthened(MatrixXd columns) {
  for (Index k = 0; k < columns.cols(); ++k)
    columns.col(k) *= 1e3 / std::max(columns.col(k).norm(), 1e-300);
  return columns;
}

/// The motions that the cell's own sources and all effects but one can make at the training poses.
MatrixXd nuisance_of(const World& world, std::size_t but, const std::vector<MeasuringPose>& poses) {
  MatrixXd columns = directions_of(arm_columns(world, poses)) * 1e3;
  for (std::size_t k = 0; k < world.effects.size(); ++k) {
    if (k == but) continue;
    const MatrixXd more =
        lengthened(outside(columns / 1e3, effect_columns(world, poses, world.effects[k])));
    const Index before = columns.cols();
    columns.conservativeResize(more.rows(), before + more.cols());
    columns.rightCols(more.cols()) = more;
    columns = directions_of(columns) * 1e3;
  }
  return columns / 1e3;
}

struct Strength {
  double whole = 0, left = 0;
};

Strength strength_of(const World& world, const Effect& effect, const MatrixXd& nuisance,
                     const Frames& still, const std::vector<MeasuringPose>& poses) {
  const VectorXd rows = whitened(world, frames_at(world, poses, {effect}), still);
  return {rows.squaredNorm(), outside(nuisance, rows).squaredNorm()};
}

/// Brings each effect to the strength asked for.
void set_sizes(Draft& draft) {
  constexpr int kRounds = 12;
  World& world = draft.world;
  const std::vector<MeasuringPose> poses = training_poses(world);
  const Frames still = frames_at(world, poses, {});
  for (std::size_t k = 0; k < world.effects.size(); ++k) {
    const MatrixXd nuisance = nuisance_of(world, k, poses);
    Effect& effect = world.effects[k];
    Strength strength = strength_of(world, effect, nuisance, still, poses);
    for (int round = 0; round < kRounds && !draft.size_given; ++round) {
      const double by = std::sqrt(draft.spec.lambda / std::max(strength.left, 1e-12));
      if (std::abs(by - 1) < 1e-7) break;
      for (std::size_t v = 0; v < effect.grows.size(); ++v) {
        if (effect.grows[v]) effect.values(static_cast<Index>(v)) *= by;
      }
      strength = strength_of(world, effect, nuisance, still, poses);
    }
    draft.truth.lambdas.push_back(strength.left);
    draft.truth.absorbed.push_back(strength.whole > 0 ? 1 - strength.left / strength.whole : 1);
  }
}

/// The range of rows about a beginning within which a shift makes a difference of less than 5.5
/// sigma: noise moves a beginning that far in 1 case of 170.
std::pair<int, int> beginnings(const World& world, const Effect& effect, const Frames& still) {
  constexpr double kUnnoticed = 30;
  if (effect.cause.first < 0) return {-1, -1};
  if (effect.cause.cause == "outlier") return {effect.cause.first, effect.cause.first};
  Effect always = effect;
  always.act = [act = effect.act](const MeasuringPose& p, const VectorXd& v, Moment& m) {
    MeasuringPose later = p;
    later.index = std::numeric_limits<int>::max();
    act(later, v, m);
  };
  const VectorXd rows = whitened(world, frames_at(world, world.poses, {always}), still);
  const Index per_pose = rows.size() / static_cast<Index>(world.poses.size());
  const auto lost = [&](int row) {
    return world.poses[static_cast<std::size_t>(row)].validation
               ? 0.0
               : rows.segment(per_pose * row, per_pose).squaredNorm();
  };
  int low = effect.cause.first;
  int high = effect.cause.first;
  for (double sum = 0; low > 0 && (sum += lost(low - 1)) < kUnnoticed;) --low;
  for (double sum = 0;
       high + 1 < static_cast<int>(world.poses.size()) && (sum += lost(high)) < kUnnoticed;)
    ++high;
  return {low, high};
}

Matrix3d turn_of(const Vector3d& vector) {
  const double angle = vector.norm();
  if (angle == 0) return Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix();
}

/// Moves the effects at each pose to another pose: sizes stay, all relations are
/// gone.
void permute(const Frames& still, Frames& moved, Random& random) {
  std::vector<std::size_t> from(moved.size());
  std::iota(from.begin(), from.end(), 0);
  std::shuffle(from.begin(), from.end(), random);
  Frames permuted = still;
  for (std::size_t i = 0; i < moved.size(); ++i) {
    const Matrix4d& to = moved[from[i]];
    const Matrix4d& was = still[from[i]];
    permuted[i].block<3, 1>(0, 3) += (to - was).block<3, 1>(0, 3);
    permuted[i].block<3, 3>(0, 0) =
        to.block<3, 3>(0, 0) * was.block<3, 3>(0, 0).transpose() * still[i].block<3, 3>(0, 0);
  }
  moved = permuted;
}

/// A draw of Student's distribution of four degrees of freedom, brought to unit variance.
double heavy_factor(Random& random) {
  double square = 0;
  for (int k = 0; k < 4; ++k) square += std::pow(normal(random), 2);
  return std::sqrt(2 / square);
}

void add_noise(const World& world, const std::string& noise, Frames& frames, Random& random) {
  constexpr double kLasting = 0.6;  // share of one measurement's error that stays in the next
  Vector3d shift_before = Vector3d::Zero();
  Vector3d turn_before = Vector3d::Zero();
  for (Matrix4d& frame : frames) {
    Vector3d turn;
    Vector3d shift;
    for (int axis = 0; axis < 3; ++axis) {
      shift(axis) = world.sigma_mm * normal(random);
      turn(axis) = world.sigma_rad * normal(random);
    }
    if (noise == "heavy") {
      const double factor = heavy_factor(random);
      shift *= factor;
      turn *= factor;
    } else if (noise == "lasting" && &frame != &frames.front()) {
      shift = kLasting * shift_before + std::sqrt(1 - kLasting * kLasting) * shift;
      turn = kLasting * turn_before + std::sqrt(1 - kLasting * kLasting) * turn;
    }
    shift_before = shift;
    turn_before = turn;
    frame.block<3, 1>(0, 3) += shift;
    frame.block<3, 3>(0, 0) = turn_of(turn) * frame.block<3, 3>(0, 0);
  }
}

}  // namespace

HiddenCase hide(const HiddenSpec& spec) {
  Draft draft{spec, Random(spec.seed * 0x9e3779b97f4a7c15u + number_of(spec.kind)), {}, {}, {}, {},
              {}};
  understand(draft);
  arrange(draft);
  build(draft);
  draw_effects(draft);
  set_sizes(draft);
  const Frames still = frames_at(draft.world, draft.world.poses, {});
  for (const Effect& effect : draft.world.effects) {
    draft.truth.begins.push_back(beginnings(draft.world, effect, still));
  }
  Frames frames = frames_at(draft.world, draft.world.poses, draft.world.effects);
  if (draft.permuted) permute(still, frames, draft.random);
  add_noise(draft.world, spec.noise, frames, draft.random);
  if (draft.truth.question == Question::kNothing) draft.truth.causes.clear();
  draft.truth.untraceable = contains(draft.names, "backlash") && contains(spec.withheld, "dir") &&
                            draft.plan.approach == Approach::kBothSides;
  const std::string& cell_ranges = spec.cell_ranges.empty() ? draft.plan.ranges : spec.cell_ranges;
  return {without_columns(batch_text(draft.world, frames), spec.withheld),
          cell_text(draft.world, draft.belief, cell_ranges),
          robot_text(),
          draft.truth,
          draft.world,
          cell_ranges,
          frames};
}

const std::vector<std::string>& decidable_kinds() { return hideable_causes(); }

const std::vector<std::string>& null_kinds() {
  static const std::vector<std::string> kinds = {"null_white", "null_structured", "null_permuted"};
  return kinds;
}

const std::vector<std::string>& unknown_kinds() {
  static const std::vector<std::string> kinds = {"unknown_q4", "unknown_q2q3"};
  return kinds;
}

const std::vector<std::string>& slow_kinds() {
  static const std::vector<std::string> kinds = {"slow_zero", "slow_stand", "slow_growth",
                                                 "slow_walk"};
  return kinds;
}

const std::vector<std::string>& foreign_kinds() {
  static const std::vector<std::string> kinds = {"foreign_wave",  "foreign_seam",  "foreign_crack",
                                                 "foreign_mount", "foreign_walks", "foreign_loads"};
  return kinds;
}

const std::vector<std::string>& undecidable_kinds() {
  static const std::vector<std::string> kinds = {
      "backlash_one_side", "payload_alone",  "tool_or_link",   "tool_absorbed",
      "joint1_or_tracker", "joint6_or_tool", "constant_warmth"};
  return kinds;
}

const std::vector<std::string>& replica_kinds() {
  static const std::vector<std::string> kinds = {"replica_ripple_1dim", "replica_ripple_6dim",
                                                 "replica_tool", "replica_p28"};
  return kinds;
}

std::string to_json(const HiddenTruth& truth, const World& world) {
  std::string text = fmt::format("{{\n  \"kind\": \"{}\",\n  \"causes\": [", truth.kind);
  for (std::size_t k = 0; k < truth.causes.size(); ++k) {
    const HiddenCause& cause = truth.causes[k];
    text += fmt::format(
        "{}\n    {{\"cause\": \"{}\", \"joint\": {}, \"parameter\": \"{}\", \"pose_id\": \"{}\", ",
        k == 0 ? "" : ",", cause.cause, cause.joint, cause.parameter,
        cause.first < 0 ? "" : fmt::format("p{}", cause.first + 1));
    text += fmt::format("\"lambda\": {:.9g}, \"absorbed\": {:.6g}, \"values\": {{",
                        truth.lambdas[k], truth.absorbed[k]);
    const Effect& effect = world.effects[k];
    for (std::size_t v = 0; v < effect.names.size(); ++v) {
      text += fmt::format("{}\"{}\": {:.9g}", v == 0 ? "" : ", ", effect.names[v],
                          effect.values(static_cast<Index>(v)));
    }
    text += "}}";
  }
  return text + "\n  ]\n}\n";
}

}  // namespace trammel::hidden
