#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "server/base/units.h"
#include "server/calibrate/one_session.h"
#include "server/compensate/budget/remedies.h"
#include "server/compensate/model_file.h"
#include "server/compensate/model_notes.h"
#include "server/compensate/session_changes.h"
#include "server/compensate/world.h"
#include "server/robot/rigid_fit.h"
#include "server/tasks/train/did_it_help.h"
#include "server/tasks/train/lasting_sources.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/learning_cell.h"
#include "tests/support/refusal.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using test::measured_on;
using test::true_error;

const TrainOptions kPhysics = [] {
  TrainOptions options;
  options.bias = "none";
  return options;
}();

CheckedBatch checked(MeasurementBatch batch, const std::string& id, const Cell& cell) {
  batch.id = id;
  return test::demand(check_against_cell(std::move(batch), cell));
}

/// Batches of 60 poses, the tracker set up anew for each; from session `changed` on (from 0) on
/// another robot.
CheckedBatch sessions_of(const VirtualRobot& robot, const VirtualRobot& after, int count,
                         int changed, std::uint64_t seed, int poses = 60) {
  std::vector<CheckedBatch> batches;
  for (int s = 0; s < count; ++s) {
    const test::Day day{
        .poses = poses, .seed = seed + 17 * static_cast<std::uint64_t>(s), .set_up_anew = true};
    batches.push_back(checked(measured_on(s < changed ? robot : after, day),
                              fmt::format("day-{}", s + 1), *robot.truth.cell));
  }
  return joined(batches);
}

TEST(Sessions, FiveOfSixtyPosesWithAMovedTrackerAreWorthThreeHundredOfOneSetUp) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  double several = 0, one = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const CheckedBatch alone =
        checked(measured_on(robot, {.poses = 300, .seed = 100 * seed}), "all", *cell);
    several += true_error(
        test::demand(train(cell, sessions_of(robot, robot, 5, 5, 100 * seed), kPhysics)), robot);
    one += true_error(test::demand(train(cell, alone, kPhysics)), robot);
  }
  EXPECT_LT(several, 1.25 * one);
}

TEST(Sessions, AZeroLostBetweenTwoIsFoundAndDatedAndTheRestOfTheOldDataGoesOnCounting) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  for (int joint = 2; joint <= 5; ++joint) {
    const VirtualRobot after = test::with_zero_off(robot, joint, 2e-4);
    const CheckedBatch batch =
        sessions_of(robot, after, 4, 2, 1000 + static_cast<std::uint64_t>(joint));
    const CompensatedModel model = test::demand(train(cell, batch, kPhysics));
    const auto& parts = model.parts();
    ASSERT_EQ(parts.changes.size(), 1u) << "joint " << joint;
    EXPECT_EQ(parts.changes.front().source, fmt::format("joint_slip:{}@121", joint));
    EXPECT_EQ(parts.sessions[parts.changes.front().session].id, "day-3");
    EXPECT_TRUE(parts.changes.front().could_also_be.empty());
    EXPECT_LT(true_error(model, after), 1e-5);
    const std::string note = notes_of(model).front().text;
    EXPECT_NE(note.find("since session day-3 (pose day-3/1)"), std::string::npos) << note;
    EXPECT_EQ(test::demand(deserialize(serialize(model), "again")).parts().changes.front().source,
              parts.changes.front().source);
  }
}

TEST(Sessions, WhatChangedIsDataWithItsSessionAndItsUncertainty) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const CheckedBatch batch = sessions_of(robot, test::with_zero_off(robot, 3, 2e-4), 4, 2, 1003);
  const CompensatedModel model = test::demand(train(cell, batch, kPhysics));
  const std::vector<SessionChange> changes = session_changes(model);
  ASSERT_EQ(changes.size(), 1u);
  const SessionChange& change = changes.front();
  EXPECT_EQ(change.cause, "joint_slip");
  EXPECT_EQ(change.joint, 3);
  EXPECT_EQ(change.session_id, "day-3");
  EXPECT_EQ(change.pose_id, "day-3/1");
  ASSERT_EQ(change.sizes.size(), 1u);
  EXPECT_EQ(change.sizes.front().unit, "deg") << "people read degrees";
  EXPECT_LT(change.sizes.front().u95, 0.003);
  EXPECT_NEAR(change.sizes.front().value, to_deg(2e-4), 2 * change.sizes.front().u95);
  ASSERT_TRUE(model.parts().budget);
  const std::vector<BudgetLine>& between = model.parts().budget->between_sessions;
  ASSERT_EQ(between.size(), 1u) << "what changed has a budget of its own";
  EXPECT_EQ(between.front().since_session, "day-3");
  EXPECT_EQ(between.front().joint, 2);
  EXPECT_EQ(between.front().name, "lost zero in joint 3 since session day-3");
  EXPECT_EQ(between.front().action, "") << "it is no farther off than mastering leaves a zero";
  // Half of the poses are of sessions since: over all poses the line is smaller by sqrt(2).
  const BudgetLine* of_all = model.parts().budget->line(between.front().line);
  ASSERT_NE(of_all, nullptr);
  EXPECT_NEAR(between.front().alone_rms / of_all->alone_rms, 1.414, 0.15);
  const CompensatedModel again = test::demand(deserialize(serialize(model), "again"));
  ASSERT_EQ(again.parts().budget->between_sessions.size(), 1u);
  EXPECT_EQ(again.parts().budget->between_sessions.front().since_session, "day-3");
}

