#include "server/diagnose/evidence/play_sign.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <random>

#include "server/diagnose/diagnose.h"
#include "server/measurement/files/batch_file.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel::cause_search {
namespace {

DiagnoseOptions quick() {
  DiagnoseOptions options;
  options.draws = 200;
  options.recovery = false;
  options.next_poses = 0;
  return options;
}

/// cell-7's virtual robot with play in some joints (b, rad, and its growth with torque, rad/Nm),
/// approached from either side by turns.
MeasurementBatch with_play(const std::map<int, std::pair<double, double>>& play,
                           std::uint64_t seed) {
  const auto cell = test::cell_7();
  VirtualRobot robot = test::chapter_5_robot(cell);
  for (const auto& [joint, values] : play) {
    const Eigen::Index at = add_source(
        robot.truth, test::demand(make_error_source(fmt::format("backlash:{}", joint), *cell)));
    robot.truth.values(at) = values.first;
    robot.truth.values(at + 1) = values.second;
  }
  MeasurementBatch batch = test::measured(robot, 160, seed);
  std::mt19937_64 random(seed);
  for (Measurement& m : batch.measurements) {
    const PoseContext still = m.context;
    m.context.direction.assign(6, 0);
    for (int& side : m.context.direction) side = random() % 2 == 0 ? 1 : -1;
    const Pose moved = robot.truth.pose_W(m.context) * robot.truth.pose_W(still).inverse();
    m.p_W = moved * m.p_W;
    m.R_WT = moved.linear() * *m.R_WT;
  }
  return batch;
}

bool names_backlash(const Diagnosis& diagnosis) {
  return std::any_of(diagnosis.findings.begin(), diagnosis.findings.end(),
                     [](const Finding& finding) { return finding.cause.cause == "backlash"; });
}

bool holds(const std::vector<std::string>& list, const char* word) {
  return std::find(list.begin(), list.end(), word) != list.end();
}

TEST(PlaySign, PlayOfItsOwnSignIsNamed) {
  const Diagnosis found =
      test::demand(diagnose(test::cell_7(), with_play({{3, {1e-4, 0}}}, 1), quick()));
  ASSERT_EQ(found.findings.size(), 1u) << found.sentence;
  EXPECT_EQ(found.findings[0].cause.cause, "backlash");
  EXPECT_FALSE(found.unexplained.present) << found.sentence;
}

TEST(PlaySign, TheOtherSignIsNoPlayButUnknownAndDependsOnTheSideOfThatJoint) {
  for (const auto& [b, k] : {std::pair(-1e-4, 0.0), {0.0, -4e-8}}) {
    const Diagnosis open =
        test::demand(diagnose(test::cell_7(), with_play({{3, {b, k}}}, 2), quick()));
    EXPECT_FALSE(names_backlash(open)) << open.sentence;
    EXPECT_EQ(open.verdict, Verdict::kUnknown) << open.sentence;
    EXPECT_TRUE(open.unexplained.present);
    EXPECT_TRUE(holds(open.unexplained.depends_on, "q3")) << open.sentence;
    EXPECT_TRUE(holds(open.unexplained.depends_on, "dir3")) << open.sentence;
    EXPECT_GT(open.unexplained.rms, 2e-5);
    EXPECT_NE(open.sentence.find("before they stood still"), std::string::npos) << open.sentence;
    EXPECT_NE(open.sentence.find("dir3 column"), std::string::npos) << open.sentence;
    EXPECT_EQ(open.sentence.find("gear adjusted"), std::string::npos) << open.sentence;
    for (const std::string& source : open.sources_after)
      EXPECT_FALSE(source.starts_with("backlash")) << source;
    for (const Unseen& unseen : open.could_not_have_seen)
      EXPECT_FALSE(unseen.cause.cause == "backlash" && unseen.cause.joint == 2) << unseen.needs;
    for (const std::string& limit : open.limits)
      EXPECT_EQ(limit.find("beside what is unexplained"), std::string::npos);
  }
}

TEST(PlaySign, NegativeInEveryJointAsksWhetherTheDirectionsAreReversed) {
  MeasurementBatch batch = with_play(
      {{1, {8e-5, 0}}, {2, {6e-5, 0}}, {3, {1e-4, 0}}, {4, {1.5e-4, 0}}, {5, {1.5e-4, 0}}}, 3);
  for (Measurement& m : batch.measurements) {
    for (int& side : m.context.direction) side = -side;
  }
  const Diagnosis open = test::demand(diagnose(test::cell_7(), batch, quick()));
  EXPECT_FALSE(names_backlash(open)) << open.sentence;
  EXPECT_EQ(open.verdict, Verdict::kUnknown) << open.sentence;
  EXPECT_NE(open.sentence.find("are the dir columns reversed?"), std::string::npos)
      << open.sentence;
}

TEST(PlaySign, ARealRobotWhoseDirectionsAreItsMovesIsNotToldToAdjustItsGears) {
  const std::string file = TRAMMEL_SOURCE_DIR "/../shared/data/ur10_series_c.csv";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << file << " is not there";
  MeasurementBatch batch = test::demand(read_batch(file));
  const JointVector* last = nullptr;
  for (Measurement& m : batch.measurements) {  // the rows of the whole series, in order
    m.context.direction.assign(6, 0);
    for (int j = 0; last != nullptr && j < 6; ++j)
      m.context.direction[static_cast<std::size_t>(j)] = m.context.q(j) > (*last)(j)   ? 1
                                                         : m.context.q(j) < (*last)(j) ? -1
                                                                                       : 0;
    last = &m.context.q;
  }
  for (std::size_t i = 0; 12 * i < batch.measurements.size(); ++i)
    batch.measurements[i] = batch.measurements[12 * i];
  batch.measurements.resize((batch.measurements.size() + 11) / 12);
  const auto cell =
      std::make_shared<const Cell>(test::demand(read_cell(TRAMMEL_SOURCE_DIR "/config/ur10.yaml")));
  const Diagnosis real = test::demand(diagnose(cell, batch, quick()));
  for (const Finding& finding : real.findings) {
    if (finding.cause.cause != "backlash") continue;
    EXPECT_GT(finding.parameters.front().value, 0) << real.sentence;
  }
  EXPECT_NE(real.sentence.find("dir"), std::string::npos) << real.sentence;
}

}  // namespace
}  // namespace trammel::cause_search
