#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "server/base/units.h"
#include "server/diagnose/diagnose.h"
#include "server/measurement/sessions.h"
#include "server/report/diagnosis_json.h"
#include "tests/support/demand.h"
#include "tests/support/learning_cell.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

Diagnosis diagnosis_of(const std::shared_ptr<const Cell>& cell,
                       std::vector<MeasurementBatch> sessions) {
  std::vector<CheckedBatch> batches;
  for (MeasurementBatch& session : sessions) {
    session.id = fmt::format("day-{}", batches.size() + 1);
    batches.push_back(test::demand(check_against_cell(std::move(session), *cell)));
  }
  DiagnoseOptions options;
  options.recovery = false;
  return test::demand(diagnose(cell, joined(batches), options));
}

/// Sessions of 50 poses, the tracker set up anew for each.
Diagnosis diagnosis_of(const std::vector<VirtualRobot>& robots, std::uint64_t seed) {
  std::vector<MeasurementBatch> sessions;
  for (std::size_t s = 0; s < robots.size(); ++s)
    sessions.push_back(test::measured_on(
        robots[s], {.poses = 50, .seed = seed + 31 * s, .set_up_anew = s + 1 < robots.size()}));
  return diagnosis_of(robots.front().truth.cell, std::move(sessions));
}

TEST(BetweenSessions, AZeroThatWasLostIsToldWithItsSessionAndIsNoNoise) {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  const VirtualRobot after = test::with_zero_off(robot, 3, 5e-4);
  const Diagnosis good = diagnosis_of({robot, robot, robot}, 20);
  EXPECT_EQ(good.sentence.find("session"), std::string::npos) << good.sentence;
  const Diagnosis diagnosis = diagnosis_of({robot, after, after}, 20);
  const auto found = std::find_if(diagnosis.findings.begin(), diagnosis.findings.end(),
                                  [](const Finding& one) { return one.since_session == "day-2"; });
  ASSERT_NE(found, diagnosis.findings.end()) << diagnosis.sentence;
  EXPECT_EQ(found->cause.joint, 2);
  ASSERT_EQ(diagnosis.between_sessions.size(), 1u);
  const auto json = diagnosis_json(diagnosis).at("between_sessions").at(0);
  EXPECT_EQ(json.at("cause"), "joint_slip");
  EXPECT_EQ(json.at("joint"), 3);
  EXPECT_EQ(json.at("since").at("session_id"), "day-2");
  const auto& zero = json.at("parameters").begin().value();
  EXPECT_NEAR(zero.at("value").get<double>(), to_deg(5e-4), 2 * zero.at("u95").get<double>());
  EXPECT_EQ(zero.at("unit"), "deg");
  EXPECT_TRUE(json.at("rests_on_order").get<bool>()) << "no row has a time";
  EXPECT_TRUE(
      std::any_of(diagnosis.limits.begin(), diagnosis.limits.end(), [](const std::string& limit) {
        return limit.find("in which they were given") != std::string::npos;
      }));
  EXPECT_TRUE(good.between_sessions.empty());
  EXPECT_LT(diagnosis.noise, 1.15 * good.noise);
}

TEST(BetweenSessions, AZeroLostByDegreesIsNamedAsASmallOneAndHasItsLineInTheBudget) {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  for (const int joint : {3, 4, 5}) {
    for (const double deg : {0.6, 2.0}) {
      SCOPED_TRACE(fmt::format("joint {} by {} deg", joint, deg));
      const Diagnosis diagnosis =
          diagnosis_of({robot, test::with_zero_off(robot, joint, from_deg(deg))}, 20);
      EXPECT_EQ(to_string(diagnosis.verdict), "named") << diagnosis.sentence;
      if (diagnosis.findings.size() != 1 || !diagnosis.budget ||
          diagnosis.budget->between_sessions.size() != 1) {
        ADD_FAILURE() << diagnosis.sentence;
        continue;
      }
      EXPECT_EQ(diagnosis.findings.front().cause.joint, joint - 1);
      const BudgetLine& lost = diagnosis.budget->between_sessions.front();
      EXPECT_EQ(lost.since_session, "day-2");
      EXPECT_NEAR(lost.value->value, deg, std::max(2 * lost.value->u95, 0.01));
    }
  }
}