TEST(Sessions, AZeroThatWasLostByADegreeStandsOutInTheBudgetAndHasAnAction) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const VirtualRobot after = test::with_zero_off(robot, 4, from_deg(1));
  const CompensatedModel model =
      test::demand(train(cell, sessions_of(robot, after, 2, 1, 1004), kPhysics));
  ASSERT_TRUE(model.parts().budget);
  const ErrorBudget& budget = *model.parts().budget;
  ASSERT_EQ(budget.between_sessions.size(), 1u);
  const BudgetLine& lost = budget.between_sessions.front();
  ASSERT_TRUE(lost.value);
  EXPECT_NEAR(lost.value->value, 1, 2 * lost.value->u95);
  EXPECT_GT(lost.times_usual.value_or(0), 10);
  EXPECT_NE(lost.action.find("revolution counter"), std::string::npos) << lost.action;
  EXPECT_EQ(budget.as_it_stands.lines.front().line, lost.line) << "what stands out leads";
}

TEST(Sessions, WhetherAZeroThatWasLostBetweenThemWasPutRightIsToldByNewPoses) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const VirtualRobot after = test::with_zero_off(robot, 4, from_deg(1));
  const CompensatedModel model =
      test::demand(train(cell, sessions_of(robot, after, 2, 1, 1004), kPhysics));
  const std::vector<ZeroRemedy> zeros = zero_remedies(*model.parts().budget);
  const auto zero = std::find_if(zeros.begin(), zeros.end(),
                                 [](const ZeroRemedy& one) { return one.joint == 3; });
  ASSERT_NE(zero, zeros.end());
  EXPECT_NEAR(zero->add, 1 + to_deg(-2.6e-4), 0.02) << "what was off before, and what was lost";
  for (const bool repaired : {true, false}) {
    const CheckedBatch poses =
        checked(measured_on(repaired ? robot : after, {.poses = 60, .seed = 77}), "new", *cell);
    const AfterRepair told = test::demand(did_it_help(model, cell, poses));
    ASSERT_FALSE(told.lines.empty());
    const LineOutcome& lost = told.lines.front();
    EXPECT_EQ(lost.line, "zero:4");
    EXPECT_NEAR(lost.before.value, 1, 0.03);
    EXPECT_EQ(to_string(lost.helped), repaired ? "put_right" : "not_moved");
    EXPECT_NEAR(lost.moved.value, repaired ? -1 : 0, std::max(2 * lost.moved.u95, 0.01));
    for (const BudgetLine& line : told.difference.budget.beyond_frames.lines)
      EXPECT_EQ(line.line.find("slip"), std::string::npos) << line.line;
  }
}

TEST(Sessions, WhereNoClockTellsTheirOrderTheModelSaysOnWhatItRests) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const VirtualRobot after = test::with_zero_off(robot, 3, 2e-4);
  const auto model_of = [&](bool first_has_time) {
    std::vector<CheckedBatch> days;
    for (int s = 0; s < 3; ++s) {
      const test::Day day{
          .poses = 60, .seed = 500 + 17 * static_cast<std::uint64_t>(s), .set_up_anew = true};
      MeasurementBatch batch = measured_on(s < 2 ? robot : after, day);
      // Given as day 3, day 1, day 2; the clocks say otherwise.
      const double at = 1.7e9 + 86400.0 * s;
      for (Measurement& m : batch.measurements) {
        if (first_has_time || s > 0) m.context.time = at + 60.0 * static_cast<double>(m.row);
      }
      batch = dated(std::move(batch), 1'800'000'000);
      days.push_back(checked(std::move(batch), fmt::format("day-{}", s + 1), *cell));
    }
    return test::demand(train(cell, joined({days[2], days[0], days[1]}), kPhysics));
  };
  const CompensatedModel by_time = model_of(true), as_given = model_of(false);
  const auto dated_changes = session_changes(by_time), given_changes = session_changes(as_given);
  ASSERT_EQ(dated_changes.size(), 1u);
  EXPECT_EQ(dated_changes.front().session_id, "day-3");
  EXPECT_FALSE(dated_changes.front().rests_on_order);
  EXPECT_FALSE(note_on_order(by_time.parts().sessions, by_time.parts().sessions_as_given));
  ASSERT_EQ(given_changes.size(), 1u);
  EXPECT_EQ(given_changes.front().session_id, "day-1") << "by their order the arm has changed back";
  EXPECT_TRUE(given_changes.front().rests_on_order);
  const std::vector<Note> notes = notes_of(as_given);
  EXPECT_NE(notes.front().text.find("rests on the order"), std::string::npos) << notes.front().text;
  EXPECT_TRUE(std::any_of(notes.begin(), notes.end(), [](const Note& note) {
    return note.text.find("day-2 is taken for the newest") != std::string::npos;
  })) << notes.size();
  const CompensatedModel again = test::demand(deserialize(serialize(as_given), "again"));
  EXPECT_TRUE(again.parts().sessions_as_given);
}

