#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <memory>

#include "server/error_sources/physical_model.h"
#include "server/robot/cell.h"
#include "tests/support/demand.h"

// Two joints of which the second is commanded against the world: by a controller that counts so, or
// by bars. The arm of this test is two links in a plane, computed with sines and cosines.

namespace trammel {
namespace {

constexpr double kUpper = 0.9, kFore = 0.7;  // m
constexpr double kMass = 40;                 // kg, at the tip
constexpr double kOrder = 31;                // cycles a turn, of a ripple

using Angles = std::array<double, 2>;  // of upper arm and forearm against level, rad

/// The tip where gravity points along -y.
Vector3 tip(const Angles& level) {
  return {kUpper * std::cos(level[0]) + kFore * std::cos(level[1]),
          kUpper * std::sin(level[0]) + kFore * std::sin(level[1]), 0};
}

std::shared_ptr<const Cell> planar_cell(CouplingKind kind) {
  auto cell = std::make_shared<Cell>();
  std::vector<Joint> joints(2);
  joints[0].link.a = kUpper;
  joints[1].link.a = kFore;
  for (Joint& joint : joints) {
    joint.lower = -3;
    joint.upper = 3;
  }
  cell->robot = test::demand(Chain::make("planar", joints, {{1, 0, -1.0, kind}}));
  cell->X_WB = Pose::Identity();
  cell->gravity_W = -Vector3::UnitY();
  cell->tools["t"] = Pose::Identity();
  cell->payloads["p"] = {kMass, Vector3::Zero()};
  return cell;
}

/// The arm's gears: what each angle is, what torque it carries, and what its errors move.
struct Gears {
  CouplingKind kind;
  [[nodiscard]] bool in_bars() const { return kind == CouplingKind::kParallelogram; }

  [[nodiscard]] Angles at(const Angles& level) const {
    return {level[0], in_bars() ? level[1] : level[1] - level[0]};
  }
  [[nodiscard]] Angles torque(const Angles& level) const {
    const double upper = -kMass * kGravity * kUpper * std::cos(level[0]);
    const double fore = -kMass * kGravity * kFore * std::cos(level[1]);
    return {in_bars() ? upper : upper + fore, fore};
  }
  [[nodiscard]] Angles moved(const Angles& level, const Angles& by) const {
    return {level[0] + by[0], level[1] + by[1] + (in_bars() ? 0 : by[0])};
  }
};

struct Case {
  const char* source;
  std::vector<double> values;  // SI
  /// How far each gear is off.
  std::function<Angles(const Gears&, const Angles& level, const Angles& before)> off;
};

std::vector<Case> cases() {
  const auto ripple = [](double g) {
    return 2e-3 * std::sin(kOrder * g) - 1e-3 * std::cos(kOrder * g);
  };
  return {
      {"joint_slip:1@1",
       {3e-3},
       [](const Gears&, const Angles&, const Angles&) {
         return Angles{3e-3, 0};
       }},
      {"joint_slip:2@1",
       {3e-3},
       [](const Gears&, const Angles&, const Angles&) {
         return Angles{0, 3e-3};
       }},
      {"gear_transmission:2@31",
       {kOrder, 2e-3, -1e-3},
       [=](const Gears& gears, const Angles& level, const Angles&) {
         return Angles{0, ripple(gears.at(level)[1])};
       }},
      {"encoder_eccentricity:2",
       {1e-3, 2e-3},
       [](const Gears& gears, const Angles& level, const Angles&) {
         const double g = gears.at(level)[1];
         return Angles{0, 1e-3 * std::sin(g) + 2e-3 * std::cos(g)};
       }},
      {"joint_map:2@2",
       {0, 0, 3e-3, 0},
       [](const Gears& gears, const Angles& level, const Angles&) {
         return Angles{0, 3e-3 * std::sin(2 * gears.at(level)[1])};
       }},
      {"backlash:1",
       {1e-3, 2e-6},
       [](const Gears& gears, const Angles& level, const Angles&) {
         return Angles{-(1e-3 + 2e-6 * std::abs(gears.torque(level)[0])), 0};
       }},
      {"backlash:2",
       {1e-3, 2e-6},
       [](const Gears& gears, const Angles& level, const Angles&) {
         return Angles{0, 1e-3 + 2e-6 * std::abs(gears.torque(level)[1])};
       }},
      {"loaded_ripple:1@31",
       {kOrder, 4e-6, 0},
       [](const Gears& gears, const Angles& level, const Angles&) {
         return Angles{gears.torque(level)[0] * 4e-6 * std::sin(kOrder * level[0]), 0};
       }},
      {"early_reading",
       {2e-3, 3e-3},
       [](const Gears& gears, const Angles& level, const Angles& before) {
         const Angles now = gears.at(level), then = gears.at(before);
         return Angles{2e-3 * (then[0] - now[0]), 3e-3 * (then[1] - now[1])};
       }},
      {"compliance_first_order",
       {2e-6, 5e-6},
       [](const Gears& gears, const Angles& level, const Angles&) {
         const Angles torque = gears.torque(level);
         return Angles{2e-6 * torque[0], 5e-6 * torque[1]};
       }},
      {"compliance_equilibrium",
       {2e-6, 5e-6},
       [](const Gears& gears, const Angles& level, const Angles&) {
         Angles off{0, 0};
         for (int step = 0; step < 50; ++step) {
           const Angles torque = gears.torque(gears.moved(level, off));
           off = {2e-6 * torque[0], 5e-6 * torque[1]};
         }
         return off;
       }},
      {"geometry",
       {3e-3, 0, 0, 0, -2e-3, 0, 0, 0},
       [](const Gears&, const Angles&, const Angles&) {
         return Angles{3e-3, -2e-3};
       }},
  };
}

class CoupledJoints : public testing::TestWithParam<CouplingKind> {};

TEST_P(CoupledJoints, EveryCauseActsOnTheGearAsItIsBuilt) {
  const Gears gears{GetParam()};
  const auto cell = planar_cell(gears.kind);
  const Angles before{0.2, -0.9};
  for (const Angles& level : {Angles{0.7, 0.3}, Angles{1.2, -0.5}, Angles{-0.4, 0.6}}) {
    PoseContext context;
    context.q = Eigen::Vector2d(level[0], level[1]);  // the controller counts both against level
    context.before = Eigen::Vector2d(before[0], before[1]);
    context.direction = {1, -1};
    context.tool = "t";
    context.payload = "p";
    for (const Case& one : cases()) {
      PhysicalModel model = test::demand(make_physical_model(cell, {one.source}));
      ASSERT_EQ(model.values.size(), static_cast<Eigen::Index>(one.values.size())) << one.source;
      for (std::size_t k = 0; k < one.values.size(); ++k)
        model.values(static_cast<Eigen::Index>(k)) = one.values[k];
      const Vector3 expected = tip(gears.moved(level, one.off(gears, level, before)));
      EXPECT_LT((model.pose_W(context).translation() - expected).norm(), 1e-9) << one.source;
      EXPECT_GT((tip(level) - expected).norm(), 1e-5) << one.source;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(By, CoupledJoints,
                         testing::Values(CouplingKind::kController, CouplingKind::kParallelogram),
                         [](const auto& kind) { return std::string(to_string(kind.param)); });

}  // namespace
}  // namespace trammel
