#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

#include "clients/cam/dialect.h"
#include "clients/cam/nominal_targets.h"
#include "server/base/units.h"
#include "server/robot/cell.h"

// Which of its solutions does a controller take? The oracle has its own kinematics of a UR10 and
// finds its solutions by descents from many places.
namespace trammel::cam {
namespace {

using Joints = Eigen::Matrix<double, 6, 1>;

Eigen::Isometry3d oracle_flange(const Joints& q) {
  constexpr std::array<double, 6> kD = {.1273, 0, 0, .163941, .1157, .0922},
                                  kA = {0, -.612, -.5723, 0, 0, 0},
                                  kAlpha = {kPi / 2, 0, 0, kPi / 2, -kPi / 2, 0};
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  for (std::size_t j = 0; j < 6; ++j) {
    X.rotate(Eigen::AngleAxisd(q(static_cast<Eigen::Index>(j)), Eigen::Vector3d::UnitZ()));
    X.translate(Eigen::Vector3d(0, 0, kD[j]));
    X.translate(Eigen::Vector3d(kA[j], 0, 0));
    X.rotate(Eigen::AngleAxisd(kAlpha[j], Eigen::Vector3d::UnitX()));
  }
  return X;
}
const Eigen::Isometry3d kPostureTcp(Eigen::Translation3d(0, 0, .1));

Joints off(const Joints& q, const Eigen::Isometry3d& wanted) {
  const Eigen::Isometry3d X = oracle_flange(q);
  const Eigen::AngleAxisd turn(wanted.linear() * X.linear().transpose());
  Joints e;
  e << wanted.translation() - X.translation(), turn.angle() * turn.axis();
  return e;
}

/// All joints within half a turn that bring the flange there.
std::vector<Joints> oracle_solutions(const Eigen::Isometry3d& wanted, std::mt19937& random) {
  std::uniform_real_distribution<double> angle(-kPi, kPi);
  std::vector<Joints> found;
  for (int start = 0; start < 250; ++start) {
    Joints q;
    for (int j = 0; j < 6; ++j) q(j) = angle(random);
    Joints e = off(q, wanted);
    for (int step = 0; step < 40 && e.norm() > 1e-11; ++step) {
      Eigen::Matrix<double, 6, 6> J;
      for (int j = 0; j < 6; ++j) {
        Joints more = q;
        more(j) += 1e-6;
        J.col(j) = (off(more, wanted) - e) / 1e-6;
      }
      Joints way = -(J.transpose() * J + 1e-9 * Eigen::Matrix<double, 6, 6>::Identity())
                        .ldlt()
                        .solve(J.transpose() * e);
      if (way.norm() > 0.5) way *= 0.5 / way.norm();
      q += way;
      e = off(q, wanted);
    }
    if (e.norm() > 1e-9) continue;
    for (int j = 0; j < 6; ++j) q(j) = std::remainder(q(j), 2 * kPi);
    const bool known = std::any_of(found.begin(), found.end(),
                                   [&](const Joints& one) { return (one - q).norm() < 1e-4; });
    if (!known) found.push_back(q);
  }
  return found;
}

Joints turned_to(Joints q, const Joints& near) {
  for (int j = 0; j < 6; ++j) q(j) += 2 * kPi * std::round((near(j) - q(j)) / (2 * kPi));
  return q;
}

std::string joints_text(const Joints& q) {
  return fmt::format("[{:.9f}, {:.9f}, {:.9f}, {:.9f}, {:.9f}, {:.9f}]", q(0), q(1), q(2), q(3),
                     q(4), q(5));
}
std::string pose_of_joints(const Joints& q) {
  const Eigen::Isometry3d X = oracle_flange(q) * kPostureTcp;
  const Eigen::AngleAxisd turn(X.linear());
  const Eigen::Vector3d p = X.translation(), w = turn.angle() * turn.axis();
  return fmt::format("p[{:.10f}, {:.10f}, {:.10f}, {:.10f}, {:.10f}, {:.10f}]", p(0), p(1), p(2),
                     w(0), w(1), w(2));
}

NominalTargets ur(const std::string& lines) {
  static const Chain chain =
      read_robot(TRAMMEL_SOURCE_DIR "/models/universal-robots_ur10.yaml").value();
  const std::string text = "def p():\n  set_tcp(p[0, 0, 0.1, 0, 0, 0])\n" + lines + "end\n";
  const Program program = read_program(Dialect::kUrScript, {{"p.script", text}}, {});
  EXPECT_TRUE(program.left.empty()) << program.left[0].why;
  return nominal_targets(program, ArmOfProgram(chain), {{{"tool", Pose(kPostureTcp)}}, {}}, "", "")
      .value();
}
/// Of the last target in the text.
const NominalTarget& last_of(const NominalTargets& nominal) { return nominal.targets.back(); }

/// Where postures meet nothing is nearer than the other: away from a stretched elbow, wrist and
/// shoulder.
bool is_open(const Joints& q) {
  const Eigen::Isometry3d X = oracle_flange(q);
  const Eigen::Vector3d wrist = X.translation() - .0922 * X.linear().col(2);
  return std::abs(std::sin(q(2))) > .3 && std::abs(std::sin(q(4))) > .3 &&
         wrist.head<2>().norm() > .3;
}
Joints drawn(std::mt19937& random) {
  std::uniform_real_distribution<double> angle(-2.8, 2.8);
  Joints q;
  do {
    for (int j = 0; j < 6; ++j) q(j) = angle(random);
  } while (!is_open(q));
  return q;
}
Joints with(std::initializer_list<double> values) {
  Joints q;
  std::copy(values.begin(), values.end(), q.data());
  return q;
}
const Joints kReady = with({-1.5, -1.3, -1.7, -1.7, 1.57, 0});

TEST(Posture, JointsThatAMotionNamesDecideWhereverTheArmComesFrom) {
  std::mt19937 random(3);
  std::normal_distribution<double> near(0, .05);
  for (int k = 0; k < 40; ++k) {
    const Joints q = drawn(random);
    Joints named = q;
    for (int j = 0; j < 6; ++j) named(j) += near(random);
    const std::string goal =
        "  movej(get_inverse_kin(" + pose_of_joints(q) + ", qnear=" + joints_text(named) + "))\n";
    for (const std::string& before : {std::string(), "  movej(" + joints_text(kReady) + ")\n"}) {
      const NominalTargets made = ur(before + goal);
      ASSERT_TRUE(last_of(made).q) << last_of(made).why_not;
      EXPECT_LT((*last_of(made).q - q).norm(), 1e-6) << joints_text(q);
    }
  }
}

TEST(Posture, JointsThatAVariableNamesDecideToo) {
  const Joints q = with({0.89955, -1.91986, 1.74533, -1.39626, -1.57080, -0.67124});
  const NominalTargets made =
      ur("  global W_p=" + pose_of_joints(q) + "\n  global W_q=" + joints_text(q) +
         "\n  movej(get_inverse_kin(W_p, W_q), a=1.4)\n");
  ASSERT_TRUE(made.targets[0].q) << made.targets[0].why_not;
  EXPECT_LT((*made.targets[0].q - q).norm(), 1e-6);
}

TEST(Posture, AMotionOfTheAxesTakesTheSolutionNextToTheJointsBefore) {
  std::mt19937 random(7);
  int decided = 0;
  for (int k = 0; k < 25; ++k) {
    const Joints from = drawn(random), somewhere = drawn(random);
    std::vector<std::pair<double, Joints>> all;
    for (const Joints& q : oracle_solutions(oracle_flange(somewhere), random))
      all.emplace_back((turned_to(q, from) - from).norm(), turned_to(q, from));
    std::sort(all.begin(), all.end(),
              [](const auto& a, const auto& b) { return a.first < b.first; });
    ASSERT_GE(all.size(), 2u);
    if (all[1].first - all[0].first < .05 * all[0].first) continue;
    ++decided;
    const NominalTargets made =
        ur("  movej(" + joints_text(from) + ")\n  movej(" + pose_of_joints(somewhere) + ")\n");
    const NominalTarget& last = last_of(made);
    ASSERT_TRUE(last.q) << last.why_not;
    EXPECT_LT((*last.q - all[0].second).norm(), 1e-6)
        << joints_text(from) << " to " << joints_text(somewhere);
  }
  EXPECT_GT(decided, 15);
}

TEST(Posture, WholeTurnsAreTakenOffThatTheLimitsDoNotNeed) {
  const Joints from = with({0.3, -1.2, -1.6, -1.9, 1.57, 0});
  const NominalTargets made =
      ur("  movej(" + joints_text(from) +
         ")\n  movej(p[-0.739592, -0.225787, 0.083127, -2.5469731, 1.8226580, -0.0123047])\n");
  ASSERT_TRUE(last_of(made).q) << last_of(made).why_not;
  EXPECT_LT((*last_of(made).q - Eigen::VectorXd(from)).cwiseAbs().maxCoeff(), kPi);
}

TEST(Posture, ALineKeepsThePostureThatItBeginsIn) {
  std::mt19937 random(13);
  std::uniform_real_distribution<double> step(-.12, .12);
  for (int k = 0; k < 30; ++k) {
    const Joints from = drawn(random);
    Joints to = from;
    for (int j = 0; j < 6; ++j) to(j) += step(random);
    const NominalTargets made =
        ur("  movej(" + joints_text(from) + ")\n  movel(" + pose_of_joints(to) + ")\n");
    ASSERT_TRUE(last_of(made).q) << last_of(made).why_not;
    EXPECT_LT((*last_of(made).q - to).norm(), 1e-6);
  }
}

TEST(Posture, WithoutJointsBeforeATargetIsLeftWithTheReason) {
  const std::string goal = "  movej(" + pose_of_joints(kReady) + ")\n";
  const std::string ready = "  movej(" + joints_text(kReady) + ")\n";
  EXPECT_NE(last_of(ur(goal)).why_not.find("the program does not say these"), std::string::npos);
  EXPECT_TRUE(last_of(ur(ready + goal)).q);
  // At the head of a loop the arm comes from its end, too; joints that are there again and again
  // are one posture.
  EXPECT_FALSE(last_of(ur("  while i < 2:\n" + goal + "  end\n")).q);
  EXPECT_TRUE(last_of(ur(ready + "  while i < 2:\n" + goal + "  end\n")).q);
}

TEST(Posture, JointsThatAreLeftAsTheyStandSayWhereTheArmIsAllTheSame) {
  const Chain chain = read_robot(TRAMMEL_SOURCE_DIR "/models/universal-robots_ur10.yaml").value();
  const std::string text = "def p():\n  set_tcp(p[0, 0, 0.1, 0, 0, 0])\n  movej(" +
                           joints_text(kReady) + ")\n  movej(" + pose_of_joints(kReady) +
                           ")\nend\n";
  ReadOptions options;
  options.keep_joints = true;
  const Program program = read_program(Dialect::kUrScript, {{"p.script", text}}, options);
  const auto made =
      nominal_targets(program, ArmOfProgram(chain), {{{"tool", Pose(kPostureTcp)}}, {}}, "", "")
          .value();
  ASSERT_EQ(made.targets.size(), 1u);
  EXPECT_TRUE(made.targets[0].q) << made.targets[0].why_not;
}

TEST(Posture, APointThatIsReachedInTwoPosturesIsLeft) {
  const Joints other = with({0.89955, -1.91986, 1.74533, -1.39626, -1.57080, -0.67124});
  const std::string lines = "  hole = " + pose_of_joints(other) +
                            "\n  movej(get_inverse_kin(hole, qnear=" + joints_text(other) +
                            "))\n  movej(" + joints_text(kReady) + ")\n  movej(hole)\n";
  const NominalTargets made = ur(lines);
  ASSERT_EQ(made.targets.size(), 2u);
  EXPECT_EQ(made.targets[0].why_not, "motions come to it in different postures");
}

TEST(Posture, TwoPosturesThatAreEquallyNearAreLeft) {
  // Halfway between two solutions of one pose neither is nearer.
  std::mt19937 random(17);
  const Joints q = with({0.6, -1.4, 1.3, -1.1, 1.2, 0.4});
  Joints nearest = Joints::Constant(100);
  for (const Joints& one : oracle_solutions(oracle_flange(q), random)) {
    const Joints other = turned_to(one, q);
    if ((other - q).norm() > 1e-3 && (other - q).norm() < (nearest - q).norm()) nearest = other;
  }
  const NominalTargets made =
      ur("  movej(" + joints_text((q + nearest) / 2) + ")\n  movej(" + pose_of_joints(q) + ")\n");
  EXPECT_NE(last_of(made).why_not.find("equally near"), std::string::npos) << last_of(made).why_not;
}

TEST(Posture, OfTwoPosturesThatAreNearlyAsNearTheOneIsTakenThatEveryMeasureCallsNearer) {
  std::mt19937 random(17);
  const Joints q = with({0.6, -1.4, 1.3, -1.1, 1.2, 0.4});
  Joints other = Joints::Constant(100);
  for (const Joints& one : oracle_solutions(oracle_flange(q), random)) {
    const Joints turned = turned_to(one, q);
    if ((turned - q).norm() > 1e-3 && (turned - q).norm() < (other - q).norm()) other = turned;
  }
  // Nearer to q by four thousandths of the way, along the straight line between the two.
  const Joints from = q + 0.498 * (other - q);
  const NominalTargets made =
      ur("  movej(" + joints_text(from) + ")\n  movej(" + pose_of_joints(q) + ")\n");
  ASSERT_TRUE(last_of(made).q) << last_of(made).why_not;
  EXPECT_LT((*last_of(made).q - q).norm(), 1e-5);
}

// A line does not turn the wrist over: joint 5 keeps its sign, and joints 4 and 6 stay within half
// a turn.
TEST(Posture, WhatATargetOfKrlDoesNotSayFollowsFromTheMotionBeforeWhereverThatTargetStands) {
  const Chain chain = read_robot(TRAMMEL_SOURCE_DIR "/models/kuka_kr210-r2700-extra.yaml").value();
  const std::string config = "DEFDAT $CONFIG\nTOOL_DATA[1]={X 0,Y 0,Z 200,A 0,B 0,C 0}\nENDDAT\n";
  const std::string dat =
      "DEFDAT p PUBLIC\nDECL E6POS XP1={X 1500,Y 200,Z 900,A 0,B 90,C 0,S 2,T 2}\nENDDAT\n";
  const std::string src =
      "DEF p( )\n$TOOL=TOOL_DATA[1]\n$BASE=$NULLFRAME\nPTP XP1\nLIN {X 1500,Y 200,Z 800,A 0,B 90,C "
      "0}\nEND\n";
  const Program program =
      read_program(Dialect::kKrl, {{"p.src", src}, {"p.dat", dat}, {"$config.dat", config}}, {});
  ASSERT_TRUE(program.left.empty()) << program.left[0].why;
  Pose X_FT = Pose::Identity();
  X_FT.translation().z() = 0.2;
  const auto targets =
      nominal_targets(program, ArmOfProgram(chain), {{{"tool", X_FT}}, {}}, "", "").value().targets;
  ASSERT_EQ(targets.size(), 2u);
  for (const NominalTarget& target : targets) {
    ASSERT_TRUE(target.q) << target.why_not;
    EXPECT_GT((*target.q)(4), 0) << "S 2 and T 2 have joint 5 above zero";
    EXPECT_GT((*target.q)(3), 0);
  }
}

/// Targets of a KRL program with a tool 200 mm long, in the order of the program's targets, and the
/// notes.
NominalTargets of_krl(const std::string& lines, std::size_t count) {
  const std::string config = "DEFDAT $CONFIG\nTOOL_DATA[1]={X 0,Y 0,Z 200,A 0,B 0,C 0}\nENDDAT\n";
  const std::string src = "DEF p( )\n$TOOL=TOOL_DATA[1]\n$BASE=$NULLFRAME\n" + lines + "END\n";
  const Chain chain = read_robot(TRAMMEL_SOURCE_DIR "/models/kuka_kr210-r2700-extra.yaml").value();
  const Program program =
      read_program(Dialect::kKrl, {{"p.src", src}, {"$config.dat", config}}, {});
  Pose X_FT = Pose::Identity();
  X_FT.translation().z() = 0.2;
  NominalTargets made =
      nominal_targets(program, ArmOfProgram(chain), {{{"tool", X_FT}}, {}}, "", "").value();
  EXPECT_EQ(made.targets.size(), count) << lines;
  return made;
}
// With joint 5 above zero, and joint 4 with it.
const std::string kWristUp = "PTP {X 1500,Y 200,Z 900,A 0,B 90,C 0,S 2,T 35}\n";
const std::string kNext = "{X 1500,Y 200,Z 800,A 0,B 90,C 0";

TEST(Posture, WhatFollowsAMotionThatIsLeftIsLeftUnlessItSaysItsOwnPosture) {
  for (const char* between :
       {"PTP XP[i]\n", "PTP_REL {A1 90}\n", "PTP XHOME\n", "IF $IN[1] THEN\nPTP XHOME\nENDIF\n"}) {
    const std::string begin = kWristUp + between;
    const NominalTargets open = of_krl(begin + "LIN " + kNext + "}\n", 2);
    EXPECT_NE(open.targets.back().why_not.find("the program does not say these"), std::string::npos)
        << between;
    EXPECT_TRUE(of_krl(begin + "LIN " + kNext + ",S 2,T 35}\n", 2).targets.back().q) << between;
    EXPECT_TRUE(
        of_krl(begin + "PTP " + kNext + ",S 2,T 35}\nLIN {X 1500,Y 200,Z 700,A 0,B 90,C 0}\n", 3)
            .targets[2]
            .q);
  }
  EXPECT_TRUE(
      of_krl(kWristUp + "LIN_REL {Z 50}\nLIN $POS_ACT\nLIN " + kNext + "}\n", 2).targets.back().q)
      << "lines keep the posture, wherever they end";
  EXPECT_TRUE(
      of_krl("PTP {A1 0,A2 -90,A3 90,A4 0,A5 45,A6 0}\nLIN " + kNext + "}\n", 2).targets.back().q);
}

TEST(Posture, AxesThatStayAsTheyAreStillSayWhereTheArmStands) {
  const std::string config =
      "DEFDAT $CONFIG\nTOOL_DATA[1]={X 0,Y 0,Z 200,A 0,B 0,C 0}\n"
      "DECL E6AXIS XHOME={A1 0,A2 -90,A3 90,A4 0,A5 45,A6 0}\nENDDAT\n";
  const std::string src =
      "DEF p( )\n$TOOL=TOOL_DATA[1]\n$BASE=$NULLFRAME\nPTP XHOME\nLIN " + kNext + "}\nEND\n";
  const Chain chain = read_robot(TRAMMEL_SOURCE_DIR "/models/kuka_kr210-r2700-extra.yaml").value();
  const Program program = read_program(Dialect::kKrl, {{"p.src", src}, {"$config.dat", config}},
                                       {.spared = {"$config.dat"}});
  ASSERT_EQ(program.targets.size(), 1u);
  Pose X_FT = Pose::Identity();
  X_FT.translation().z() = 0.2;
  const auto made =
      nominal_targets(program, ArmOfProgram(chain), {{{"tool", X_FT}}, {}}, "", "").value();
  ASSERT_TRUE(made.targets[0].q) << made.targets[0].why_not;
  EXPECT_GT((*made.targets[0].q)(4), 0);
}

TEST(Posture, ALineOfKrlKeepsThePostureWhateverItsStatusSays) {
  for (const char* motion : {"LIN ", "SLIN "}) {
    const NominalTargets made = of_krl(kWristUp + motion + kNext + ",S 6,T 27}\n", 2);
    ASSERT_TRUE(made.targets[0].q && made.targets[1].q) << motion;
    EXPECT_GT((*made.targets[0].q)(4), 0);
    EXPECT_GT((*made.targets[1].q)(4), 0) << motion;
    EXPECT_NE(made.targets[1].doubt.find("another posture than the motion before"),
              std::string::npos)
        << motion;
    EXPECT_EQ(made.targets[0].doubt, "");
  }
  const NominalTargets free = of_krl(kWristUp + "PTP " + kNext + ",S 6,T 27}\n", 2);
  ASSERT_TRUE(free.targets[1].q);
  EXPECT_LT((*free.targets[1].q)(4), 0) << "a motion of the axes goes where they say";
}

TEST(Posture, AStatusThatItsTurnContradictsIsToldAtTheTarget) {
  const NominalTargets made = of_krl("PTP {X 1500,Y 200,Z 900,A 0,B 90,C 0,S 2,T 2}\n", 1);
  ASSERT_TRUE(made.targets[0].q);
  EXPECT_NE(made.targets[0].doubt.find("joint 1 is at -"), std::string::npos)
      << made.targets[0].doubt;
}

}  // namespace
}  // namespace trammel::cam