TEST(Sessions, NothingHasChangedWhereOnlyTheTrackerMoved) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const CompensatedModel model =
        test::demand(train(cell, sessions_of(robot, robot, 4, 4, 7000 * seed), kPhysics));
    EXPECT_TRUE(model.parts().changes.empty()) << model.parts().changes.front().source;
    EXPECT_EQ(model.parts().sessions.size(), 4u);
  }
}

/// Sessions as sessions_of() has them; the instrument of each measures lengths too long by `ppm`.
CheckedBatch stretched_sessions(const VirtualRobot& robot, const std::vector<double>& ppm,
                                std::uint64_t seed) {
  std::vector<CheckedBatch> batches;
  for (std::size_t s = 0; s < ppm.size(); ++s) {
    MeasurementBatch batch =
        measured_on(robot, {.poses = 60, .seed = seed + 17 * s, .set_up_anew = true});
    for (Measurement& m : batch.measurements) m.p_W *= 1 + 1e-6 * ppm[s];
    batches.push_back(checked(std::move(batch), fmt::format("day-{}", s + 1), *robot.truth.cell));
  }
  return joined(batches);
}

TEST(Sessions, AnInstrumentThatMeasuresTooLongInOneOfThemSpoilsNothing) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const CompensatedModel good =
      test::demand(train(cell, stretched_sessions(robot, {0, 0, 0, 0}, 300), kPhysics));
  const CompensatedModel model =
      test::demand(train(cell, stretched_sessions(robot, {0, 60, 0, 0}, 300), kPhysics));
  const auto& sessions = model.parts().sessions;
  EXPECT_NEAR(1e6 * sessions[1].scale, -60, 4);
  EXPECT_NEAR(1e6 * sessions[0].scale, 0, 4);
  EXPECT_EQ(sessions.back().scale, 0);
  EXPECT_TRUE(model.parts().changes.empty());
  EXPECT_LT(true_error(model, robot), 1.15 * true_error(good, robot));
  const std::vector<Note> notes = notes_of(model);
  EXPECT_TRUE(std::any_of(notes.begin(), notes.end(), [](const Note& note) {
    return note.text.find("session day-2 measured lengths") != std::string::npos &&
           note.text.find("ppm longer than session day-4") != std::string::npos;
  }));
  const CompensatedModel again = test::demand(deserialize(serialize(model), "again"));
  EXPECT_EQ(again.parts().sessions, sessions);
}

/// m, rms of what the model misses on another day of that robot whose instrument measures too long
/// by `ppm`, with the best shift and turn taken off: nobody knows where the tracker stands.
double missed_on_a_day(const CompensatedModel& model, const VirtualRobot& robot, double ppm) {
  const MeasurementBatch fresh = measured_on(robot, {.poses = 200, .seed = 999});
  const auto n = static_cast<Eigen::Index>(fresh.measurements.size());
  Eigen::Matrix3Xd real(3, n), predicted(3, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Measurement& m = fresh.measurements[static_cast<std::size_t>(i)];
    real.col(i) = (1 + 1e-6 * ppm) * m.p_W;
    predicted.col(i) =
        model.predict(m.context.q, "spindle", "spindle").X_BT_predicted.translation();
  }
  const Pose X_WB = test::demand(fit_transform(real, predicted));
  return std::sqrt((real - X_WB * predicted).squaredNorm() / static_cast<double>(n));
}

TEST(Sessions, WhereTheBaseIsUnknownTheModelHasTheLengthsOfTheNewestSession) {
  const auto cell = test::cell_7_unlocated();
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  std::vector<CheckedBatch> batches;
  for (const double ppm : {0.0, 85.0}) {
    MeasurementBatch batch = measured_on(robot, {.poses = ppm == 0 ? 120 : 80,
                                                 .seed = 60 + static_cast<std::uint64_t>(ppm),
                                                 .set_up_anew = true});
    for (Measurement& m : batch.measurements) m.p_W *= 1 + 1e-6 * ppm;
    batches.push_back(checked(std::move(batch), fmt::format("day-{}", batches.size() + 1), *cell));
  }
  const CompensatedModel model = test::demand(train(cell, joined(batches), kPhysics));
  EXPECT_LT(to_mm(missed_on_a_day(model, robot, 85)), 0.06);
  EXPECT_GT(to_mm(missed_on_a_day(model, robot, 0)), 0.1) << "the first day's lengths are others";
  const auto& sessions = model.parts().sessions;
  EXPECT_EQ(sessions.back().scale, 0);
  EXPECT_NEAR(1e6 * sessions.front().scale, 85, 6);
  for (const Note& note : notes_of(model))
    EXPECT_TRUE(note.code != "session_scale" ||
                note.text.find("ppm shorter than session day-2") != std::string::npos)
        << note.text;
}

