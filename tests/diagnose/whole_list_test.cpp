#include "server/diagnose/search/whole_list.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "server/diagnose/diagnose.h"
#include "server/plan/plan.h"
#include "server/robot/inverse_kinematics.h"
#include "server/simulate/simulate.h"
#include "tests/support/demand.h"
#include "tests/support/one_point.h"
#include "tests/support/temporary_folder.h"

// What the whole list explains, link geometry included, is not unknown.

namespace trammel {
namespace {

/// A robot on a rail of which only the place of the base is identified.
std::shared_ptr<const Cell> cell_on_rail() {
  const test::TemporaryFolder folder;
  const std::string text = fmt::format(
      "version: 1\ncell: on-rail\nrobot: {}/models/abb_irb6640-205-275-on-rail.yaml\n"
      "base: {{xyz_mm: [0, 0, 0], q_wxyz: [1, 0, 0, 0]}}\n"
      "tools: {{probe: {{xyz_mm: [60, 0, 140], q_wxyz: [1, 0, 0, 0]}}}}\ntracker: {{sigma_mm: "
      "0.03}}\n"
      "model: {{error_sources: [base], bias: none}}\n",
      TRAMMEL_SOURCE_DIR);
  return std::make_shared<const Cell>(test::demand(read_cell(folder.write("cell.yaml", text))));
}

/// The rail runs so many rad off its drawn direction.
Diagnosis diagnosed(double sideways, double upwards, std::uint64_t seed) {
  const auto cell = cell_on_rail();
  VirtualRobot robot{test::demand(make_physical_model(cell, {"geometry"})), 30e-6, 0, {}};
  const std::vector<Parameter> parameters = robot.truth.parameters();
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    if (parameters[k].name == "theta1") robot.truth.values(static_cast<Eigen::Index>(k)) = sideways;
    if (parameters[k].name == "alpha1") robot.truth.values(static_cast<Eigen::Index>(k)) = upwards;
  }
  SimulateOptions options;
  options.seed = seed;
  options.orientation = false;
  const MeasurementBatch batch =
      test::demand(simulate(robot, test::demand(plan_poses(*cell, {80, seed})), options));
  DiagnoseOptions quick;
  quick.draws = 200;
  quick.next_poses = 0;
  quick.recovery = false;
  return test::demand(diagnose(cell, test::demand(check_against_cell(batch, *cell)), quick));
}

TEST(WholeList, ARailThatRunsOffItsDrawnDirectionIsLinkGeometry) {
  for (const std::uint64_t seed : {1, 2}) {
    const Diagnosis found = diagnosed(1.2e-3, 0.8e-3, seed);
    EXPECT_TRUE(std::any_of(found.findings.begin(), found.findings.end(), [](const Finding& one) {
      return one.cause.cause == "geometry";
    })) << found.sentence;
    EXPECT_FALSE(found.unexplained.present) << found.sentence;
    EXPECT_LT(found.after.rms, 70e-6) << found.sentence;
    EXPECT_EQ(found.sentence.find("no known cause"), std::string::npos) << found.sentence;
  }
}

/// A UR5 whose joint 5 is off by that much turns its tip about one place: 30 orientations.
Diagnosis about_one_point(double zero) {
  const test::TemporaryFolder folder;
  const std::string text = fmt::format(
      "version: 1\ncell: tip\nrobot: {}/models/universal-robots_ur5.yaml\nbase: null\n"
      "tools: {{tip: {{xyz_mm: [40, 10, 160], q_wxyz: [1, 0, 0, 0]}}}}\n"
      "tracker: {{sigma_mm: 0.02}}\nmodel: {{error_sources: [base], bias: none}}\n",
      TRAMMEL_SOURCE_DIR);
  const auto cell =
      std::make_shared<const Cell>(test::demand(read_cell(folder.write("cell.yaml", text))));
  VirtualRobot robot{test::demand(make_physical_model(cell, {"joint_slip:5@1"})), 20e-6, 0, {}};
  const Vector3 p_FT = robot.truth.tools.at("tip").translation();
  robot.truth.values(0) = zero;
  std::vector<PoseContext> poses;
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> turn(-0.6, 0.6);
  const JointVector seed = (JointVector(6) << 0.6, -1.5, 1.4, -1.4, -1.6, 0.4).finished();
  const Pose X_BF = cell->robot.flange_pose(seed);
  const Vector3 tip = X_BF * p_FT;
  while (poses.size() < 30) {
    const Matrix3 R =
        rotation_exp(Vector3(turn(random), turn(random), 2 * turn(random))) * X_BF.linear();
    const InverseResult found = inverse_kinematics(cell->robot, make_pose(R, tip - R * p_FT), seed);
    if (found.status != InverseStatus::kOk) continue;
    poses.emplace_back();
    poses.back().q = found.q;
  }
  SimulateOptions options;
  options.orientation = false;
  const MeasurementBatch batch = test::demand(simulate(robot, poses, options));
  DiagnoseOptions quick;
  quick.draws = 200;
  quick.recovery = false;
  return test::demand(diagnose(cell, test::demand(check_against_cell(batch, *cell)), quick));
}

TEST(WholeList, AboutOnePointBaseToolAndZerosAreNotToldApartAndOtherPosesAreGiven) {
  const Diagnosis told = about_one_point(0.014);
  EXPECT_EQ(told.sentence.find("no known cause"), std::string::npos) << told.sentence;
  EXPECT_EQ(told.verdict, Verdict::kAmbiguous) << told.sentence;
  ASSERT_FALSE(told.findings.empty()) << told.sentence;
  const Finding& one = told.findings.front();
  EXPECT_EQ(one.cause.cause, "geometry");
  for (const char* rival : {"base", "tool"})
    EXPECT_NE(std::find(one.could_also_be.begin(), one.could_also_be.end(), Cause{rival}),
              one.could_also_be.end())
        << rival;
  EXPECT_NE(one.action.find("other places"), std::string::npos) << one.action;
  EXPECT_FALSE(told.next_poses.q.empty()) << told.next_poses.none_because;
  EXPECT_TRUE(std::any_of(told.limits.begin(), told.limits.end(), [](const std::string& limit) {
    return limit.find("measured at one point") != std::string::npos;
  }));
  EXPECT_FALSE(told.budget) << "a line of it would advise what these poses cannot tell";
}

TEST(WholeList, AboutOnePointAToolThatIsOffIsTheToolWhereNobodySaidWhereTheRobotStands) {
  const auto cell =
      test::cell_of_one_point("null", test::kToolOfOnePoint, "{error_sources: [], bias: none}");
  const Pose X_WB = Eigen::Translation3d(0.4, -0.2, 0.1) * Eigen::AngleAxisd(0.7, Vector3::UnitZ());
  const MeasurementBatch batch = test::one_point(*cell, Vector3(4e-3, -3e-3, 6e-3), X_WB, 30, 3);
  DiagnoseOptions quick;
  quick.draws = 200;
  quick.recovery = false;
  quick.next_poses = 0;
  const Diagnosis told =
      test::demand(diagnose(cell, test::demand(check_against_cell(batch, *cell)), quick));
  ASSERT_EQ(told.findings.size(), 1U) << told.sentence;
  EXPECT_EQ(told.findings.front().cause, Cause{"tool"}) << told.sentence;
  EXPECT_TRUE(told.findings.front().could_also_be.empty()) << told.sentence;
}

/// Joint 6 lacks `share` of joint 5, as raw pulses do, on an arm whose links are off by tenths of a
/// mm, seen by a reflector `reach` m off the last axis.
Diagnosis with_wrist_coupling(double share, double reach, unsigned seed = 3) {
  const test::TemporaryFolder folder;
  const std::string text = fmt::format(
      "version: 1\ncell: wrist\nrobot: {}/models/yaskawa_gp25.yaml\nbase: null\ntools: {{t1: "
      "null}}\n"
      "tracker: {{sigma_mm: 0.03}}\nmodel: {{error_sources: [base, tool, geometry], bias: none}}\n",
      TRAMMEL_SOURCE_DIR);
  Cell drawn = test::demand(read_cell(folder.write("cell.yaml", text)));
  drawn.joint_ranges = {{-1.6, 1.8}, {-0.9, 1.4}, {-0.6, 1.8}, {-2, 2}, {-1.6, 1.5}, {-2.6, 2.5}};
  const auto cell = std::make_shared<const Cell>(std::move(drawn));
  VirtualRobot robot{
      test::demand(make_physical_model(cell, {"geometry", "wrist_coupling"})), 30e-6, 0, {}};
  robot.truth.tools.at("t1").translation() = Vector3(reach, 0.3 * reach, 0.2);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> off(0, 3e-4);
  const std::vector<Parameter> parameters = robot.truth.parameters();
  for (std::size_t k = 0; k < parameters.size(); ++k)
    robot.truth.values(static_cast<Eigen::Index>(k)) = parameters[k].name == "k65"    ? -share
                                                       : parameters[k].name[0] == 'k' ? 0
                                                                                      : off(random);
  SimulateOptions options;
  options.orientation = false;
  const MeasurementBatch batch =
      test::demand(simulate(robot, test::demand(plan_poses(*cell, {80, seed})), options));
  DiagnoseOptions quick;
  quick.draws = 200;
  quick.next_poses = 0;
  quick.recovery = false;
  return test::demand(diagnose(cell, test::demand(check_against_cell(batch, *cell)), quick));
}

bool finds_wrist_coupling(const Diagnosis& found) {
  const auto is_coupling = [](const Cause& cause) { return cause.cause == "wrist_coupling"; };
  return std::any_of(found.findings.begin(), found.findings.end(), [&](const Finding& one) {
    return is_coupling(one.cause) ||
           std::any_of(one.could_also_be.begin(), one.could_also_be.end(), is_coupling);
  });
}

TEST(WholeList, AWristCouplingTooLargeForADerivativeIsFound) {
  const Diagnosis found = with_wrist_coupling(1.0 / 50, 0.12);
  EXPECT_TRUE(finds_wrist_coupling(found)) << found.sentence;
}

// A dependence without a name passes in these, and does not pass beside all the rest.
TEST(WholeList, AWristCouplingIsFoundWhereADependenceComesAndGoes) {
  for (const auto& [reach, seed] : {std::pair{0.07, 18U}, {0.08, 24U}}) {
    const Diagnosis found = with_wrist_coupling(1.0 / 50, reach, seed);
    EXPECT_TRUE(finds_wrist_coupling(found)) << seed << ": " << found.sentence;
  }
}

// Its prior is a twentieth of it, and it is noise itself: beside so much noise the prior holds it.
TEST(WholeList, AWristCouplingThatAReflectorNearTheAxisHardlyShowsIsFoundAndBlamesNoLink) {
  for (const double share : {1.0 / 100, 1.0 / 50}) {
    const Diagnosis found = with_wrist_coupling(share, 0.08);
    EXPECT_TRUE(finds_wrist_coupling(found)) << share << ": " << found.sentence;
    EXPECT_EQ(found.sentence.find("off its drawing"), std::string::npos) << found.sentence;
    ASSERT_TRUE(found.budget);
    for (const BudgetLine& line : found.budget->beyond_frames.lines)
      EXPECT_TRUE(line.kind == LineKind::kCause || line.action.empty()) << line.name << line.action;
  }
}

}  // namespace
}  // namespace trammel
