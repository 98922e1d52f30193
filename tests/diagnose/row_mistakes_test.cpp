#include "server/diagnose/tell/row_mistakes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

#include "server/diagnose/diagnose.h"
#include "tests/support/demand.h"
#include "tests/support/quick_diagnosis.h"
#include "tests/support/virtual_robot.h"

// Rows that somebody got wrong are found, and say how.

namespace trammel {
namespace {

/// cell-7 with a second tool, 60 mm longer.
std::shared_ptr<const Cell> cell_of_two_tools() {
  auto cell = std::make_shared<Cell>(*test::cell_7());
  Pose probe = *cell->tools.at("spindle");
  probe.translation() += Vector3(0.02, 0, 0.06);
  cell->tools["probe"] = probe;
  return cell;
}

std::set<std::string> ids_of(const std::vector<SuspectedPose>& suspects,
                             const std::string& reason) {
  std::set<std::string> ids;
  for (const SuspectedPose& suspect : suspects) {
    if (suspect.reason.find(reason) != std::string::npos) ids.insert(suspect.pose_id);
  }
  return ids;
}

/// So many places of a batch, drawn.
std::set<std::size_t> some_places(std::size_t size, std::size_t count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::set<std::size_t> places;
  while (places.size() < count) places.insert(random() % size);
  return places;
}

bool says(const Diagnosis& diagnosis, const std::string& words) {
  return std::any_of(
      diagnosis.limits.begin(), diagnosis.limits.end(),
      [&](const std::string& limit) { return limit.find(words) != std::string::npos; });
}

TEST(RowMistakes, ExchangedRowsAreLocatedAndSaidToBeExchanged) {
  MeasurementBatch batch = test::measured(test::chapter_5_robot(test::cell_7()), 150, 3, false);
  Measurement& one = batch.measurements[40];
  Measurement& other = batch.measurements[93];
  std::swap(one.p_W, other.p_W);
  const Diagnosis found = test::demand(diagnose(
      test::cell_7(), test::demand(check_against_cell(batch, *test::cell_7())), test::quick()));
  EXPECT_EQ(ids_of(found.suspects, "were rows exchanged"),
            (std::set<std::string>{one.pose_id, other.pose_id}))
      << found.sentence;
  EXPECT_TRUE(says(found, "joints of another row"));
}

/// cell-7's poses with the second tool at every third.
MeasurementBatch with_two_tools(int poses, std::uint64_t seed) {
  const auto cell = cell_of_two_tools();
  MeasurementBatch batch =
      test::measured(test::chapter_5_robot(test::cell_7()), poses, seed, false);
  const VirtualRobot robot = test::chapter_5_robot(cell);
  for (std::size_t i = 0; i < batch.measurements.size(); i += 3) {
    Measurement& m = batch.measurements[i];
    const Pose spindle = robot.truth.pose_W(m.context);
    m.context.tool = "probe";
    m.p_W += robot.truth.pose_W(m.context).translation() - spindle.translation();
  }
  return batch;
}

TEST(RowMistakes, WrongToolIdsAmongRightOnesAreLocated) {
  MeasurementBatch batch = with_two_tools(150, 4);
  std::set<std::string> wrong;
  for (const std::size_t i : some_places(batch.measurements.size(), 8, 1)) {
    std::string& tool = batch.measurements[i].context.tool;
    tool = tool == "probe" ? "spindle" : "probe";
    wrong.insert(batch.measurements[i].pose_id);
  }
  const auto cell = cell_of_two_tools();
  const Diagnosis found =
      test::demand(diagnose(cell, test::demand(check_against_cell(batch, *cell)), test::quick()));
  EXPECT_EQ(ids_of(found.suspects, "is its tool_id wrong"), wrong) << found.sentence;
  EXPECT_TRUE(says(found, "not their tool_id"));
  for (const Finding& finding : found.findings)
    EXPECT_EQ(finding.cause.cause, "outlier") << found.sentence;
}

TEST(RowMistakes, AToolIdThatIsNeverRightIsSaidToBeWrong) {
  MeasurementBatch batch = test::measured(test::chapter_5_robot(test::cell_7()), 150, 4);
  std::set<std::string> wrong;
  for (const std::size_t i : some_places(batch.measurements.size(), 8, 1)) {
    batch.measurements[i].context.tool = "probe";
    wrong.insert(batch.measurements[i].pose_id);
  }
  const auto cell = cell_of_two_tools();
  const Diagnosis found =
      test::demand(diagnose(cell, test::demand(check_against_cell(batch, *cell)), test::quick()));
  EXPECT_EQ(ids_of(found.suspects, "fits tool 'spindle'"), wrong) << found.sentence;
  EXPECT_TRUE(says(found, "tool 'probe' is found where tool 'spindle' is"));
  EXPECT_NE(found.verdict, Verdict::kNamed) << found.sentence;
}

/// Play of 0.2 mrad in joint 2, approached from either side.
MeasurementBatch with_play(int poses, std::uint64_t seed) {
  const auto cell = test::cell_7();
  VirtualRobot robot = test::chapter_5_robot(cell);
  const Eigen::Index at =
      add_source(robot.truth, test::demand(make_error_source("backlash:2", *cell)));
  robot.truth.values(at) = 2e-4;
  MeasurementBatch batch = test::measured(robot, poses, seed);
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

TEST(RowMistakes, WrongMarksOfTheSideOfApproachAreLocatedAndThePlayIsNotSure) {
  for (const double share : {0.0, 0.05, 0.3}) {
    MeasurementBatch batch = with_play(160, 5);
    std::set<std::string> wrong;
    for (const std::size_t i : some_places(160, static_cast<std::size_t>(160 * share), 2)) {
      for (int& side : batch.measurements[i].context.direction) side = -side;
      wrong.insert(batch.measurements[i].pose_id);
    }
    const Diagnosis found = test::demand(diagnose(
        test::cell_7(), test::demand(check_against_cell(batch, *test::cell_7())), test::quick()));
    const auto play =
        std::find_if(found.findings.begin(), found.findings.end(),
                     [](const Finding& one) { return one.cause.cause == "backlash"; });
    ASSERT_NE(play, found.findings.end()) << share << ' ' << found.sentence;
    EXPECT_EQ(play->could_also_be.empty(), share < 0.1) << found.sentence;
    const std::set<std::string> located =
        ids_of(found.suspects, "other side of joint 2 than dir2 says");
    EXPECT_TRUE(std::includes(wrong.begin(), wrong.end(), located.begin(), located.end())) << share;
    EXPECT_GE(static_cast<double>(located.size()), 0.9 * static_cast<double>(wrong.size()))
        << share;
    for (const std::string& source : found.sources_after)
      EXPECT_TRUE(share < 0.1 || !source.starts_with("backlash")) << source;
  }
}

TEST(RowMistakes, TimesThatDoNotRiseAreLocated) {
  MeasurementBatch batch;
  for (const double time : {0.0, 10.0, 20.0, 90.0, 40.0, 50.0, 60.0, 30.0, 80.0, 90.0}) {
    batch.measurements.emplace_back().context.time = time;
  }
  EXPECT_EQ(cause_search::rows_against_time(batch), (std::vector<std::size_t>{3, 7}));
  batch.measurements[3].context.time.reset();
  EXPECT_EQ(cause_search::rows_against_time(batch), (std::vector<std::size_t>{7}));
  batch.measurements[7].context.time.reset();
  EXPECT_TRUE(cause_search::rows_against_time(batch).empty());

  batch = test::measured(test::chapter_5_robot(test::cell_7()), 60, 6);
  for (std::size_t i = 0; i < 60; ++i)
    batch.measurements[i].context.time = 30.0 * static_cast<double>(i);
  std::swap(batch.measurements[12].context.time, batch.measurements[45].context.time);
  const Diagnosis found = test::demand(diagnose(
      test::cell_7(), test::demand(check_against_cell(batch, *test::cell_7())), test::quick()));
  EXPECT_EQ(
      ids_of(found.suspects, "time_s"),
      (std::set<std::string>{batch.measurements[12].pose_id, batch.measurements[45].pose_id}));
  EXPECT_TRUE(says(found, "time_s does not rise"));
}

}  // namespace
}  // namespace trammel