TEST(Sessions, HaveTheSameScaleWhereTheDataAskForNoOther) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const CompensatedModel model =
        test::demand(train(cell, stretched_sessions(robot, {0, 0, 0, 0}, 4100 * seed), kPhysics));
    EXPECT_FALSE(are_stretched(model.parts().sessions)) << "seed " << seed;
  }
}

/// On days of these temperatures, with links that grow by `growth` (1/K).
CheckedBatch warm_sessions(const VirtualRobot& robot, const std::vector<double>& temperatures,
                           double growth, std::uint64_t seed) {
  std::vector<CheckedBatch> batches;
  for (const double temperature : temperatures) {
    const test::Day day{.poses = 80, .seed = seed + 17 * batches.size(), .set_up_anew = true};
    batches.push_back(checked(measured_on(test::in_warmth(robot, temperature, growth), day),
                              fmt::format("day-{}", batches.size() + 1), *robot.truth.cell));
  }
  return joined(batches);
}

/// 1/K; empty: the model's links do not grow.
std::optional<double> growth_in(const CompensatedModel& model) {
  const PhysicalModel& physics = model.parts().physics;
  const std::vector<Parameter> parameters = physics.parameters();
  for (std::size_t k = 0; k < parameters.size(); ++k)
    if (parameters[k].name == "growth") return physics.values(static_cast<Eigen::Index>(k));
  return std::nullopt;
}

TEST(Sessions, AnArmThatIsLongerOnWarmerDaysIsLearnedToGrow) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const CompensatedModel model =
      test::demand(train(cell, warm_sessions(robot, {20, 26, 22, 28, 18}, 11.5e-6, 700), kPhysics));
  ASSERT_TRUE(growth_in(model));
  EXPECT_NEAR(1e6 * *growth_in(model), 11.5, 0.8);
  EXPECT_FALSE(are_stretched(model.parts().sessions));
  EXPECT_TRUE(model.parts().changes.empty());
  const std::vector<Note> notes = notes_of(model);
  EXPECT_TRUE(std::any_of(notes.begin(), notes.end(), [](const Note& note) {
    return note.text.find("longer in warmer sessions") != std::string::npos;
  }));
}

TEST(Sessions, AnArmThatDoesNotGrowIsNotLearnedToThoughTheDaysDiffer) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const CompensatedModel model = test::demand(
        train(cell, warm_sessions(robot, {20, 26, 22, 28, 18}, 0, 900 * seed), kPhysics));
    EXPECT_FALSE(growth_in(model)) << "seed " << seed;
  }
}

TEST(Sessions, AnArmThatWearsIsNotTakenForOneThatGrows) {
  const auto cell = test::cell_7();
  for (const double a_day : {1.5, -1.5}) {
    std::vector<CheckedBatch> batches;
    for (int day = 0; day < 5; ++day) {
      VirtualRobot robot = test::chapter_5_robot(cell);
      const std::vector<Parameter> parameters = robot.truth.parameters();
      for (std::size_t k = 0; k < parameters.size(); ++k)
        if (parameters[k].name == "C3")
          robot.truth.values(static_cast<Eigen::Index>(k)) *= 1 + 0.02 * day;
      const test::Day taken{.poses = 80, .seed = 60 + 17 * batches.size(), .set_up_anew = true};
      batches.push_back(checked(measured_on(test::in_warmth(robot, 24 + a_day * day, 0), taken),
                                fmt::format("day-{}", day + 1), *cell));
    }
    const CompensatedModel model = test::demand(train(cell, joined(batches), kPhysics));
    EXPECT_FALSE(growth_in(model)) << *growth_in(model);
  }
}

TEST(Sessions, WhatGrowsWithTheTemperatureIsNotAskedOfABatchOfOneTemperature) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const CheckedBatch days = warm_sessions(robot, {20, 26, 22, 28, 18}, 11.5e-6, 700);
  const CompensatedModel model = test::demand(train(cell, days, kPhysics));
  EXPECT_EQ(level_with_additions(*cell, model, days.rows()),
            "base,geometry,compliance,thermal_growth");
  const CheckedBatch one_day = warm_sessions(robot, {24}, 11.5e-6, 800);
  EXPECT_EQ(level_with_additions(*cell, model, one_day.rows()), std::nullopt);
}

