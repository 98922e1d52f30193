#include <gtest/gtest.h>

#include <set>

#include "tests/support/shifting_model.h"

namespace trammel::cam {
namespace {

const std::string kTool =
    "  PERS tooldata "
    "tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,0]];"
    "\n";

std::string line_at(double y, const std::string& speed = "v100") {
  return fmt::format(
      "  MoveL "
      "[[1800,{},1200],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],{},z1,tSpindle;"
      "\n",
      y, speed);
}
std::string program_path(const std::string& motions) {
  return "MODULE M\n" + kTool + "PROC main()\n" + motions + "ENDPROC\nENDMODULE\n";
}

/// The shipped arm, every axis at most this fast.
Chain arm(std::optional<double> rad_s) {
  const auto cell = test::small_cell("cam");
  std::vector<Joint> joints;
  for (int j = 0; j < cell->robot.size(); ++j) {
    joints.push_back(cell->robot.joint(j));
    joints.back().max_speed = rad_s;
  }
  return Chain::make("arm", joints).value();
}

/// Corrects every target but those of `left` by a vector along the base's y that grows with it, a
/// thousandth of it.
AskCorrections growing(const std::set<std::size_t>& left = {}) {
  return [left](const std::string& tool, const std::string& payload,
                const std::vector<exchange::AskedTarget>& targets) {
    auto answer = test::shift(tool, payload, targets);
    for (std::size_t k = 0; k < targets.size(); ++k) {
      exchange::CorrectedTarget& item = answer->items[k];
      item.commanded = targets[k].pose;
      item.commanded.xyz_mm[1] += 1e-3 * targets[k].pose.xyz_mm[1];
      for (std::size_t j = 0; j < 6; ++j) item.joints_deg[j] = to_deg(1.1 * targets[k].seed_rad[j]);
      if (left.contains(k)) item.status = "joint_limit";
    }
    return answer;
  };
}

CorrectedProgram corrected(const std::string& motions, const Chain& robot,
                           const AskCorrections& ask) {
  const Program read = read_program(Dialect::kRapid, {{"m.mod", program_path(motions)}}, {});
  return correct_program(read, robot, test::spindle_only(), ask, {}).value();
}

TEST(Path, TheSpeedAtWhichAnAxisReachesItsLimitIsToldBeforeAndAfter) {
  const CorrectedProgram made =
      corrected(line_at(0) + line_at(10) + line_at(20), arm(2.0), growing());
  ASSERT_EQ(made.rows.size(), 3u);
  EXPECT_TRUE(std::isnan(made.rows[0].path_limit_before_mm_s)) << "nothing comes before";
  for (std::size_t k = 1; k < 3; ++k) {
    EXPECT_GT(made.rows[k].path_limit_before_mm_s, 100);
    // The corrected joints turn by a tenth more over the same way.
    EXPECT_NEAR(made.rows[k].path_limit_before_mm_s / made.rows[k].path_limit_after_mm_s, 1.1,
                1e-6);
  }
  EXPECT_NEAR(made.largest_step_mm, 0.010, 1e-6);
}

TEST(Path, WithoutLimitsInTheRobotFileNothingIsSaidOfSpeeds) {
  const CorrectedProgram made = corrected(line_at(0) + line_at(10), arm(std::nullopt), growing());
  for (const ReceiptRow& row : made.rows) EXPECT_TRUE(std::isnan(row.path_limit_after_mm_s));
}

TEST(Path, AMotionThatOnlyTheCorrectionMakesTooFastIsNamedWithASpeed) {
  const double before =
      corrected(line_at(0) + line_at(10), arm(2.0), growing()).rows[1].path_limit_before_mm_s;
  const auto at = [&](double share) {
    return corrected(line_at(0) + line_at(10, fmt::format("v{:.0f}", share * before)), arm(2.0),
                     growing());
  };
  EXPECT_EQ(at(0.8).rows[1].message, "");
  EXPECT_NE(at(0.95).rows[1].message.find("would turn faster than it can"), std::string::npos)
      << at(0.95).rows[1].message;
  EXPECT_NE(at(0.95).rows[1].suggestion.find("mm/s at most"), std::string::npos);
  EXPECT_EQ(at(0.95).notes.size(), 1u);
  EXPECT_EQ(at(1.2).rows[1].message, "") << "it was so before";
}

TEST(Path, ATargetThatIsLeftBetweenCorrectedOnesIsAStep) {
  const CorrectedProgram made =
      corrected(line_at(100) + line_at(101) + line_at(102), arm(std::nullopt), growing({1}));
  EXPECT_NEAR(made.largest_step_mm, 0.102, 1e-3);
  ASSERT_EQ(made.notes.size(), 1u);
  EXPECT_NE(made.notes[0].find("a step of 0.10"), std::string::npos) << made.notes[0];
}

TEST(Path, SpeedsOfOtherDialectsAreRead) {
  const auto speed = [](Dialect dialect, const std::string& text) {
    return read_program(dialect, {{"f", text}}, {}).moves.at(0).speed_mm_s;
  };
  EXPECT_EQ(speed(Dialect::kFanuc, "/MN\n   1:L P[1] 250mm/sec FINE    ;\n/POS\n"), 250);
  EXPECT_EQ(speed(Dialect::kFanuc, "/MN\n   1:J P[1] 50% FINE    ;\n/POS\n"), std::nullopt);
  EXPECT_NEAR(speed(Dialect::kFanuc, "/MN\n   1:L P[1] 120cm/min FINE    ;\n/POS\n").value(), 20,
              1e-9);
  EXPECT_EQ(speed(Dialect::kUrScript, "movel(p[1,0,0,0,0,0], a=1.2, v=0.05)\n"), 50);
  EXPECT_EQ(speed(Dialect::kUrScript, "movel(p[1,0,0,0,0,0], 1.2, 0.05)\n"), 50);
  EXPECT_EQ(speed(Dialect::kUrScript, "movej(p[1,0,0,0,0,0], 1.2, 0.05)\n"), std::nullopt);
  const auto inform = [&](const std::string& line) {
    return speed(
        Dialect::kInform,
        "/JOB\n//NAME A\n//POS\n///POSTYPE BASE\nC00000=0,0,0,0,0,0\n//INST\nNOP\n" + line);
  };
  EXPECT_EQ(inform("MOVL C00000 V=100.5\n"), 100.5);
  EXPECT_EQ(inform("MOVJ C00000 VJ=50.00\n"), std::nullopt) << "a share of what the axes can";
  EXPECT_EQ(inform("MOVL C00000 V=I000\n"), std::nullopt);
}

TEST(Path, SpeedsOfKrlAreThoseThatHoldAtTheMotion) {
  const auto speed = [](const std::string& lines, std::size_t motion = 0) {
    return read_program(Dialect::kKrl, {{"p.src", "DEF p( )\n" + lines + "END\n"}}, {})
        .moves.at(motion)
        .speed_mm_s;
  };
  const std::string lin = "LIN {X 1,Y 0,Z 0,A 0,B 0,C 0}\n";
  EXPECT_EQ(speed(lin), std::nullopt);
  EXPECT_EQ(speed("$VEL.CP=0.25\n" + lin), 250);
  EXPECT_EQ(speed("$VEL={CP 0.5,ORI1 200.0,ORI2 200.0}\n" + lin), 500);
  EXPECT_EQ(speed("BAS(#CP_PARAMS,2)\n" + lin), 2000);
  EXPECT_EQ(speed("BAS(#VEL_CP,0.3)\n" + lin), 300);
  EXPECT_EQ(speed("$VEL.CP=v\n" + lin), std::nullopt);
  EXPECT_EQ(speed("$VEL.CP=0.25\nPTP {X 1,Y 0,Z 0,A 0,B 0,C 0}\n"), std::nullopt)
      << "a share of what the axes can";
  EXPECT_EQ(speed("SLIN {X 1,Y 0,Z 0,A 0,B 0,C 0} WITH $VEL.CP=0.1, $TOOL=$NULLFRAME\n"), 100);
  EXPECT_EQ(speed("SLIN XP1 WITH $VEL=SVEL_CP(1.5, , LCPDAT1)\n"), 1500);
  EXPECT_EQ(speed("$VEL.CP=0.1\nIF $IN[1] THEN\n$VEL.CP=0.2\nENDIF\n" + lin), 200)
      << "the faster of two ways";
}

TEST(Path, SpeedsOfRapidAreDeclaredOrWrittenInTheMotion) {
  const auto speed = [](const std::string& motion) {
    return read_program(Dialect::kRapid,
                        {{"m.mod",
                          "MODULE M\n  CONST speeddata vDrill:=[35,500,5000,1000];\n  VAR "
                          "speeddata vNow:=[1,1,1,1];\nPROC main()\n vNow:=vDrill;\n " +
                              motion + "\nENDPROC\nENDMODULE\n"}},
                        {})
        .moves.at(0)
        .speed_mm_s;
  };
  EXPECT_EQ(speed("MoveL p1,v100,fine,tool0;"), 100);
  EXPECT_EQ(speed("MoveL p1,vDrill,fine,tool0;"), 35);
  EXPECT_EQ(speed("MoveL p1,[40,500,5000,1000],fine,tool0;"), 40);
  EXPECT_EQ(speed("MoveL p1,v100\\V:=60,fine,tool0;"), 60);
  EXPECT_EQ(speed("MoveL p1,vNow,fine,tool0;"), std::nullopt);
  EXPECT_EQ(speed("MoveJ p1,v100,fine,tool0;"), std::nullopt);
}

TEST(Path, AtAStretchedWristJoint4StaysWhereItWas) {
  const Chain robot = arm(std::nullopt);
  const Pose X_BT =
      robot.flange_pose(JointVector::Zero(6)) * test::spindle_only().tools.at("spindle");
  const Eigen::Quaterniond q(X_BT.linear());
  const Vector3 p = X_BT.translation() * to_mm(1);
  const CorrectedProgram made =
      corrected("  MoveAbsJ [[0,0,0,40,0,-40],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tSpindle;\n" +
                    fmt::format("  MoveL "
                                "[[{:.12f},{:.12f},{:.12f}],[{:.17g},{:.17g},{:.17g},{:.17g}],[0,0,"
                                "0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,z1,tSpindle;\n",
                                p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()),
                robot, test::shift);
  ASSERT_EQ(made.rows.size(), 2u);
  EXPECT_NEAR(made.rows[1].joints[3], 40, 0.1) << made.rows[1].message;
}

}  // namespace
}  // namespace trammel::cam
