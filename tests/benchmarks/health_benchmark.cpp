// What a check of a few planned poses sees. Robots of the second simulation, trained from their
// files; --robots of each kind. False alarms of healthy robots; changes of a single cause of 50 um
// rms (base refitted, tool in turn); the size at which 95 % are seen beside the size that the check
// states. Robots whose joints lost several zeros.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <iostream>
#include <map>

#include "server/base/units.h"
#include "tests/support/checked_robot.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"
#include "tests/support/remastered.h"

namespace trammel {
namespace {

using hidden::HiddenCause;
using hidden::RobotSpec;
using test::checked;
using test::CheckedRobot;

struct Kind {
  std::string name;
  RobotSpec spec;
  std::string bias = "none";
};

std::vector<Kind> kinds() {
  return {{"200 full poses", {.poses = 200}},
          {"200 positions", {.poses = 200, .orientation = false}},
          {"60 full poses", {.poses = 60}},
          {"noise 30 um, 200 full poses", {.poses = 200, .sigma_mm = 0.03}},
          {"noise with t(4), 200 full poses", {.poses = 200, .tail_freedom = 4}},
          {"an error of 20 um that no cause makes, 300 full poses, bias se",
           {.poses = 300, .ripple_mm = 0.02},
           "se"}};
}

const std::vector<std::string> kCauses = {
    "joint_slip", "compliance",   "geometry",        "encoder_eccentricity", "gear_transmission",
    "joint_map",  "tool_changed", "payload_changed", "wrist_coupling",       "link_bending"};

HiddenCause drawn(const std::string& name, const CheckedRobot& robot, hidden::Random& random) {
  hidden::Scene scene{robot.robot.world.arm, &robot.robot.world.poses, 1, 1, true};
  scene.arm.tool = robot.robot.world.tools.front();
  scene.arm.load = robot.robot.world.loads.front();
  return draw_cause(name, scene, random);
}

struct Seen {
  int changed = 0, cannot_tell = 0, missed = 0, named = 0;
  [[nodiscard]] int all() const { return changed + cannot_tell + missed; }
  void add(const HealthCheck& check) {
    changed += check.verdict == HealthVerdict::kChanged ? 1 : 0;
    cannot_tell += check.verdict == HealthVerdict::kCannotTell ? 1 : 0;
    missed += check.verdict == HealthVerdict::kHealthy ? 1 : 0;
  }
  void add(const Seen& other) {
    changed += other.changed;
    cannot_tell += other.cannot_tell;
    missed += other.missed;
    named += other.named;
  }
};

bool names(const HealthCheck& check, const HiddenCause& truth) {
  const auto is = [&](const SingleCause& cause) {
    if (cause.record->spelling != truth.cause) return false;
    if (!truth.parameter.empty() && truth.cause == "geometry")
      return cause.parameter == truth.parameter;
    return truth.joint <= 0 || cause.joint + 1 == truth.joint;
  };
  if (check.changed.empty()) return false;
  const SeenChange& first = check.changed.front();
  return is(first.cause) || std::any_of(first.could_also_be.begin(), first.could_also_be.end(), is);
}

struct Options {
  int robots = 1, healthy = 84, each = 6;
  double tolerance_mm = 0.05;
};

HealthOptions options_of(const Options& options, bool new_tool) {
  HealthOptions health;
  health.tolerance = options.tolerance_mm * from_mm(1);
  health.new_tool = new_tool;
  return health;
}

/// Healthy robots: `named` counts nothing.
Seen healthy(const CheckedRobot& robot, const Options& options) {
  Seen seen;
  for (int k = 0; k < options.healthy; ++k)
    seen.add(checked(robot, {}, robot.robot.spec.seed * 10000 + static_cast<std::uint64_t>(k),
                     options_of(options, k % 4 == 3)));
  return seen;
}

void changes(const CheckedRobot& robot, const Options& options,
             std::map<std::string, Seen>& by_cause) {
  hidden::Random random(robot.robot.spec.seed * 17);
  for (const std::string& name : kCauses) {
    for (int k = 0; k < options.each; ++k) {
      const bool new_tool = k % 4 == 3 && name != "tool_changed";
      const HiddenCause cause = drawn(name, robot, random);
      const hidden::Effect effect = changed_by(robot.robot, cause, 0.05, new_tool, random);
      const HealthCheck check = checked(robot, {{effect}}, random(), options_of(options, new_tool));
      by_cause[name].add(check);
      by_cause[name].named += names(check, cause) ? 1 : 0;
    }
  }
}

/// Where the share seen passes 95 %, by a straight line through the probits of some sizes; over the
/// stated size.
double measured_over_stated(const CheckedRobot& robot, const HiddenCause& cause, double stated_mm,
                            int each, std::uint64_t seed) {
  const auto probit = [](double share) {  // Abramowitz and Stegun 26.2.23
    const double p = std::min(share, 1 - share);
    const double t = std::sqrt(-2 * std::log(p));
    const double x = t - (2.515517 + 0.802853 * t + 0.010328 * t * t) /
                             (1 + 1.432788 * t + 0.189269 * t * t + 0.001308 * t * t * t);
    return share < 0.5 ? -x : x;
  };
  Eigen::MatrixX2d line(5, 2);
  Eigen::VectorXd at(5);
  for (int step = 0; step < 5; ++step) {
    const double factor = 0.7 + 0.1 * step;
    int changed = 0;
    hidden::Random random(seed + 1000 * static_cast<std::uint64_t>(step));
    for (int k = 0; k < each; ++k) {
      const hidden::Effect effect =
          changed_by(robot.robot, cause, factor * stated_mm, false, random);
      changed +=
          checked(robot, {{effect}}, random(), {}).verdict == HealthVerdict::kChanged ? 1 : 0;
    }
    line.row(step) << 1, factor;
    at(step) = probit((changed + 0.5) / (each + 1.0));
  }
  const Eigen::Vector2d fit = line.colPivHouseholderQr().solve(at);
  return (1.645 - fit(0)) / fit(1);
}

/// As the check of the healthy robot states it for that cause.
double stated_mm(const CheckedRobot& robot, const HiddenCause& cause) {
  for (const SmallestEffect& one : checked(robot, {}, 1, {}).smallest) {
    const bool joint = cause.joint <= 0 || one.cause.joint + 1 == cause.joint;
    const bool parameter = cause.cause != "geometry" || one.cause.parameter == cause.parameter;
    if (one.cause.record->spelling == cause.cause && joint && parameter && one.rms)
      return to_mm(*one.rms);
  }
  return 0;
}

void sizes(const CheckedRobot& robot, int each) {
  const std::vector<HiddenCause> asked = {
      {"joint_slip", 3, "", 0, {}, 0},         {"compliance", 2, "C2", -1, {}, 0},
      {"geometry", 0, "a3", -1, {}, 0},        {"encoder_eccentricity", 4, "", -1, {}, 0},
      {"gear_transmission", 2, "", -1, {}, 0}, {"tool_changed", 0, "", 0, {}, 0}};
  double farthest = 0;
  for (const HiddenCause& cause : asked) {
    const double stated = stated_mm(robot, cause);
    const double ratio = measured_over_stated(robot, cause, stated, each, 99);
    farthest = std::max(farthest, std::abs(ratio - 1));
    fmt::print("  {:28} stated {:.4f} mm, measured {:.2f} of it\n", to_string(cause), stated,
               ratio);
    std::cout.flush();
  }
  test::tell_figure("health: stated smallest effect off by at most, %", 100 * farthest);
}

/// What checks say of worlds of lost zeros.
struct Lost {
  int worlds = 0, named = 0, whole = 0, sure_and_wrong = 0;