TEST(Sessions, OfTwoDaysNobodyCanTellAGrowingArmFromAnotherScaleOfTheInstrument) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const CompensatedModel model =
      test::demand(train(cell, warm_sessions(robot, {20, 28}, 11.5e-6, 700), kPhysics));
  EXPECT_FALSE(growth_in(model));
  EXPECT_TRUE(are_stretched(model.parts().sessions));
}

TEST(Sessions, AZeroLostIsFoundBesideAnotherScale) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const VirtualRobot after = test::with_zero_off(robot, 3, 2e-4);
  std::vector<CheckedBatch> batches;
  for (int s = 0; s < 4; ++s) {
    MeasurementBatch batch = measured_on(
        s < 2 ? robot : after,
        {.poses = 60, .seed = 810 + 17 * static_cast<std::uint64_t>(s), .set_up_anew = true});
    for (Measurement& m : batch.measurements) m.p_W *= 1 + (s == 1 ? 6e-5 : 0);
    batches.push_back(checked(std::move(batch), fmt::format("day-{}", s + 1), *cell));
  }
  const CompensatedModel model = test::demand(train(cell, joined(batches), kPhysics));
  ASSERT_EQ(model.parts().changes.size(), 1u);
  EXPECT_EQ(model.parts().changes.front().source, "joint_slip:3@121");
  EXPECT_TRUE(are_stretched(model.parts().sessions));
}

/// Five sessions; in those of `elsewhere` (from 0) the reflector sits elsewhere on the tool.
CheckedBatch sessions_with_reflector_off(const VirtualRobot& robot, const std::set<int>& elsewhere,
                                         const Vector3& by, std::uint64_t seed) {
  VirtualRobot other = robot;
  other.truth.tools.at("spindle").translation() += by;
  std::vector<CheckedBatch> batches;
  for (int s = 0; s < 5; ++s) {
    const test::Day day{
        .poses = 60, .seed = seed + 17 * static_cast<std::uint64_t>(s), .set_up_anew = true};
    batches.push_back(checked(measured_on(elsewhere.contains(s) ? other : robot, day),
                              fmt::format("day-{}", s + 1), *robot.truth.cell));
  }
  return joined(batches);
}

TEST(Sessions, AReflectorThatSatElsewhereForADaySpoilsNothing) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  for (const Vector3& by : {Vector3(1e-4, 0, 5e-5), Vector3(0.004, -0.002, 0.001)}) {
    const CompensatedModel good =
        test::demand(train(cell, sessions_with_reflector_off(robot, {}, by, 600), kPhysics));
    const CompensatedModel model =
        test::demand(train(cell, sessions_with_reflector_off(robot, {2}, by, 600), kPhysics));
    const auto& parts = model.parts();
    ASSERT_EQ(parts.changes.size(), 1u) << by.transpose();
    EXPECT_TRUE(is_of_one_session(parts.changes.front()));
    EXPECT_EQ(parts.changes.front().source, "tool_changed@121+1+180");
    EXPECT_LT(true_error(model, robot), 1.1 * true_error(good, robot)) << by.transpose();
    EXPECT_EQ(parts.sessions[2].own_noise, 0);
    const std::string note = notes_of(model).front().text;
    EXPECT_NE(note.find("in session day-3 alone"), std::string::npos) << note;
    const CompensatedModel again = test::demand(deserialize(serialize(model), "again"));
    EXPECT_TRUE(is_of_one_session(again.parts().changes.front()));
    EXPECT_EQ(serialize(again), serialize(model));
  }
}

TEST(Sessions, AReflectorThatStaysElsewhereIsAChangedTool) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const Vector3 by(2e-4, 0, 1e-4);
  for (const std::set<int>& elsewhere : {std::set<int>{4}, std::set<int>{2, 3, 4}}) {
    const CompensatedModel model =
        test::demand(train(cell, sessions_with_reflector_off(robot, elsewhere, by, 700), kPhysics));
    ASSERT_EQ(model.parts().changes.size(), 1u);
    EXPECT_FALSE(is_of_one_session(model.parts().changes.front()));
    EXPECT_EQ(model.parts().changes.front().source,
              fmt::format("tool_changed@{}", 60 * *elsewhere.begin() + 1));
  }
}

TEST(Sessions, AZeroOfTheLastJointAndATurnedToolAreAmbiguous) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const CompensatedModel model = test::demand(
      train(cell, sessions_of(robot, test::with_zero_off(robot, 6, 1e-3), 3, 1, 500), kPhysics));
  ASSERT_EQ(model.parts().changes.size(), 1u);
  EXPECT_EQ(model.parts().changes.front().source, "joint_slip:6@61");
  EXPECT_FALSE(model.parts().changes.front().could_also_be.empty());
  EXPECT_NE(notes_of(model).front().text.find("ambiguous"), std::string::npos);
}

