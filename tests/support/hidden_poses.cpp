#include "tests/support/hidden_poses.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <numbers>
#include <numeric>

namespace trammel::hidden {

namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kSecondsAPose = 20;
constexpr double kSecondsAPathPoint = 0.4;
constexpr double kLinkLag =
    1.0 / 40;  // share of the measuring time, the lag of the links behind the thermometer
constexpr int kTurnsOfAKind = 8;  // changes of a tool or a load

using Ranges = std::array<std::pair<double, double>, kJoints>;

const std::map<std::string, Ranges>& all_ranges_deg() {
  static const std::map<std::string, Ranges> ranges = {
      {"calibration",
       {{{-170, 170}, {-65, 85}, {-180, 70}, {-300, 300}, {-120, 120}, {-180, 180}}}},
      {"1dim", {{{5, 5}, {0, 0}, {-45, 45}, {0, 0}, {0, 0}, {0, 0}}}},
      {"3dim", {{{-45, 45}, {-45, 45}, {-45, 45}, {0, 0}, {0, 0}, {0, 0}}}},
      {"6dim-s", {{{-15, 15}, {-15, 15}, {-15, 30}, {-30, 30}, {-30, 30}, {-30, 30}}}},
      {"6dim-m", {{{-90, 90}, {-40, 60}, {-90, 60}, {-150, 150}, {-100, 100}, {-150, 150}}}},
      {"6dim-l", {{{-40, 40}, {-15, 45}, {-15, 45}, {-80, 80}, {-90, 90}, {-80, 80}}}}};
  return ranges;
}

/// Each joint's range cut into as many slices as there are poses, each slice used once.
void scatter(std::vector<MeasuringPose>& poses, const Ranges& ranges, Random& random) {
  std::vector<int> slices(poses.size());
  for (std::size_t j = 0; j < kJoints; ++j) {
    std::iota(slices.begin(), slices.end(), 0);
    std::shuffle(slices.begin(), slices.end(), random);
    const auto [lower, upper] = ranges[j];
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const double share = (slices[i] + uniform(random, 0, 1)) / static_cast<double>(poses.size());
      poses[i].q(static_cast<Eigen::Index>(j)) = lower + share * (upper - lower);
    }
  }
  double time = uniform(random, 0, 100);
  for (MeasuringPose& pose : poses) {
    pose.time_s = time;
    time += kSecondsAPose * uniform(random, 0.9, 1.3);
  }
}

/// One continuous motion: every joint swings within its range at its own pace, by less than 0.2 rad
/// from point to point.
void follow_path(std::vector<MeasuringPose>& poses, const Ranges& ranges, Random& random) {
  for (std::size_t j = 0; j < kJoints; ++j) {
    const auto [lower, upper] = ranges[j];
    const double half = (upper - lower) / 2;
    const double fastest = 0.15 / kSecondsAPathPoint / std::max(half, 0.3);
    const double pace = fastest * uniform(random, 0.35, 0.7);
    const double second_pace = pace * uniform(random, 0.25, 0.45);
    const double phase = uniform(random, 0, kTurn);
    const double second_phase = uniform(random, 0, kTurn);
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const double t = kSecondsAPathPoint * static_cast<double>(i);
      const auto joint = static_cast<Eigen::Index>(j);
      poses[i].time_s = t;
      poses[i].q(joint) =
          (lower + upper) / 2 + half * (0.65 * std::sin(pace * t + phase) +
                                        0.35 * std::sin(second_pace * t + second_phase));
      poses[i].velocity(joint) =
          half * (0.65 * pace * std::cos(pace * t + phase) +
                  0.35 * second_pace * std::cos(second_pace * t + second_phase));
    }
  }
}