TEST(BetweenSessions, AReflectorThatSatElsewhereForADayIsToldAndIsNoNoise) {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  VirtualRobot other = robot;
  other.truth.tools.at("spindle").translation() += Vector3(2e-4, 0, 1e-4);
  const Diagnosis good = diagnosis_of({robot, robot, robot, robot}, 60);
  const Diagnosis diagnosis = diagnosis_of({robot, other, robot, robot}, 60);
  EXPECT_NE(diagnosis.sentence.find("in session day-2 alone"), std::string::npos)
      << diagnosis.sentence;
  ASSERT_EQ(diagnosis.between_sessions.size(), 1u);
  EXPECT_EQ(diagnosis.between_sessions.front().course, SessionChange::Course::kThatAlone);
  EXPECT_EQ(diagnosis.between_sessions.front().sizes.size(), 6u)
      << "where it sits, and how it is turned";
  EXPECT_TRUE(diagnosis.findings.empty()) << diagnosis.sentence;
  EXPECT_LT(diagnosis.noise, 1.15 * good.noise);
}

/// The robot with a further source, its numbers as given.
VirtualRobot with_source(VirtualRobot robot, const std::string& source,
                         const std::vector<double>& values) {
  const Eigen::Index first =
      add_source(robot.truth, test::demand(make_error_source(source, *robot.truth.cell)));
  for (std::size_t k = 0; k < values.size(); ++k)
    robot.truth.values(first + static_cast<Eigen::Index>(k)) = values[k];
  return robot;
}

/// The robot whose gearbox at `joint` (1-based) is so many times as soft.
VirtualRobot softer(VirtualRobot robot, int joint, double times) {
  const std::vector<Parameter> parameters = robot.truth.parameters();
  for (std::size_t k = 0; k < parameters.size(); ++k)
    if (parameters[k].name == fmt::format("C{}", joint))
      robot.truth.values(static_cast<Eigen::Index>(k)) *= times;
  return robot;
}

/// The robot all of whose links are longer by that share.
VirtualRobot grown(VirtualRobot robot, double share) {
  const std::vector<Parameter> parameters = robot.truth.parameters();
  const Chain& chain = robot.truth.cell->robot;
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    for (int j = 0; j < chain.size(); ++j) {
      double& value = robot.truth.values(static_cast<Eigen::Index>(k));
      if (parameters[k].name == fmt::format("d{}", j + 1)) value += share * chain.joint(j).link.d;
      if (parameters[k].name == fmt::format("a{}", j + 1)) value += share * chain.joint(j).link.a;
    }
  }
  return robot;
}

bool is_sure(const Diagnosis& diagnosis) {
  const auto sure = [](const auto& one) {
    return !one.source.empty() && one.could_also_be.empty();
  };
  return std::any_of(diagnosis.findings.begin(), diagnosis.findings.end(), sure) ||
         std::any_of(diagnosis.between_sessions.begin(), diagnosis.between_sessions.end(), sure);
}

/// What no cause of the list does that begins with a session: no name is sure, and what is left is
/// not called noise.
void expect_no_sure_name(const VirtualRobot& later, std::uint64_t seed) {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  const Diagnosis told = diagnosis_of({robot, later, later}, seed);
  EXPECT_FALSE(is_sure(told)) << told.sentence;
  EXPECT_NE(told.verdict, Verdict::kNothing) << told.sentence;
  EXPECT_NE(told.noise_from.find("alone gives 22.5 um"), std::string::npos) << told.noise_from;
}

TEST(BetweenSessions, AGearboxThatGotSofterIsNoPayloadForSure) {
  expect_no_sure_name(softer(test::chapter_5_robot(test::cell_7()), 3, 1.8), 100);
}

TEST(BetweenSessions, ANewRippleIsNoLostZeroAndNoPayloadForSure) {
  for (const std::uint64_t seed : {110, 111})
    expect_no_sure_name(with_source(test::chapter_5_robot(test::cell_7()),
                                    "gear_transmission:2@31.7", {31.7, 1.5e-4, 5e-5}),
                        seed);
}

TEST(BetweenSessions, AWarmArmWithoutAThermometerIsNoOtherToolForSure) {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  for (const std::uint64_t seed : {120, 121}) {
    const Diagnosis told = diagnosis_of({robot, grown(robot, 1.2e-4), robot}, seed);
    EXPECT_FALSE(is_sure(told)) << told.sentence;
  }
}