TEST(Sessions, AColumnDividesAFileAsSeveralFilesDo) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  MeasurementBatch all;
  all.id = "all";
  for (std::uint64_t s = 1; s <= 3; ++s) {
    const MeasurementBatch part = measured_on(robot, {.poses = 40, .seed = s, .set_up_anew = true});
    for (Measurement m : part.measurements) {
      m.session_id = fmt::format("set-up {}", s);
      m.pose_id = fmt::format("{}-{}", s, m.pose_id);
      all.measurements.push_back(std::move(m));
    }
  }
  const MeasurementBatch again = test::demand(parse_batch_csv(to_csv(all), "all.csv"));
  const CompensatedModel model =
      test::demand(train(cell, test::demand(check_against_cell(again, *cell)), kPhysics));
  ASSERT_EQ(model.parts().sessions.size(), 3u);
  EXPECT_EQ(model.parts().sessions.back().id, "set-up 3");
  EXPECT_LT(true_error(model, robot), 2e-5);
}

TEST(Sessions, OneSessionIdForAllRowsChangesNothing) {
  const auto cell = test::cell_7();
  MeasurementBatch batch = measured_on(test::chapter_5_robot(cell), {.poses = 60});
  const CompensatedModel without = test::demand(train(cell, checked(batch, "a", *cell), kPhysics));
  for (Measurement& m : batch.measurements) m.session_id = "monday";
  const CompensatedModel with = test::demand(train(cell, checked(batch, "a", *cell), kPhysics));
  EXPECT_EQ(without.parts().physics.values, with.parts().physics.values);
  EXPECT_TRUE(with.parts().sessions.empty());
}

TEST(Sessions, OneTooSmallToSayWhereItsTrackerStoodIsLeftOutAndSaid) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  MeasurementBatch few = measured_on(robot, {.poses = 2, .seed = 9, .set_up_anew = true});
  for (Measurement& m : few.measurements) m.R_WT.reset();
  const CheckedBatch first = checked(measured_on(robot, {.poses = 60}), "first", *cell);
  const CompensatedModel model =
      test::demand(train(cell, joined({first, checked(few, "few", *cell)}), kPhysics));
  const CompensatedModel alone = test::demand(train(cell, first, kPhysics));
  EXPECT_EQ(model.parts().physics.values, alone.parts().physics.values);
  ASSERT_EQ(model.parts().sessions_left_out.size(), 1u);
  EXPECT_EQ(model.parts().sessions_left_out.front().id, "few");
  EXPECT_NE(notes_of(model).front().text.find("nothing was learned from session few: 2 positions"),
            std::string::npos);
}

TEST(Sessions, ANoisySessionCountsForLess) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const CheckedBatch good = checked(measured_on(robot, {.poses = 100, .seed = 3}), "good", *cell);
  const CheckedBatch noisy =
      checked(measured_on(robot, {.poses = 100, .seed = 4, .noise = 8, .set_up_anew = true}),
              "noisy", *cell);
  const CompensatedModel both = test::demand(train(cell, joined({good, noisy}), kPhysics));
  const CompensatedModel alone = test::demand(train(cell, good, kPhysics));
  EXPECT_NEAR(to_mm(both.parts().sessions.back().own_noise), 8 * to_mm(cell->tracker.sigma), 0.03);
  EXPECT_LT(true_error(both, robot), 1.1 * true_error(alone, robot));
}

TEST(Sessions, AnUnknownBaseAndToolAreFoundOverSessions) {
  const auto located = test::cell_7();
  const auto cell = test::cell_7_unlocated();
  const VirtualRobot robot = test::chapter_5_robot(located);
  std::vector<CheckedBatch> batches;
  for (std::uint64_t s = 1; s <= 3; ++s)
    batches.push_back(checked(measured_on(robot, {.poses = 60, .seed = s, .set_up_anew = true}),
                              fmt::format("day-{}", s), *cell));
  EXPECT_LT(true_error(test::demand(train(cell, joined(batches), kPhysics)), robot), 3e-5);
}

TEST(Sessions, AFileOfOneThatTheModelKnowsIsEvaluatedWhereItsTrackerStood) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const CheckedBatch batch = sessions_of(robot, robot, 3, 3, 77);
  const CompensatedModel model = test::demand(train(cell, batch, kPhysics));
  const test::Day day{.poses = 60, .seed = 77, .set_up_anew = true};
  const CheckedBatch first = checked(measured_on(robot, day), "day-1", *cell);
  const InWorld world = test::demand(in_world_of(model, first.rows()));
  EXPECT_LT(model.evaluate(world.batch).compensated.rms, 3e-5);
  EXPECT_TRUE(world.located.empty());
  const InWorld anew = test::demand(in_world_of(
      model, sessions_of(robot, robot, 2, 2, 5000).rows()));  // day-1 again, measured elsewhere
  EXPECT_EQ(anew.located.size(), 2u);
  EXPECT_LT(model.evaluate(anew.batch).compensated.rms, 3e-5);
}