  void add(const std::string& kind, const test::Remastered& world,
           const Result<HealthCheck>& check) {
    ++worlds;
    const bool right = check && test::is_right(*check, world);
    named += right ? 1 : 0;
    whole += right && test::joints_of(check->changed.front().zeros) == world.joints ? 1 : 0;
    const bool wrong = check && !right && test::is_sure(*check);
    sure_and_wrong += wrong ? 1 : 0;
    if (right) return;
    fmt::print("  {}{}, joints {} by {:.4f} rad{}: {}\n", wrong ? "SURE AND WRONG: " : "", kind,
               fmt::join(world.joints, " "), fmt::join(world.by, " "), world.tool ? ", tool" : "",
               check ? check->sentence : check.error().message);
    std::cout.flush();
  }
  void add(const Lost& other) {
    worlds += other.worlds;
    named += other.named;
    whole += other.whole;
    sure_and_wrong += other.sure_and_wrong;
  }
  void tell(const std::string& kind) const {
    fmt::print("lost zeros, {}: {} worlds, {} named, {} of them all, {} sure and wrong\n", kind,
               worlds, named, whole, sure_and_wrong);
    std::cout.flush();
  }
};

/// Poses as planned for checks, and every second time as the training had them.
Lost planned_and_spread(bool orientation, int poses, int worlds) {
  const CheckedRobot planned =
      test::trained_robot({.seed = 11, .poses = 150, .orientation = orientation}, poses);
  const std::string kind = fmt::format("{} {}", poses, orientation ? "poses" : "positions");
  hidden::Random random(static_cast<std::uint64_t>(poses));
  Lost lost;
  for (int k = 0; k < worlds; ++k) {
    CheckedRobot robot = planned;
    for (std::size_t i = 0; k % 2 == 1 && i < robot.planned.size(); ++i)
      robot.planned[i] = robot.robot.world.poses[(static_cast<std::size_t>(k) * 7 + i) % 150].q;
    const test::Remastered world = test::draw_remastered(test::sets_of_six_axes(), random);
    lost.add(kind + (k % 2 == 1 ? ", spread" : ", planned"), world,
             checked(robot, {effects_of(world, robot, random)}, random(), {}));
  }
  lost.tell(kind);
  return lost;
}

/// Elbows of one pose of the flange, another one for each world.
Lost at_elbows(const CompensatedModel& model, bool orientation, int poses, int worlds) {
  const std::string kind = fmt::format("{} elbows, {}", poses, orientation ? "poses" : "positions");
  hidden::Random random(static_cast<std::uint64_t>(100 + poses));
  Lost lost;
  for (int k = 0; k < worlds; ++k) {
    JointVector like(7);
    like << 0.2, 0.6, 0, -1.4, 0, 1.0, 0.1;
    for (Eigen::Index j = 0; j < like.size(); ++j) like(j) += hidden::uniform(random, -0.25, 0.25);
    test::PlainCheck check{test::elbows(test::iiwa(), poses, like), JointVector::Zero(7),
                           orientation};
    check.seed = random();
    const test::Remastered world = test::draw_remastered(test::sets_of_seven_axes(), random);
    apply(world, check, random);
    const CheckedBatch batch = test::demand(
        check_against_cell(measured(test::iiwa(), check), model.cell(), trammel::drawn(0, 1)));
    lost.add(kind, world, check_health(model, batch, {}));
  }
  lost.tell(kind);
  return lost;
}

/// Two worlds in three by an arm of six axes, the others at elbows of one of seven.
void remastered(int worlds) {
  Lost all;
  const CompensatedModel seven = test::trained(test::iiwa());
  for (const bool orientation : {true, false}) {
    for (const int poses : {6, 8, 12, 20}) {
      all.add(planned_and_spread(orientation, poses, worlds / 12));
      all.add(at_elbows(seven, orientation, poses, worlds / 8 - worlds / 12));
    }
  }
  all.tell("all");
  test::tell_figure("health: worlds of lost zeros", all.worlds);
  test::tell_figure("health: lost zeros named, %", 100.0 * all.named / all.worlds);
  test::tell_figure("health: lost zeros sure and wrong", all.sure_and_wrong);
}

void run(const Options& options, int size_trials) {
  Seen all_healthy, all_changed;
  for (Kind kind : kinds()) {
    std::map<std::string, Seen> by_cause;
    Seen quiet, changed;
    double would_have_seen = 0;
    for (int k = 0; k < options.robots; ++k) {
      kind.spec.seed = 100 + static_cast<std::uint64_t>(k);
      const CheckedRobot robot = test::trained_robot(kind.spec, 12, kind.bias);
      quiet.add(healthy(robot, options));
      changes(robot, options, by_cause);
      would_have_seen = to_mm(checked(robot, {}, 1, {}).would_have_seen.value_or(1));
    }
    fmt::print("{}: would have seen {:.3f} mm; healthy: {} false alarms, {} cannot tell of {}\n",
               kind.name, would_have_seen, quiet.changed, quiet.cannot_tell, quiet.all());
    for (const auto& [cause, seen] : by_cause) {
      fmt::print("  {:22} changed {}, cannot tell {}, missed {} of {}; named {}\n", cause,
                 seen.changed, seen.cannot_tell, seen.missed, seen.all(), seen.named);
      changed.add(seen);
    }
    all_healthy.add(quiet);
    all_changed.add(changed);
    std::cout.flush();
  }
  test::tell_figure("health: false alarms, %", 100.0 * all_healthy.changed / all_healthy.all());
  test::tell_figure("health: 50 um seen or cannot tell, %",
                    100.0 * (all_changed.changed + all_changed.cannot_tell) / all_changed.all());
  test::tell_figure("health: 50 um seen, %", 100.0 * all_changed.changed / all_changed.all());
  if (size_trials > 0) sizes(test::trained_robot({.seed = 7, .poses = 200}), size_trials);
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  CLI::App app("What a health check sees");
  trammel::Options options;
  int size_trials = 100, zeros = 200;
  app.add_option("--robots", options.robots, "of each kind");
  app.add_option("--healthy", options.healthy, "checks of each healthy robot");
  app.add_option("--each", options.each, "changes of each cause and robot");
  app.add_option("--size-trials", size_trials,
                 "at each of five sizes; 0: the stated size is not measured");
  app.add_option("--zeros", zeros, "worlds of several lost zeros; 0: none");
  CLI11_PARSE(app, argc, argv);
  if (options.robots > 0) trammel::run(options, size_trials);
  if (zeros > 0) trammel::remastered(zeros);
}
