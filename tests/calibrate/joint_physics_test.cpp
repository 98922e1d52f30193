#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <numbers>

#include "server/base/units.h"
#include "server/calibrate/calibrate.h"
#include "tests/support/calibrated.h"
#include "tests/support/demand.h"
#include "tests/support/heavy_arm.h"

// Effects of real joints, rails and instruments, hidden in the second simulation, which computes
// them by other means.
namespace trammel {
namespace {

using hidden::Effect;
using hidden::MeasuringPose;
using hidden::Moment;
using test::draw_heavy_arm;
using test::HeavyArm;

const double kNoise_mm = 0.013 * std::sqrt(3.0);
const std::vector<std::string> kM3 = {"base", "geometry", "compliance"};

Effect hidden_effect(std::function<void(const MeasuringPose&, Moment&)> act) {
  return {{"unknown", 0, "", -1, {}, 0},
          {},
          Eigen::VectorXd(),
          {},
          [act](const MeasuringPose& p, const auto&, Moment& m) { act(p, m); }};
}

HeavyArm arm_with(std::uint64_t seed, std::function<void(const MeasuringPose&, Moment&)> act) {
  HeavyArm arm = draw_heavy_arm({.seed = seed, .links_weigh = false, .payloads = 2});
  arm.world.effects.push_back(hidden_effect(std::move(act)));
  return arm;
}

std::vector<std::string> with(const std::vector<std::string>& more) {
  std::vector<std::string> all = kM3;
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

/// Trained on one batch, held out on another: the noise with `sources`, `times` as much without.
CalibrationResult expect_to_explain(const HeavyArm& arm, const std::vector<std::string>& sources,
                                    const MeasurementBatch& batch, const MeasurementBatch& fresh,
                                    double times) {
  const CalibrationResult found = test::demand(calibrate(arm.cell, with(sources), batch, {}));
  EXPECT_LE(test::held_out_mm(found, fresh), 1.05 * kNoise_mm) << sources.front();
  EXPECT_GE(test::held_out_mm(test::demand(calibrate(arm.cell, kM3, batch, {})), fresh),
            times * kNoise_mm)
      << sources.front();
  return found;
}

bool is_identified(const CalibrationResult& result, const std::string& name) {
  return std::any_of(
      result.parameters.begin(), result.parameters.end(),
      [&](const IdentifiedParameter& p) { return p.parameter.name == name && p.identified; });
}

/// The share of findings within U(k=2) of the truth.
struct Coverage {
  int within = 0, all = 0;
  void add(const CalibrationResult& result, const std::map<std::string, double>& truth) {
    for (const auto& [name, value] : truth) {
      const auto found =
          std::find_if(result.parameters.begin(), result.parameters.end(),
                       [&](const IdentifiedParameter& p) { return p.parameter.name == name; });
      ASSERT_NE(found, result.parameters.end()) << name;
      EXPECT_NEAR(found->value, value, 4 * found->stddev) << name;
      within += std::abs(found->value - value) <= 2 * found->stddev ? 1 : 0;
      ++all;
    }
  }
  [[nodiscard]] double share() const { return static_cast<double>(within) / all; }
};

TEST(JointPhysics, ABeltPastAnotherAxisIsFoundWithItsNumbers) {
  Coverage coverage;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const double phase = static_cast<double>(seed);
    const HeavyArm arm = arm_with(seed, [phase](const MeasuringPose& p, Moment& m) {
      const double pulley =
          p.q(1);  // the belt's pulley turns with joint 2, a little off its centre
      const double motor = p.q(1) + p.q(2);  // and so does what drives it, which stands before both
      m.q(2) += 4e-4 * pulley + 3e-4 * std::sin(pulley + phase) + 2e-4 * std::sin(motor - phase);
    });
    const CalibrationResult found =
        expect_to_explain(arm, {"joint_coupling:3"}, test::measured(arm, 400, seed),
                          test::measured(arm, 400, 100 + seed), 3);
    EXPECT_TRUE(is_identified(found, "couple_rate3.2"));
    EXPECT_TRUE(is_identified(found, "sum_sin3.2_1"));
    coverage.add(found, {{"couple_rate3.2", 4e-4},
                         {"couple_sin3.2_1", 3e-4 * std::cos(phase)},
                         {"couple_cos3.2_1", 3e-4 * std::sin(phase)},
                         {"sum_sin3.2_1", 2e-4 * std::cos(phase)},
                         {"sum_cos3.2_1", -2e-4 * std::sin(phase)}});
  }
  EXPECT_GE(coverage.share(), 0.88) << coverage.all;
}

/// The angle that the rocker of a four-bar linkage stands at for an angle of its crank. A
/// parallelogram, if bars that face one another were as long.
double rocker_angle(double crank_angle) {
  const double ground = 1280, crank = 400, coupler = 1280.12, rocker = 399.93;  // mm
  const Eigen::Vector2d pin(crank * std::cos(crank_angle), crank * std::sin(crank_angle));
  const Eigen::Vector2d pivot(ground, 0);
  const Eigen::Vector2d line = pivot - pin;
  const double along =
      (coupler * coupler - rocker * rocker + line.squaredNorm()) / (2 * line.norm());
  const double across = std::sqrt(coupler * coupler - along * along);
  const Eigen::Vector2d unit = line.normalized();
  const Eigen::Vector2d joint = pin + along * unit + across * Eigen::Vector2d(-unit.y(), unit.x());
  return std::atan2(joint.y() - pivot.y(), joint.x() - pivot.x());
}

TEST(JointPhysics, AParallelogramWithWrongBarsIsDescribed) {
  // Joint 3 is commanded against the horizontal, as arms with a parallelogram are: it follows joint
  // 2 backwards. Its gear turns the forearm against the base, so what the gear of joint 2 gives way
  // leaves the forearm as it stands.
  HeavyArm arm = arm_with(3, [](const MeasuringPose& p, Moment& m) {
    const double between = p.q(2) - p.q(1);
    const double crank = between + std::numbers::pi / 2;
    m.q(2) = between + rocker_angle(crank) - crank;
    const hidden::Joints moments = hidden::load_moments(m.arm, m.q);
    const double upper = m.arm.give(1) * (moments(1) - moments(2));
    m.q(1) += upper;
    m.q(2) += m.arm.give(2) * moments(2) - upper;
    m.arm.give(1) = m.arm.give(2) = 0;
  });
  auto cell = std::make_shared<Cell>(*arm.cell);
  std::vector<Joint> joints;
  for (int j = 0; j < cell->robot.size(); ++j) joints.push_back(cell->robot.joint(j));
  cell->robot = test::demand(
      Chain::make("with a parallelogram", joints, {{2, 1, -1.0, CouplingKind::kParallelogram}}));
  arm.cell = cell;
  const auto poses = [](std::uint64_t seed) {
    hidden::Random random(seed);
    std::vector<MeasuringPose> drawn = hidden::draw_poses({.count = 600, .loads = 2}, random);
    for (MeasuringPose& pose : drawn)
      pose.q(2) = pose.q(1) + hidden::uniform(random, from_deg(-60),
                                              std::min(from_deg(60), from_deg(70) - pose.q(1)));
    return drawn;
  };
  expect_to_explain(arm, {"joint_coupling:3@2"}, test::measured_at(arm, poses(1), 11),
                    test::measured_at(arm, poses(2), 12), 2);
}

TEST(JointPhysics, CablesThatTwoJointsWindUpPullAtBoth) {
  for (const auto& [spec, first, second] :
       {std::tuple("cable_pull:2@3", 1, 2), std::tuple("cable_pull:4@6", 3, 5)}) {
    const HeavyArm arm =
        arm_with(5, [first = first, second = second](const MeasuringPose& p, Moment& m) {
          // A hose that winds around both axes: it stiffens as it runs out of slack.
          const double wound = p.q(first) + p.q(second) - 0.4;
          const double torque = -60e3 * std::tanh(wound / 3) - 4e3 * wound;  // Nmm
          for (const int joint : {first, second}) m.q(joint) += m.arm.give(joint) * torque;
        });
    expect_to_explain(arm, {spec}, test::measured(arm, 400, 1), test::measured(arm, 400, 2), 1.1);
  }
}

/// Waves of a bearing as seen from the link before: of any harmonic up to the third, in both
/// senses.
struct Bearing {
  double shift_mm[3][6], tilt[2][6];
  Bearing(hidden::Random& random, double radial_mm, double tilt_rad) {
    for (int k = 0; k < 6; ++k) {
      const double falls = 1.0 / (k / 2 + 1);
      for (auto& axis : shift_mm) axis[k] = radial_mm * falls * hidden::normal(random);
      for (auto& axis : tilt) axis[k] = tilt_rad * falls * hidden::normal(random);
    }
  }
  static double at(const double (&waves)[6], double q) {
    double sum = 0;
    for (int h = 1; h <= 3; ++h)
      sum += waves[2 * h - 2] * std::sin(h * q) + waves[2 * h - 1] * std::cos(h * q);
    return sum;
  }
  [[nodiscard]] Eigen::Matrix4d motion(double q) const {
    return hidden::motion({at(shift_mm[0], q), at(shift_mm[1], q), at(shift_mm[2], q)}, 0,
                          at(tilt[1], q), at(tilt[0], q));
  }
};

TEST(JointPhysics, AnAxisThatWobblesIsNoAngleError) {
  Coverage coverage;
  for (const int joint : {1, 2, 4, 5}) {
    hidden::Random random(static_cast<std::uint64_t>(joint));
    const Bearing bearing(random, 0.02, 4e-5);
    const HeavyArm arm =
        arm_with(static_cast<std::uint64_t>(joint), [&](const MeasuringPose& p, Moment& m) {
          m.arm.bearings[static_cast<std::size_t>(joint - 1)] = bearing.motion(p.q(joint - 1));
        });
    const MeasurementBatch batch = test::measured(arm, 600, static_cast<std::uint64_t>(joint));
    const MeasurementBatch fresh = test::measured(arm, 400, 2);
    const CalibrationResult found =
        expect_to_explain(arm, {fmt::format("axis_runout:{}", joint)}, batch, fresh, 1.5);
    const CalibrationResult map =
        test::demand(calibrate(arm.cell, with({fmt::format("joint_map:{}", joint)}), batch, {}));
    EXPECT_GE(test::held_out_mm(map, fresh), 1.15 * kNoise_mm) << joint;
    EXPECT_EQ(is_identified(found, fmt::format("radial_x{}_-1", joint)), joint != 2)
        << "joint 2 turns half around";
    EXPECT_TRUE(is_identified(found, fmt::format("tilt_x{}_-1", joint)));
    // The part that goes around once backwards, and the axial part.
    const auto& x = bearing.shift_mm[0];
    const auto& y = bearing.shift_mm[1];
    const auto& a = bearing.tilt[0];
    const auto& b = bearing.tilt[1];
    coverage.add(found, {{fmt::format("radial_x{}_-1", joint), from_mm((x[1] - y[0]) / 2)},
                         {fmt::format("radial_y{}_-1", joint), from_mm((x[0] + y[1]) / 2)},
                         {fmt::format("tilt_x{}_-1", joint), (a[1] - b[0]) / 2},
                         {fmt::format("tilt_y{}_-1", joint), (a[0] + b[1]) / 2},
                         {fmt::format("axial_sin{}_2", joint), from_mm(bearing.shift_mm[2][2])},
                         {fmt::format("axial_cos{}_3", joint), from_mm(bearing.shift_mm[2][5])}});
  }
  EXPECT_GE(coverage.share(), 0.88) << coverage.all;
}

TEST(JointPhysics, TeethThatGiveWayUnevenlyRippleWithTheTorque) {
  Coverage coverage;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const double phase = static_cast<double>(seed);
    const HeavyArm arm = arm_with(seed, [&](const MeasuringPose& p, Moment& m) {
      m.arm.give(2) *= 1 + 0.15 * std::sin(90 * p.q(2) + phase);
    });
    const double give = from_rad_per_nmm(arm.world.arm.give(2));
    const MeasurementBatch batch = test::measured(arm, 400, seed);
    const MeasurementBatch fresh = test::measured(arm, 400, 100 + seed);
    const CalibrationResult found =
        expect_to_explain(arm, {"loaded_ripple:3@90.02"}, batch, fresh, 1.3);
    const CalibrationResult plain =
        test::demand(calibrate(arm.cell, with({"gear_transmission:3@90.02"}), batch, {}));
    EXPECT_GE(test::held_out_mm(plain, fresh), 1.1 * kNoise_mm)
        << "a ripple that no torque changes";
    coverage.add(found, {{"loaded_sin3", give * 0.15 * std::cos(phase)},
                         {"loaded_cos3", give * 0.15 * std::sin(phase)},
                         {"order3", 90}});
  }
  EXPECT_GE(coverage.share(), 0.88) << coverage.all;
}

TEST(JointPhysics, TheInstrumentsBendAndTemperatureShowItsScaleDoesNot) {
  const Eigen::Vector3d stand(4200, -1800, 1300);  // mm
  HeavyArm arm = arm_with(2, [stand](const MeasuringPose& p, Moment& m) {
    const Eigen::Vector3d away =
        (m.seen * hidden::tool_frame(m.arm, m.q)).block<3, 1>(0, 3) - stand;
    m.shift += (3e-6 + 8e-9 * away.norm() + 3e-6 * (p.temperature_c - 20)) * away;
  });
  auto cell = std::make_shared<Cell>(*arm.cell);
  cell->tracker.p_W = stand * from_mm(1);
  arm.cell = cell;
  const auto measured = [&](std::uint64_t seed) {
    hidden::Random random(seed);
    return test::measured_at(arm, hidden::draw_poses({.count = 400, .loads = 2}, random), seed);
  };
  const MeasurementBatch batch = measured(1);
  const CalibrationResult found =
      expect_to_explain(arm, {"instrument_scale"}, batch, measured(2), 1.1);
  Coverage coverage;
  coverage.add(found, {{"bend", 8e-6}, {"warm", 3e-6}});
  EXPECT_EQ(coverage.within, 2);
  EXPECT_TRUE(is_identified(found, "bend"));
  EXPECT_TRUE(is_identified(found, "warm"));
  const auto scale =
      std::find_if(found.parameters.begin(), found.parameters.end(),
                   [](const IdentifiedParameter& p) { return p.parameter.name == "scale"; });
  EXPECT_FALSE(scale->identified);
  // Whoever asks where the robot will be gets none of it.
  PoseContext asked = batch.measurements.front().context;
  asked.served = true;
  PhysicalModel without = found.model;
  const Eigen::Index first = scale - found.parameters.begin();
  without.values.segment<3>(first).setZero();
  EXPECT_EQ((found.model.pose_W(asked).translation() - without.pose_W(asked).translation()).norm(),
            0);
  asked.served = false;
  EXPECT_GT((found.model.pose_W(asked).translation() - without.pose_W(asked).translation()).norm(),
            1e-5);
}

/// An arm that comes to every pose from the one before it, and knows which it was.
struct Visiting {
  std::shared_ptr<std::vector<MeasuringPose>> poses =
      std::make_shared<std::vector<MeasuringPose>>();
  HeavyArm arm;
  explicit Visiting(
      std::uint64_t seed,
      const std::function<void(const MeasuringPose&, const MeasuringPose&, Moment&)>& act) {
    arm = arm_with(seed, [act, visited = poses](const MeasuringPose& p, Moment& m) {
      if (p.index > 0) act((*visited)[static_cast<std::size_t>(p.index) - 1], p, m);
    });
  }
  [[nodiscard]] MeasurementBatch measured(int count, std::uint64_t seed) const {
    hidden::Random random(seed);
    *poses = hidden::draw_poses({.count = count, .loads = 2}, random);
    return test::measured_at(arm, *poses, seed + 50);
  }
};

TEST(JointPhysics, WhatIsMeasuredBeforeStandstillLacksAShareOfTheMove) {
  Coverage coverage;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    // Each servo settles exponentially; the instrument begins 2 s after the controller says that it
    // has arrived.
    const auto left = [](Eigen::Index joint) {
      return std::exp(-2 / (0.19 + 0.02 * static_cast<double>(joint)));
    };
    const Visiting visiting(seed,
                            [&](const MeasuringPose& before, const MeasuringPose& p, Moment& m) {
                              for (Eigen::Index j = 0; j < hidden::kJoints; ++j)
                                m.q(j) -= left(j) * (p.q(j) - before.q(j));
                            });
    const MeasurementBatch batch = visiting.measured(400, seed);
    const CalibrationResult early =
        test::demand(calibrate(visiting.arm.cell, with({"early_reading"}), batch, {}));
    const CalibrationResult none = test::demand(calibrate(visiting.arm.cell, kM3, batch, {}));
    const MeasurementBatch fresh = visiting.measured(400, 100 + seed);
    EXPECT_LE(test::held_out_mm(early, fresh), 1.05 * kNoise_mm);
    EXPECT_GE(test::held_out_mm(none, fresh), 2 * kNoise_mm);
    for (Eigen::Index j = 0; j < hidden::kJoints; ++j)
      coverage.add(early, {{fmt::format("early{}", j + 1), left(j)}});
  }
  EXPECT_GE(coverage.share(), 0.88) << coverage.all;
}