TEST(Sessions, AZeroThatWandersIsFollowedAsARandomWalk) {
  const auto cell = test::cell_7();
  VirtualRobot robot = test::chapter_5_robot(cell);
  std::vector<CheckedBatch> batches;
  const std::vector<double> steps = {0, 6e-5, -3e-5, 8e-5, 5e-5, -7e-5, 4e-5, 9e-5, 3e-5, 6e-5};
  double moved = 0;
  for (std::size_t s = 0; s < steps.size(); ++s) {
    robot = test::with_zero_off(robot, 3, steps[s]);
    moved += steps[s];
    batches.push_back(
        checked(measured_on(robot, {.poses = 40, .seed = 50 + s, .set_up_anew = true}),
                fmt::format("day-{}", s + 1), *cell));
  }
  const CompensatedModel model = test::demand(train(cell, joined(batches), kPhysics));
  ASSERT_EQ(model.parts().changes.size(), 1u);
  const Change& drift = model.parts().changes.front();
  EXPECT_NEAR(drift.rate, 6e-5, 4e-5);
  EXPECT_EQ(drift.steps.size(), steps.size() - 1);
  EXPECT_LT(true_error(model, robot), 1e-5);
  const SessionChange told = session_changes(model).front();
  EXPECT_EQ(told.course, SessionChange::Course::kWanders);
  ASSERT_EQ(told.sizes.size(), 1u);
  EXPECT_NEAR(told.sizes.front().value, to_deg(moved), 2 * told.sizes.front().u95);
  EXPECT_NE(notes_of(model).front().text.find(
                fmt::format("it has moved by {:.5f}", told.sizes.front().value)),
            std::string::npos)
      << notes_of(model).front().text;
  EXPECT_EQ(serialize(test::demand(deserialize(serialize(model), "again"))), serialize(model));
}

TEST(Sessions, TenPosesAfterAToolChangeRefitTheToolAlone) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  VirtualRobot after = robot;
  after.truth.tools.at("spindle").translation() += Vector3(0.002, -0.001, 0.0015);
  after.truth.tools.at("spindle").linear() =
      (rotation_exp(Vector3(3e-3, 1e-3, -2e-3)) * after.truth.tools.at("spindle").linear()).eval();
  const CheckedBatch many = checked(measured_on(robot, {.poses = 200, .seed = 3}), "many", *cell);
  const CheckedBatch ten =
      checked(measured_on(after, {.poses = 10, .seed = 4, .set_up_anew = true}), "ten", *cell);
  const CompensatedModel model = test::demand(train(cell, joined({many, ten}), kPhysics));
  ASSERT_EQ(model.parts().changes.size(), 1u);
  EXPECT_EQ(model.parts().changes.front().source, "tool_changed@201");
  EXPECT_LT(true_error(model, after), 3e-5);
  EXPECT_GT(true_error(test::demand(train(cell, many, kPhysics)), after), 2e-4);
}

TEST(Sessions, AChangedToolIsNotTakenForANoisySessionHoweverManyPosesShowIt) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  for (const Vector3& shift : {Vector3(0.003, 0, 0), Vector3(0, 1e-4, 0)}) {
    VirtualRobot after = robot;
    after.truth.tools.at("spindle").translation() += shift;
    for (const int poses : {7, 8, 10, 12, 16, 20}) {
      std::vector<CheckedBatch> batches;
      for (std::uint64_t s = 0; s < 4; ++s) {
        batches.push_back(
            checked(measured_on(robot, {.poses = 60, .seed = 900 + s, .set_up_anew = true}),
                    fmt::format("day-{}", s + 1), *cell));
      }
      batches.push_back(checked(
          measured_on(after, {.poses = poses, .seed = 950, .set_up_anew = true}), "few", *cell));
      const CompensatedModel model = test::demand(train(cell, joined(batches), kPhysics));
      EXPECT_LT(true_error(model, after), 3e-5) << poses << " poses, " << shift.transpose();
    }
  }
}

TEST(Sessions, ANoisySessionIsNotTakenForAChange) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  for (const double noise : {3.0, 8.0}) {
    for (const int poses : {10, 20, 60}) {
      const CheckedBatch quiet = checked(
          measured_on(robot, {.poses = 120, .seed = 70, .set_up_anew = true}), "quiet", *cell);
      const test::Day day{.poses = poses, .seed = 71, .noise = noise, .set_up_anew = true};
      const CheckedBatch noisy = checked(measured_on(robot, day), "noisy", *cell);
      const CompensatedModel model = test::demand(train(cell, joined({quiet, noisy}), kPhysics));
      EXPECT_TRUE(model.parts().changes.empty())
          << noise << ", " << poses << " poses: " << model.parts().changes.front().source;
    }
  }
}