void set_directions(std::vector<MeasuringPose>& poses, Approach approach, Random& random) {
  Joints before = Joints::Zero();
  for (MeasuringPose& pose : poses) {
    for (std::size_t j = 0; j < kJoints; ++j) {
      const auto joint = static_cast<Eigen::Index>(j);
      const double way = pose.q(joint) - before(joint);
      const bool upwards = approach == Approach::kFromBelow ||
                           (approach == Approach::kBothSides ? whole(random, 0, 1) == 1 : way > 0);
      pose.direction[j] = upwards ? 1 : -1;
    }
    before = pose.q;
  }
}

/// A warm-up with the door opened and shut during it: neither the thermometer nor the links rise
/// all the time.
void set_temperatures(std::vector<MeasuringPose>& poses, bool constant, Random& random) {
  const double start = poses.front().time_s;
  const double whole_time = std::max(poses.back().time_s - start, 1.0);
  const double constant_at = uniform(random, 24, 30);
  const double rise = uniform(random, 3, 6);
  const double swing = uniform(random, 1.2, 2.5);
  const double swings = uniform(random, 1.6, 2.6);
  const double phase = uniform(random, 0, kTurn);
  const double lag = kLinkLag * whole_time;
  double links = 0;
  double before = start;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    MeasuringPose& pose = poses[i];
    const double share = (pose.time_s - start) / whole_time;
    pose.temperature_c = constant ? constant_at
                                  : 20.5 + rise * (1 - std::exp(-4 * share)) +
                                        swing * std::sin(kTurn * swings * share + phase);
    if (i == 0) links = pose.temperature_c;
    links += (pose.temperature_c - links) * (1 - std::exp(-(pose.time_s - before) / lag));
    before = pose.time_s;
    pose.link_temperature_c = links;
  }
}

/// Turns of about equal length, the kinds one after the other.
void take_turns(std::vector<MeasuringPose>& poses, int kinds, int MeasuringPose::*which,
                Random& random) {
  if (kinds == 1) return;
  const auto count = static_cast<int>(poses.size());
  int kind = whole(random, 0, kinds - 1);
  int left = 0;
  for (MeasuringPose& pose : poses) {
    if (left == 0) {
      kind = (kind + 1) % kinds;
      left = std::max(1, static_cast<int>(count / kTurnsOfAKind * uniform(random, 0.7, 1.3)));
    }
    pose.*which = kind;
    --left;
  }
}

}  // namespace

double uniform(Random& random, double from, double to) {
  return from + (to - from) * static_cast<double>(random() >> 11) * 0x1p-53;
}

double normal(Random& random) {
  const double radius = std::sqrt(-2 * std::log(1 - uniform(random, 0, 1)));
  return radius * std::cos(uniform(random, 0, kTurn));
}

int whole(Random& random, int from, int to) {
  return from + static_cast<int>(uniform(random, 0, 1) * (to - from + 1));
}

Ranges joint_ranges(const std::string& name) {
  const auto found = all_ranges_deg().find(name);
  if (found == all_ranges_deg().end()) {
    std::fprintf(stderr, "no joint ranges are called %s\n", name.c_str());
    std::abort();
  }
  Ranges ranges = found->second;
  for (auto& [lower, upper] : ranges) {
    lower *= kDegree;
    upper *= kDegree;
  }
  return ranges;
}

std::vector<MeasuringPose> draw_poses(const PosePlan& plan, Random& random) {
  std::vector<MeasuringPose> poses(static_cast<std::size_t>(plan.count));
  for (int i = 0; i < plan.count; ++i) poses[static_cast<std::size_t>(i)].index = i;
  const Ranges ranges = joint_ranges(plan.ranges);
  if (plan.course == Course::kScattered) {
    scatter(poses, ranges, random);
  } else {
    follow_path(poses, ranges, random);
  }
  set_directions(poses, plan.approach, random);
  set_temperatures(poses, plan.constant_temperature, random);
  take_turns(poses, plan.tools, &MeasuringPose::tool, random);
  take_turns(poses, plan.loads, &MeasuringPose::load, random);
  for (MeasuringPose& pose : poses) pose.validation = uniform(random, 0, 1) < plan.validation_share;
  return poses;
}

}  // namespace trammel::hidden