TEST(JointPhysics, FrictionHoldsAJointBackTowardsWhereItCameFrom) {
  // A bristle model: the held-back angle decays along the way, and remembers more than the last
  // pose.
  const double half_width = 8e-5;
  const double way = 0.03;
  double held = 0;
  const Visiting visiting(2, [&](const MeasuringPose& before, const MeasuringPose& p, Moment& m) {
    const double moved = p.q(2) - before.q(2);
    const double full = std::copysign(half_width, moved);
    held = full + (held - full) * std::exp(-std::abs(moved) / way);
    m.q(2) -= held;
  });
  const MeasurementBatch batch = visiting.measured(400, 1);
  const MeasurementBatch fresh = visiting.measured(400, 2);
  const CalibrationResult found =
      expect_to_explain(visiting.arm, {"hysteresis:3"}, batch, fresh, 1.5);
  Coverage coverage;
  coverage.add(found, {{"hyst3", half_width}});
  EXPECT_EQ(coverage.within, 1);
}

/// The temperature of a body that follows the thermometer, in steps of a second.
std::vector<double> temperatures_of_a_body(const std::vector<MeasuringPose>& poses, double lag_s) {
  std::vector<double> all = {poses.front().temperature_c};
  double body = all.front();
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const double whole = poses[i].time_s - poses[i - 1].time_s;
    const int steps = std::max(1, static_cast<int>(std::lround(whole)));
    for (int k = 0; k < steps; ++k) {
      const double share = (k + 0.5) / steps;
      const double air = poses[i - 1].temperature_c +
                         share * (poses[i].temperature_c - poses[i - 1].temperature_c);
      body += (air - body) * whole / steps / lag_s;
    }
    all.push_back(body);
  }
  return all;
}