TEST(Sessions, WhereTheBaseIsUnknownTheOrderOfTheSessionsAndAFewPosesMoreChangeNoCommand) {
  const auto cell = test::cell_7_unlocated();
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  std::vector<CheckedBatch> batches;
  for (std::uint64_t s = 0; s < 3; ++s) {
    batches.push_back(
        checked(measured_on(robot, {.poses = 60, .seed = 30 + s, .set_up_anew = true}),
                fmt::format("day-{}", s + 1), *cell));
  }
  const CheckedBatch few =
      checked(measured_on(robot, {.poses = 3, .seed = 40, .set_up_anew = true}), "few", *cell);
  const auto tip_B = [&](const std::vector<CheckedBatch>& sessions) -> Vector3 {
    const CompensatedModel model = test::demand(train(cell, joined(sessions), kPhysics));
    JointVector q(6);
    q << 0.3, 0.2, -0.2, 0.4, 0.7, -0.5;
    const ErrorPrediction at = model.predict(q, "spindle", "");
    EXPECT_LT(at.true_stddev_B.norm(), 5e-5);
    return at.error_B;
  };
  const Vector3 one = tip_B({batches[0], batches[1], batches[2]});
  const Vector3 other = tip_B({batches[2], batches[0], batches[1]});
  const Vector3 with_few = tip_B({batches[0], batches[1], batches[2], few});
  EXPECT_LT((one - other).norm(), 5e-6);
  EXPECT_LT((one - with_few).norm(), 5e-5);  // the nominal arm's millimetres at 3 of 183 poses
}

TEST(Sessions, ThreePosesAfterACollisionNameTheJoint) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const CheckedBatch many = checked(measured_on(robot, {.poses = 200, .seed = 3}), "many", *cell);
  for (int joint = 2; joint <= 5; ++joint) {
    const VirtualRobot after = test::with_zero_off(robot, joint, 2e-3);
    const CheckedBatch three = checked(
        measured_on(
            after,
            {.poses = 3, .seed = 4 + static_cast<std::uint64_t>(joint), .set_up_anew = true}),
        "three", *cell);
    const CompensatedModel model = test::demand(train(cell, joined({many, three}), kPhysics));
    ASSERT_FALSE(model.parts().changes.empty()) << "joint " << joint;
    EXPECT_EQ(model.parts().changes.front().source, fmt::format("joint_slip:{}@201", joint));
    EXPECT_LT(true_error(model, after), 1e-4);
  }
}

TEST(Sessions, OnePoseMoreDoesNoHarm) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const CheckedBatch many = checked(measured_on(robot, {.poses = 60, .seed = 3}), "many", *cell);
  const CheckedBatch one =
      checked(measured_on(robot, {.poses = 1, .seed = 5, .set_up_anew = true}), "one", *cell);
  const double before = true_error(test::demand(train(cell, many, kPhysics)), robot);
  EXPECT_LT(true_error(test::demand(train(cell, joined({many, one}), kPhysics)), robot),
            1.01 * before);
}

TEST(Sessions, ASecondToolTellsATurnedToolFromALostZero) {
  auto two = std::make_shared<Cell>(*test::cell_7());
  Pose probe = *two->tools.at("spindle");
  probe.translation() += Vector3(0.03, 0.05, 0.12);
  two->tools["probe"] = probe;
  const std::shared_ptr<const Cell> cell = two;
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const auto measured_by_both = [&](const VirtualRobot& arm, std::uint64_t seed,
                                    const std::string& id) {
    MeasurementBatch both = measured_on(arm, {.poses = 60, .seed = seed, .tool = "spindle"});
    for (Measurement m :
         measured_on(arm, {.poses = 60, .seed = seed + 1, .tool = "probe"}).measurements) {
      m.pose_id = "probe-" + m.pose_id;
      m.context.index = static_cast<int>(both.measurements.size());
      both.measurements.push_back(std::move(m));
    }
    both.source_text.clear();
    return checked(std::move(both), id, *cell);
  };
  VirtualRobot knocked = robot;
  knocked.truth.tools.at("probe").linear() =
      (rotation_exp(Vector3(0, 0, 1e-3)) * knocked.truth.tools.at("probe").linear()).eval();
  const auto change_of = [&](const VirtualRobot& after) {
    const CompensatedModel model = test::demand(train(
        cell, joined({measured_by_both(robot, 1, "before"), measured_by_both(after, 11, "after")}),
        kPhysics));
    return model.parts().changes;
  };
  const std::vector<Change> slipped = change_of(test::with_zero_off(robot, 6, 1e-3));
  ASSERT_EQ(slipped.size(), 1u);
  EXPECT_EQ(slipped.front().source, "joint_slip:6@121");
  EXPECT_TRUE(slipped.front().could_also_be.empty());
  const std::vector<Change> turned = change_of(knocked);
  ASSERT_EQ(turned.size(), 1u);
  EXPECT_EQ(turned.front().source, "tool_changed@121+1");
}

}  // namespace
}  // namespace trammel
