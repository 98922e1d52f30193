#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

#include "server/base/units.h"
#include "server/diagnose/diagnose.h"
#include "tests/support/demand.h"
#include "tests/support/diagnosis_trial.h"
#include "tests/support/heavy_arm.h"

// Arms whose joint 3 is commanded against level, by a controller that counts so or by bars, each
// with one thing wrong at a gear. The second simulation moves them: its gears are those of this
// file.

namespace trammel {
namespace {

using hidden::Joints;
using hidden::MeasuringPose;
using hidden::Moment;
using test::HeavyArm;

constexpr int kPoses = 120;
constexpr int kSlipsAt = 50;

/// What is wrong: how far each gear is off, by the gears' angles and the torques on them, Nmm.
struct World {
  const char* name;
  const char* cause;
  int joint;  // from 1
  std::function<Joints(const MeasuringPose&, const Joints& gears, const Joints& torques)> off;
  hidden::Approach approach = hidden::Approach::kBothSides;
};

Joints at(int joint, double off) {
  Joints all = Joints::Zero();
  all(joint - 1) = off;
  return all;
}

const World kWorlds[] = {
    {"ALostZeroOfJoint2", "joint_slip", 2,
     [](const MeasuringPose& p, const Joints&, const Joints&) {
       return at(2, p.index < kSlipsAt ? 0 : 1e-3);
     }},
    {"ALostZeroOfJoint3", "joint_slip", 3,
     [](const MeasuringPose& p, const Joints&, const Joints&) {
       return at(3, p.index < kSlipsAt ? 0 : 1e-3);
     }},
    {"RippleOfJoint2", "gear_transmission", 2,
     [](const MeasuringPose&, const Joints& g, const Joints&) {
       return at(2, 1.5e-4 * std::sin(47.3 * g(1) + 0.4));
     }},
    {"RippleOfJoint3", "gear_transmission", 3,
     [](const MeasuringPose&, const Joints& g, const Joints&) {
       return at(3, 1.5e-4 * std::sin(61.7 * g(2) + 0.4));
     }},
    {"PlayOfJoint2", "backlash", 2,
     [](const MeasuringPose& p, const Joints&, const Joints&) {
       return at(2, -2e-4 * p.direction[1]);
     }},
    {"PlayOfJoint3", "backlash", 3,
     [](const MeasuringPose& p, const Joints&, const Joints&) {
       return at(3, -2e-4 * p.direction[2]);
     }},
    {"AnEncoderOfJoint3", "encoder_eccentricity", 3,
     [](const MeasuringPose&, const Joints& g, const Joints&) {
       return at(3, 4e-4 * std::sin(g(2) + 1));
     }},
    {"AnAngleErrorOfJoint3", "joint_map", 3,
     [](const MeasuringPose&, const Joints& g, const Joints&) {
       return at(3, 2e-4 * std::sin(3 * g(2)) + 2e-4 * std::cos(5 * g(2) + 1) +
                        1e-4 * std::sin(8 * g(2)));
     }},
};

constexpr double kPlay = 1e-4;           // rad
constexpr double kPlayByTorque = 5e-10;  // rad/Nmm: more than the gears give way

/// Play of one gear that grows with the torque on it.
World loaded_play(int joint, hidden::Approach approach) {
  return {"LoadedPlay", "backlash", joint,
          [=](const MeasuringPose& p, const Joints&, const Joints& torques) {
            const double play = kPlay + kPlayByTorque * std::abs(torques(joint - 1));
            return at(joint, -play * p.direction[static_cast<std::size_t>(joint - 1)]);
          },
          approach};
}

/// The arm with the joints where its gears, which are off, put them. The angle of the forearm
/// against level is commanded; gearboxes give way under what their gears carry.
void put(const MeasuringPose& p, CouplingKind kind, const World& world, Moment& m) {
  const bool bars = kind == CouplingKind::kParallelogram;
  Joints gears = p.q;
  Joints axes = p.q;
  axes(2) = p.q(2) - p.q(1);
  if (!bars) gears = axes;
  Joints torques = hidden::load_moments(m.arm, axes);
  if (bars) torques(1) -= torques(2);
  gears += world.off(p, gears, torques);
  m.q = gears;
  if (!bars) return;
  m.q(2) = gears(2) - gears(1);
  const Joints moments = hidden::load_moments(m.arm, m.q);
  const double upper = m.arm.give(1) * (moments(1) - moments(2));
  m.q(1) += upper;
  m.q(2) += m.arm.give(2) * moments(2) - upper;
  m.arm.give(1) = m.arm.give(2) = 0;
}

HeavyArm coupled_arm(CouplingKind kind, const World& world, std::uint64_t seed) {
  HeavyArm arm = test::draw_heavy_arm({.seed = seed, .links_weigh = false, .payloads = 2});
  auto cell = std::make_shared<Cell>(*arm.cell);
  std::vector<Joint> joints;
  for (int j = 0; j < cell->robot.size(); ++j) joints.push_back(cell->robot.joint(j));
  joints[2].lower = from_deg(-270);
  joints[2].upper = from_deg(270);
  cell->robot = test::demand(Chain::make("coupled", joints, {{2, 1, -1.0, kind}}));
  cell->joint_ranges.clear();
  arm.cell = cell;
  arm.world.effects.push_back(
      {{"unknown", 0, "", -1, {}, 0},
       {},
       Eigen::VectorXd(),
       {},
       [=](const MeasuringPose& p, const auto&, Moment& m) { put(p, kind, world, m); }});
  return arm;
}

Diagnosis diagnosed(CouplingKind kind, const World& world, std::uint64_t seed) {
  const HeavyArm arm = coupled_arm(kind, world, seed);
  hidden::Random random(seed);
  std::vector<MeasuringPose> poses = hidden::draw_poses(
      {.count = kPoses, .approach = world.approach, .constant_temperature = true, .loads = 2},
      random);
  for (MeasuringPose& pose : poses) pose.q(2) += pose.q(1);
  DiagnoseOptions quick;
  quick.draws = 200;
  quick.next_poses = 0;
  quick.recovery = false;
  const MeasurementBatch batch = test::measured_at(arm, poses, seed + 40);
  return test::demand(
      diagnose(arm.cell, test::demand(check_against_cell(batch, *arm.cell)), quick));
}

struct Coupled {
  World world;
  CouplingKind kind;
};

class CoupledJoints : public testing::TestWithParam<Coupled> {};

TEST_P(CoupledJoints, AreDiagnosedAtTheGearThatIsWrong) {
  const World& world = GetParam().world;
  const auto is_true = [&](const Cause& cause) {
    return cause.cause == world.cause && cause.joint == world.joint - 1;
  };
  const Diagnosis diagnosis = diagnosed(GetParam().kind, world, 1);
  const std::string shown = test::told(diagnosis);
  bool named = false;
  for (const Finding& finding : diagnosis.findings) {
    const bool sure = !finding.source.empty() && finding.could_also_be.empty();
    EXPECT_TRUE(!sure || is_true(finding.cause)) << shown;
    named = named || is_true(finding.cause) ||
            std::any_of(finding.could_also_be.begin(), finding.could_also_be.end(), is_true);
  }
  EXPECT_TRUE(named) << shown;
  EXPECT_FALSE(diagnosis.unexplained.present) << shown;
}

TEST(LoadedPlay, OfACoupledJointIsNoOtherCauseForSure) {
  for (const CouplingKind kind : {CouplingKind::kController, CouplingKind::kParallelogram}) {
    for (const int joint : {2, 3}) {
      for (const auto approach : {hidden::Approach::kBothSides, hidden::Approach::kFromBelow}) {
        const Diagnosis diagnosis = diagnosed(kind, loaded_play(joint, approach), 1);
        const std::string shown =
            fmt::format("{} {}: {}", to_string(kind), joint, test::told(diagnosis));
        for (const Finding& finding : diagnosis.findings) {
          const bool sure = !finding.source.empty() && finding.could_also_be.empty();
          const bool right = finding.cause.cause == "backlash" && finding.cause.joint == joint - 1;
          EXPECT_TRUE(!sure || right) << shown;
        }
        const bool explained = diagnosis.after.rms < 1.5 * std::sqrt(3.0) * diagnosis.instrument;
        EXPECT_TRUE(explained || diagnosis.unexplained.present) << shown;
      }
    }
  }
}

std::vector<Coupled> all_worlds() {
  std::vector<Coupled> all;
  for (const World& world : kWorlds)
    for (const CouplingKind kind : {CouplingKind::kController, CouplingKind::kParallelogram})
      all.push_back({world, kind});
  return all;
}

INSTANTIATE_TEST_SUITE_P(Of, CoupledJoints, testing::ValuesIn(all_worlds()), [](const auto& one) {
  return fmt::format("{}By{}", one.param.world.name,
                     one.param.kind == CouplingKind::kController ? "TheController" : "Bars");
});

}  // namespace
}  // namespace trammel