/// 50 poses, every joint approached from that side, or from either by chance where it is 0; the
/// tracker `turned` by so many rad, and moved.
MeasurementBatch approached(const VirtualRobot& robot, int side, double turned,
                            std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<PoseContext> poses;
  for (const Measurement& m : test::measured_on(robot, {.poses = 50, .seed = seed}).measurements) {
    poses.push_back(m.context);
    poses.back().direction.clear();
    for (int j = 0; j < robot.truth.cell->robot.size(); ++j)
      poses.back().direction.push_back(side != 0 ? side : random() % 2 == 0 ? 1 : -1);
  }
  SimulateOptions options;
  options.seed = 3 * seed + static_cast<std::uint64_t>(side + 1);
  MeasurementBatch batch = test::demand(simulate(robot, poses, options));
  const Pose X = make_pose(rotation_exp(Vector3(0, 0, turned)), Vector3(0.2, -0.1, 0.3) * turned);
  for (Measurement& m : batch.measurements) {
    m.p_W = X * m.p_W;
    m.R_WT = X.linear() * *m.R_WT;
  }
  return batch;
}

void expect_play(int joint, const std::vector<int>& sides, std::uint64_t seed) {
  const VirtualRobot robot =
      with_source(test::chapter_5_robot(test::cell_7()), fmt::format("backlash:{}", joint),
                  {3e-4, from_rad_per_nmm(1e-10)});
  std::vector<MeasurementBatch> sessions;
  for (const int side : sides) {
    const auto later = static_cast<double>(sides.size() - 1 - sessions.size());
    sessions.push_back(approached(robot, side, 0.3 * later, seed + sessions.size()));
  }
  const Diagnosis told = diagnosis_of(robot.truth.cell, std::move(sessions));
  const auto is_play = [&](const Cause& cause) {
    return cause.cause == "backlash" && cause.joint == joint - 1;
  };
  EXPECT_TRUE(std::any_of(told.findings.begin(), told.findings.end(), [&](const Finding& one) {
    return is_play(one.cause);
  })) << told.sentence;
  for (const Finding& one : told.findings)
    EXPECT_TRUE(is_play(one.cause)) << to_string(one.cause) << told.sentence;
  EXPECT_TRUE(told.between_sessions.empty()) << told.sentence;
  EXPECT_NE(told.noise_from.find("alone gives 22.5 um"), std::string::npos) << told.noise_from;
}

TEST(BetweenSessions, PlayIsPlayAndNoPayloadFromWhicheverSideEachDayCame) {
  for (const std::uint64_t seed : {140, 150}) {
    expect_play(2, {0, 0, 0}, seed);
    expect_play(3, {1, -1, 1, -1}, seed);
  }
}

TEST(BetweenSessions, RepeatsThatScatterFarBeyondWhatIsStatedVouchForNoNoise) {
  const VirtualRobot robot =
      with_source(test::chapter_5_robot(test::cell_7()), "backlash:2", {3e-4, 0});
  std::vector<MeasurementBatch> sessions;
  for (const std::uint64_t seed : {160, 161, 162}) {
    // Every pose from either side, and nobody recorded which.
    MeasurementBatch both = approached(robot, 1, 0, seed);
    for (Measurement& m : approached(robot, -1, 0, seed).measurements) {
      m.pose_id += "-";
      both.measurements.push_back(std::move(m));
    }
    for (Measurement& m : both.measurements) m.context.direction.clear();
    sessions.push_back(std::move(both));
  }
  const Diagnosis told = diagnosis_of(robot.truth.cell, std::move(sessions));
  EXPECT_NE(told.verdict, Verdict::kNothing) << told.sentence;
  EXPECT_FALSE(is_sure(told)) << told.sentence;
  EXPECT_TRUE(told.unexplained.present);
  EXPECT_NE(told.sentence.find("approached from different sides"), std::string::npos)
      << told.sentence;
  EXPECT_NE(told.noise_from.find("alone gives 15.9 um"), std::string::npos)
      << told.noise_from << ": of two each";
}

TEST(BetweenSessions, ANoisySessionIsNotVouchedForByItself) {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  VirtualRobot noisy = robot;
  noisy.sigma *= 3;
  noisy.sigma_rotation *= 3;
  const Diagnosis told = diagnosis_of({robot, noisy, robot}, 130);
  EXPECT_TRUE(told.unexplained.present) << told.sentence;
  EXPECT_NE(told.sentence.find("session day-2 leaves"), std::string::npos) << told.sentence;
  EXPECT_FALSE(is_sure(told)) << told.sentence;
}

}  // namespace
}  // namespace trammel