TEST(JointPhysics, AJointsZeroFollowsTheTemperatureWithALag) {
  Coverage coverage;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const double lag_s = 1200 + 500 * static_cast<double>(seed);
    const double rate = 1.2e-5;  // rad/K
    std::vector<double> gearbox;
    const HeavyArm arm = arm_with(seed, [&](const MeasuringPose& p, Moment& m) {
      m.q(1) += rate * (gearbox[static_cast<std::size_t>(p.index)] - 20);
    });
    const auto measured = [&](std::uint64_t of) {
      hidden::Random random(of);
      const std::vector<MeasuringPose> poses =
          hidden::draw_poses({.count = 600, .loads = 2}, random);
      gearbox = temperatures_of_a_body(poses, lag_s);
      return test::measured_at(arm, poses, of + 50);
    };
    const MeasurementBatch batch = measured(seed);
    const CalibrationResult found =
        expect_to_explain(arm, {"thermal_zero:2"}, batch, measured(100 + seed), 1.2);
    coverage.add(found, {{"zero_rate2", rate}, {"heat_lag2", lag_s}});
  }
  EXPECT_GE(coverage.share(), 0.85) << coverage.all;
}

TEST(JointPhysics, LinksThatWarmUpLateGrowLate) {
  const double growth = 1.1e-5;
  const double lag_s = 2400;
  std::vector<double> links;
  const HeavyArm arm = arm_with(3, [&](const MeasuringPose& p, Moment& m) {
    for (hidden::Link& link : m.arm.links) {
      link.a *= 1 + growth * (links[static_cast<std::size_t>(p.index)] - 20);
      link.d *= 1 + growth * (links[static_cast<std::size_t>(p.index)] - 20);
    }
  });
  const auto measured = [&](std::uint64_t of) {
    hidden::Random random(of);
    const std::vector<MeasuringPose> poses = hidden::draw_poses({.count = 600, .loads = 2}, random);
    links = temperatures_of_a_body(poses, lag_s);
    return test::measured_at(arm, poses, of + 50);
  };
  const MeasurementBatch batch = measured(1);
  const MeasurementBatch fresh = measured(2);
  const CalibrationResult found = expect_to_explain(arm, {"lagged_growth"}, batch, fresh, 1.5);
  const CalibrationResult at_once =
      test::demand(calibrate(arm.cell, with({"thermal_growth"}), batch, {}));
  EXPECT_GE(test::held_out_mm(at_once, fresh), 1.1 * kNoise_mm);
  Coverage coverage;
  coverage.add(found, {{"growth", growth}, {"heat_lag", lag_s}});
  EXPECT_EQ(coverage.within, 2);
}

}  // namespace
}  // namespace trammel
