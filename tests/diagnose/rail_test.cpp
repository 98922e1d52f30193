#include <gtest/gtest.h>

#include <algorithm>

#include "server/diagnose/diagnose.h"
#include "server/plan/plan.h"
#include "server/simulate/simulate.h"
#include "tests/support/demand.h"
#include "tests/support/temporary_folder.h"

// A robot on a rail whose drive or line is not as told.

namespace trammel {
namespace {

std::shared_ptr<const Cell> cell_on_rail() {
  const test::TemporaryFolder folder;
  const std::string text = fmt::format(
      "version: 1\ncell: on-rail\nrobot: {}/models/abb_irb6640-205-275-on-rail.yaml\n"
      "base: {{xyz_mm: [0, 0, 0], q_wxyz: [1, 0, 0, 0]}}\ngravity: [0, 0, -1]\n"
      "tools: {{probe: {{xyz_mm: [60, 0, 140], q_wxyz: [1, 0, 0, 0]}}}}\n"
      "payloads: {{probe: {{mass_kg: 60, cog_mm: [20, 0, 90]}}}}\ntracker: {{sigma_mm: 0.02, "
      "sigma_deg: 0.004}}\n"
      "model: {{error_sources: [base, geometry, compliance], bias: none}}\n",
      TRAMMEL_SOURCE_DIR);
  return std::make_shared<const Cell>(test::demand(read_cell(folder.write("cell.yaml", text))));
}

/// What is said where the robot is as drawn but for that source, its parameters at so much of their
/// prior scales.
Diagnosis diagnosed(const std::string& source, double share, std::uint64_t seed) {
  const auto cell = cell_on_rail();
  VirtualRobot robot{
      test::demand(make_physical_model(
          cell, source.empty() ? std::vector<std::string>{"base"} : std::vector{source})),
      20e-6,
      7e-5,
      {}};
  const std::vector<Parameter> parameters = robot.truth.parameters();
  for (std::size_t k = 0; k < parameters.size() && !source.empty(); ++k)
    robot.truth.values(static_cast<Eigen::Index>(k)) =
        (k % 2 == 0 ? share : -share) * parameters[k].prior_scale;
  SimulateOptions options;
  options.seed = seed;
  const MeasurementBatch batch =
      test::demand(simulate(robot, test::demand(plan_poses(*cell, {150, seed})), options));
  DiagnoseOptions quick;
  quick.draws = 200;
  quick.next_poses = 0;
  quick.recovery = false;
  return test::demand(diagnose(cell, test::demand(check_against_cell(batch, *cell)), quick));
}

std::string said(const Diagnosis& diagnosis) {
  std::string text(to_string(diagnosis.verdict));
  for (const Finding& finding : diagnosis.findings) text += " " + to_string(finding.cause);
  return text;
}

TEST(DiagnosisOnARail, ADriveThatTravelsTooFarIsNamed) {
  const Diagnosis diagnosis = diagnosed("rail_scale:1", 0.5, 3);
  ASSERT_EQ(diagnosis.findings.size(), 1u) << said(diagnosis);
  EXPECT_EQ(to_string(diagnosis.findings.front().cause), "rail_scale:1");
  EXPECT_EQ(diagnosis.verdict, Verdict::kNamed) << said(diagnosis);
}

TEST(DiagnosisOnARail, ABentRailIsNamed) {
  const Diagnosis diagnosis = diagnosed("rail_straightness:1", 0.5, 3);
  ASSERT_FALSE(diagnosis.findings.empty()) << said(diagnosis);
  EXPECT_EQ(to_string(diagnosis.findings.front().cause), "rail_straightness:1") << said(diagnosis);
}

TEST(DiagnosisOnARail, AGoodRailIsNotBlamed) {
  for (const std::uint64_t seed : {4, 5}) EXPECT_TRUE(diagnosed("", 0, seed).findings.empty());
}

}  // namespace
}  // namespace trammel
