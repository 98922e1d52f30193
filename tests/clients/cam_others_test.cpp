#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/shifting_model.h"

namespace trammel::cam {
namespace {

using test::corrected_by_shift;
using test::row_of;

const Pose kSpindle = test::spindle_only().tools.at("spindle");

// Yaskawa

std::string job(const std::string& positions, const std::string& lines) {
  return "/JOB\r\n//NAME DRILL\r\n//POS\r\n///NPOS 3,0,0,0,0,0\r\n///TOOL 1\r\n///POSTYPE "
         "ROBOT\r\n///RECTAN\r\n"
         "///RCONF 1,0,0,0,0,0,0,0\r\n" +
         positions +
         "//INST\r\n///DATE 2026/11/22 10:00\r\n///ATTR SC,RW\r\n///GROUP1 RB1\r\nNOP\r\n" + lines +
         "END\r\n";
}
test::Corrected jbi(const std::string& text) {
  return corrected_by_shift(Dialect::kInform, {{"drill.jbi", text}},
                            {.frames = {{"TOOL[1]", kSpindle}}});
}

TEST(Inform, OnlyNumbersOfPositionsChange) {
  const std::string text = job(
      "C00000=1800.000,-250.000,800.000,0.0000,60.0000,0.0000\r\nC00001=1800.0,0,900.,0,60,0\r\n",
      "'MOVL C00009\r\nMOVJ C00000 VJ=50.00\r\nMOVL C00001 V=100.0 PL=0\r\n");
  const test::Corrected made = jbi(text);
  ASSERT_EQ(made.refusal, "");
  EXPECT_EQ(made.program.left_alone(), 0u) << made.program.rows[0].message;
  EXPECT_EQ(test::without_numbers(test::without_inserted(made.program)),
            test::without_numbers(text));
  EXPECT_NE(
      made.program.files[0].text.find("C00000=1800.123,-250.235,800.346,0.0000,60.0000,0.0000\r\n"),
      std::string::npos)
      << made.program.files[0].text;
  EXPECT_NE(made.program.files[0].text.find("NOP\r\n'TRAMMEL model=0123456789ab\r\n"),
            std::string::npos);
}

TEST(Inform, HowTheWristIsReadIsSaidOnce) {
  const test::Corrected made =
      jbi(job("C00000=1800,-250,800,0,60,0\r\nC00001=1800.0,0,900.,0,60,0\r\n",
              "MOVJ C00000 VJ=50.00\r\nMOVL C00001 V=100.0 PL=0\r\n"));
  const auto said = std::count_if(
      made.program.notes.begin(), made.program.notes.end(), [](const std::string& note) {
        return note.find("the first number of RCONF is read by axis B") != std::string::npos;
      });
  EXPECT_EQ(said, 1);
}

TEST(Inform, WhatIsDecidedAtRunTimeIsLeftWithTheReason) {
  const test::Corrected made = jbi(job(
      "C00000=1800.000,-250.000,800.000,0.0000,60.0000,0.0000\r\nC00001=1800.0,0,900.,0,60,0\r\n"
      "C00002=1800.0,0,900.,0,60,0\r\n///POSTYPE PULSE\r\n///PULSE\r\nC00003=0,100,200,0,0,0\r\n",
      "MOVL P001 V=1.0\r\nMOVL C00000 V=1.0 UNTIL IN#(1)=ON\r\nSFTON P010\r\nMOVL C00001 "
      "V=1.0\r\nSFTOF\r\n"
      "IMOV C00002 V=1.0\r\nMOVJ C00003 VJ=1.0\r\n"));
  EXPECT_NE(test::why(made, "P001").find("variable"), std::string::npos);
  EXPECT_NE(test::why(made, "C00000").find("sensor"), std::string::npos);
  EXPECT_NE(test::why(made, "C00001").find("SFTON"), std::string::npos);
  EXPECT_NE(test::why(made, "C00002").find("relative"), std::string::npos);
  EXPECT_NE(test::why(made, "C00003").find("pulses"), std::string::npos);
}

TEST(Inform, ASearchEndsWhereItsSensorSays) {
  const test::Corrected made = jbi(job("C00000=1800.000,-250.000,800.000,0.0000,60.0000,0.0000\r\n",
                                       "MOVL C00000 V=1.0 SRCH RIN#(1)=ON DIS=20.0\r\n"));
  EXPECT_NE(test::why(made, "C00000").find("a sensor may end the motion (SRCH)"), std::string::npos)
      << test::why(made, "C00000");
}

TEST(Inform, WhatAJumpBackOrAJobThatIsCalledDisplacesIsLeft) {
  const std::string point = "C00000=1800.000,-250.000,800.000,0.0000,60.0000,0.0000\r\n";
  for (const std::string& lines : std::vector<std::string>{
           "*A\r\nMOVL C00000 V=100.0\r\nSFTON P001 UF#(1)\r\nJUMP *A IF IN#(1)=ON\r\n",
           "WHILE IN#(1)=ON\r\nMOVL C00000 V=100.0\r\nSFTON P001 UF#(1)\r\nENDWHILE\r\n",
           "*A\r\nMOVL C00000 V=100.0\r\nJUMP *B IF IN#(1)=ON\r\nSFTOF\r\n*B\r\nSFTON P001\r\nJUMP "
           "*A\r\n"}) {
    const test::Corrected made = jbi(job(point, lines));
    EXPECT_NE(test::why(made, "C00000").find("SFTON displaces it (drill.jbi line "),
              std::string::npos)
        << lines << test::why(made, "C00000");
  }
  const test::Corrected off = jbi(
      job(point, "*A\r\nMOVL C00000 V=100.0\r\nSFTON P001\r\nSFTOF\r\nJUMP *A IF IN#(1)=ON\r\n"));
  EXPECT_TRUE(row_of(off.program, "C00000").corrected()) << test::why(off, "C00000");
}

TEST(Inform, AFrameOrToolThatAJobSetsIsNotKnown) {
  const std::string point = "C00000=1800.000,-250.000,800.000,0.0000,60.0000,0.0000\r\n";
  const std::string in_user = "///USER 1\r\n///POSTYPE USER\r\nC00001=300,-250,300,0,60,0\r\n";
  const auto with = [&](const std::string& line) {
    return corrected_by_shift(
        Dialect::kInform,
        {{"drill.jbi",
          job(point + in_user, line + "MOVL C00000 V=100.0\r\nMOVL C00001 V=100.0\r\n")}},
        {.frames = {{"TOOL[1]", kSpindle},
                    {"USER[1]", make_pose(Matrix3::Identity(), {1.5, 0, .5})}}});
  };
  EXPECT_EQ(with("").program.left_alone(), 0u) << test::why(with(""), "C00001");
  const test::Corrected frame = with("MFRAME UF#(1) P001 P002 P003\r\n");
  EXPECT_TRUE(row_of(frame.program, "C00000").corrected()) << test::why(frame, "C00000");
  EXPECT_NE(test::why(frame, "C00001").find("USER[1] is set at run time (drill.jbi line"),
            std::string::npos);
  EXPECT_TRUE(row_of(with("MFRAME UF#(2) P001 P002 P003\r\n").program, "C00001").corrected());
  EXPECT_FALSE(row_of(with("MFRAME UF#(I001) P001 P002 P003\r\n").program, "C00001").corrected());
  EXPECT_NE(test::why(with("SETTOOL TL#(1) P010\r\n"), "C00000").find("TOOL[1] is set at run time"),
            std::string::npos)
      << test::why(with("SETTOOL TL#(1) P010\r\n"), "C00000");
}

TEST(Inform, PointsOfOneArcAreCorrectedTogether) {
  const auto with = [](const std::string& last) {
    return jbi(job("C00000=1800.000,-250.000,800.000,0,60,0\r\nC00001=1800.0,0,900.,0,60,0\r\n",
                   "MOVL C00000 V=10.0\r\nMOVC C00001 V=10.0\r\nMOVC " + last + " V=10.0\r\n"));
  };
  EXPECT_TRUE(row_of(with("C00001").program, "C00001").corrected());
  EXPECT_NE(test::why(with("P001"), "C00001").find("the other point of its arc"),
            std::string::npos);
  EXPECT_TRUE(row_of(with("P001").program, "C00000").corrected());
}

test::Corrected jbi_with_axes(const std::string& first, const std::string& second) {
  return jbi(
      "/JOB\r\n//NAME DRILL\r\n//POS\r\n///NPOS 2,2,0,0,0,0\r\n///TOOL 1\r\n///POSTYPE "
      "BASE\r\n///RECTAN\r\n///RCONF "
      "1,0,0,0,0,0,0,0\r\nC00000=1800.000,-250.000,800.000,0.0000,60.0000,0.0000\r\n"
      "C00001=1800.0,0,900.,0,60,0\r\n///TOOL 0\r\n///POSTYPE PULSE\r\n///PULSE\r\nBC00000=" +
      first + "\r\nBC00001=" + second +
      "\r\n//INST\r\n///GROUP1 RB1,BS1\r\nNOP\r\nMOVL C00000 BC00000 V=100.0\r\n"
      "MOVL C00001 BC00001 V=100.0\r\nEND\r\n");
}

TEST(Inform, WhereABaseAxisMovesThatTheCellHasNotTargetsAreLeft) {
  EXPECT_EQ(jbi_with_axes("0", "0").program.left_alone(), 0u)
      << test::why(jbi_with_axes("0", "0"), "C00000");
  for (const auto& [first, second] : {std::pair("0", "250000"), std::pair("250000", "250000")}) {
    const test::Corrected made = jbi_with_axes(first, second);
    EXPECT_EQ(made.program.left_alone(), 2u);
    EXPECT_NE(test::why(made, "C00000")
                  .find("base axis 1 is not at zero throughout, and the cell has none"),
              std::string::npos)
        << test::why(made, "C00000");
  }
}

TEST(Inform, AJobOfAnotherRobotIsLeft) {
  std::string text =
      job("C00000=1800.000,-250.000,800.000,0.0000,60.0000,0.0000\r\n", "MOVL C00000 V=100.0\r\n");
  text.replace(text.find("GROUP1 RB1"), 10, "GROUP1 RB2");
  EXPECT_NE(test::why(jbi(text), "C00000").find("moves RB2, another robot"), std::string::npos)
      << test::why(jbi(text), "C00000");
}

// Universal Robots

test::Corrected script(const std::string& text) {
  return corrected_by_shift(Dialect::kUrScript, {{"p.script", text}});
}
const std::string kTcp = "  set_tcp(p[0.1, 0, 0.15, 0, -0.785398163, 0])\n";

TEST(UrScript, PosesAndJointsAreCorrectedWhereTheyStand) {
  const std::string text =
      "def drill():\n" + kTcp +
      "  # movel(p[1,2,3,0,0,0])\n  global hole = p[1.8, -0.25, 0.8, 0, 1.0472, 0]\n"
      "  movej([0, -0.35, 0.35, 0, 0.5, 0], a=1.4, v=1.05)\n  movel(hole, a=1.2, v=0.25)\n"
      "  movec(p[1.8, 0, 0.9, 0, 1.0472, 0], p[1.8, 0.1, 0.8, 0, 1.0472, 0], a=1, v=0.1)\n"
      "  textmsg(\"movel(p[0,0,0,0,0,0])\")\nend\n";
  const test::Corrected made = script(text);
  ASSERT_EQ(made.refusal, "");
  for (const ReceiptRow& row : made.program.rows)
    EXPECT_TRUE(row.corrected()) << row.name << ": " << row.message;
  EXPECT_EQ(made.program.rows.size(), 4u);
  EXPECT_EQ(test::without_numbers(test::without_inserted(made.program)),
            test::without_numbers(text));
  EXPECT_NE(made.program.files[0].text.find(
                "p[1.800123, -0.250235, 0.800346, 0.000000, 1.047200, 0.000000]"),
            std::string::npos)
      << made.program.files[0].text;
}

TEST(UrScript, ConstantTransformsAreFoldedAndWhatIsComputedIsLeft) {
  const test::Corrected made =
      script("def p():\n" + kTcp +
             "  hole = p[1.8, 0, 0.8, 0, 1.5707963, 0]\n  movej([0, -0.35, 0.35, 0, 0.5, 0])\n"
             "  movel(pose_trans(hole, p[0, 0, -0.05, 0, 0, 0]))\n  moving = p[1.8, 0, 0.8, 0, 0, "
             "0]\n  moving[2] = 3\n"
             "  movel(moving)\n  movel(get_actual_tcp_pose())\n  movel(pose_add(hole, off))\n  "
             "movel(elsewhere)\nend\n");
  const ReceiptRow folded = row_of(made.program, "pose_trans(hole, p[0, 0, -0.05, 0, 0, 0])");
  ASSERT_TRUE(folded.corrected()) << folded.message;
  EXPECT_NEAR(folded.after[0], 1.75 + 0.000123, 1e-6);
  EXPECT_NE(made.program.files[0].text.find(
                "  # trammel: was pose_trans(hole, p[0, 0, -0.05, 0, 0, 0])\n  movel(p[1.750123,"),
            std::string::npos)
      << made.program.files[0].text;
  EXPECT_NE(test::why(made, "moving").find("set at run time"), std::string::npos);
  EXPECT_NE(test::why(made, "get_actual_tcp_pose()").find("function"), std::string::npos);
  EXPECT_NE(test::why(made, "elsewhere").find("not in the script"), std::string::npos);
}

TEST(UrScript, AToolThatIsNotTheCellsIsRefused) {
  const test::Corrected made = script(
      "def p():\n  set_tcp(p[0.1,0,0.151,0,-0.785398163,0])\n  movel(p[1.8,0,0.8,0,1,0])\nend\n");
  EXPECT_NE(made.refusal.find("1.000 mm"), std::string::npos) << made.refusal;
}

TEST(UrScript, WhatALoopChangesAtItsEndHoldsAtItsHeadToo) {
  const std::string hole =
      "  hole = p[1.8, -0.125, 0.8, 0, 1.570796327, 0]\n  movej([0, -0.35, 0.35, 0, 0.5, 0])\n";
  const std::string loop = "  while i < 2:\n    movel(hole, a=1.2, v=0.05)\n";
  const test::Corrected tool =
      script("def p():\n" + kTcp + hole + loop + "    set_tcp(p[0, 0, 0, 0, 0, 0])\n  end\nend\n");
  EXPECT_NE(test::why(tool, "hole").find("set_tcp: a branch or a loop"), std::string::npos)
      << test::why(tool, "hole");
  const test::Corrected called =
      script("def null():\n  set_tcp(p[0, 0, 0, 0, 0, 0])\nend\ndef p():\n" + kTcp + hole + loop +
             "    null()\n  end\nend\n");
  EXPECT_FALSE(row_of(called.program, "hole").corrected());
  const test::Corrected set =
      script("def p():\n" + hole + "  while i < 2:\n  " + kTcp +
             "    movel(hole, a=1.2, v=0.05)\n    set_tcp(p[0, 0, 0, 0, 0, 0])\n  end\nend\n");
  EXPECT_TRUE(row_of(set.program, "hole").corrected()) << test::why(set, "hole");
}

TEST(UrScript, AThreadMaySetItsToolAtAnyTime) {
  const auto with = [](const std::string& lines) {
    return script("def drill():\n  thread watch():\n    while (True):\n" + lines +
                  "    end\n  end\n" + kTcp +
                  "  run watch()\n  movej([0, -0.35, 0.35, 0, 0.5, 0])\n"
                  "  movel(p[1.8, -0.25, 0.8, 0, 1.0472, 0], a=1.2, v=0.1)\nend\n");
  };
  const test::Corrected set = with("      set_tcp(p[0, 0, 0.2, 0, 0, 0])\n");
  EXPECT_NE(set.program.rows.at(1).message.find("set_tcp: the thread watch may change it"),
            std::string::npos)
      << set.program.rows[1].message;
  const test::Corrected harmless = with("      sleep(1)\n");
  EXPECT_TRUE(harmless.program.rows.at(1).corrected()) << harmless.program.rows[1].message;
}

TEST(UrScript, AThreadUsesTheToolThatIsSetBeforeItIsStarted) {
  const auto with = [](const std::string& before, const std::string& behind) {
    return script(
        "def drill():\n  thread work():\n    movej([0, -0.35, 0.35, 0, 0.5, 0])\n"
        "    movel(p[1.8, -0.25, 0.8, 0, 1.0472, 0], a=1.2, v=0.1)\n  end\n" +
        before + "  run work()\n" + behind + "  sleep(9)\nend\n");
  };
  const std::string hole = "p[1.8, -0.25, 0.8, 0, 1.0472, 0]";
  const test::Corrected set = with(kTcp, "");
  EXPECT_TRUE(row_of(set.program, hole).corrected()) << test::why(set, hole);
  const test::Corrected late = with("", kTcp);
  EXPECT_FALSE(row_of(late.program, hole).corrected());
  const test::Corrected again = with(kTcp, "  set_tcp(p[0, 0, 0.2, 0, 0, 0])\n");
  EXPECT_FALSE(row_of(again.program, hole).corrected());
  // Another thread starts it, so that it may be under way before the tool is set.
  const test::Corrected nested =
      with("  thread other():\n    run work()\n  end\n  run other()\n" + kTcp, "");
  EXPECT_FALSE(row_of(nested.program, hole).corrected());
}

TEST(UrScript, InverseAndSumOfConstantPosesAreFoldedToo) {
  const test::Corrected made =
      script("def p():\n" + kTcp +
             "  plane = p[1, 2, 3, 0, 0, 0.2]\n  movej([0, -0.35, 0.35, 0, 0.5, 0])\n"
             "  movel(pose_trans(plane, pose_trans(pose_inv(p[1, 2, 3, 0, 0, 0.2]), p[1.8, -0.25, "
             "0.8, 0, 1.0472, 0])))\n"
             "  movel(pose_add(p[1.8, 0, 0.8, 0, 1.0472, 0], p[0, 0.1, 0, 0, 0, 0]))\nend\n");
  EXPECT_EQ(made.program.left_alone(), 0u);
  const auto at = [&](std::size_t row) { return made.program.rows.at(row).before; };
  EXPECT_NEAR(at(1)[0], 1.8, 1e-12);
  EXPECT_NEAR(at(1)[1], -0.25, 1e-12);
  EXPECT_NEAR(at(1)[4], 1.0472, 1e-12);
  EXPECT_NEAR(at(2)[1], 0.1, 1e-12);
  EXPECT_NEAR(at(2)[4], 1.0472, 1e-12);
}

TEST(UrScript, AShareOfTheWayBetweenConstantPosesIsFolded) {
  const test::Corrected made = script(
      "def p():\n" + kTcp +
      "  from = p[1.8, -0.2, 0.8, 0, 1.0, 0]\n  to = p[1.8, 0.2, 0.9, 0, 1.2, 0]\n"
      "  quarter = 0.25\n  movej([0, -0.35, 0.35, 0, 0.5, 0])\n"
      "  movel(interpolate_pose(from, to, quarter))\n"
      "  movel(interpolate_pose(from, to, sensed()))\n"
      "  movel(interpolate_pose(p[1.8, 0, 0.8, 0, 0, 0], p[1.8, 0, 0.8, 0, 3.1415926, 0], 0.5))\n"
      "end\n");
  // Both turn about the same axis, so that the angles are a quarter of the way apart, too.
  const ReceiptRow folded = row_of(made.program, "interpolate_pose(from, to, quarter)");
  ASSERT_TRUE(folded.corrected()) << folded.message;
  const auto at = folded.before;
  EXPECT_NEAR(at[0], 1.8, 1e-12);
  EXPECT_NEAR(at[1], -0.1, 1e-12);
  EXPECT_NEAR(at[2], 0.825, 1e-12);
  EXPECT_NEAR(at[4], 1.05, 1e-12);
  EXPECT_NE(test::why(made, "interpolate_pose(from, to, sensed())").find("not constant"),
            std::string::npos);
  EXPECT_NE(test::why(made,
                      "interpolate_pose(p[1.8, 0, 0.8, 0, 0, 0], p[1.8, 0, 0.8, 0, 3.1415926, 0], "
                      "0.5)")
                .find("either way"),
            std::string::npos);
}

TEST(UrScript, WhatIsSeenFromAConveyorIsLeft) {
  for (const char* track :
       {"track_conveyor_linear(p[0.1, 0, 0, 0, 0, 0], 500)", "track_conveyor_circular(c, 500)"}) {
    const test::Corrected made =
        script("def p():\n" + kTcp + "  movej([0, -0.35, 0.35, 0, 0.5, 0])\n  " + track +
               "\n  movel(p[1.8, -0.25, 0.8, 0, 1.0472, 0])\n  stop_conveyor_tracking()\n"
               "  movel(p[1.8, -0.2, 0.8, 0, 1.0472, 0])\nend\n");
    EXPECT_NE(
        test::why(made, "p[1.8, -0.25, 0.8, 0, 1.0472, 0]").find("conveyor that moves (line 4)"),
        std::string::npos)
        << test::why(made, "p[1.8, -0.25, 0.8, 0, 1.0472, 0]");
    EXPECT_TRUE(row_of(made.program, "p[1.8, -0.2, 0.8, 0, 1.0472, 0]").corrected());
  }
}

TEST(UrScript, ThePayloadIsComparedWithTheCells) {
  const std::string moves = "  movej([0, -0.35, 0.35, 0, 0.5, 0])\n";
  const test::Corrected other =
      script("def p():\n" + kTcp + "  set_payload(40, [0, 0, 0.1])\n" + moves + "end\n");
  EXPECT_NE(other.refusal.find("60.000 kg and 0.0 mm apart"), std::string::npos) << other.refusal;
  const test::Corrected mass =
      script("def p():\n" + kTcp + "  set_payload_mass(40)\n" + moves + "end\n");
  EXPECT_NE(mass.refusal.find("60.000 kg apart"), std::string::npos) << mass.refusal;
  const test::Corrected same =
      script("def p():\n" + kTcp + "  set_payload(100, [0, 0, 0.1])\n" + moves + "end\n");
  EXPECT_EQ(same.refusal, "");
  EXPECT_EQ(same.program.left_alone(), 0u);
  const test::Corrected unknown = script(
      "def p():\n" + kTcp + moves + "  set_payload(m)\n  movel(p[1.8, 0, 0.8, 0, 1.5, 0])\nend\n");
  EXPECT_NE(test::why(unknown, "p[1.8, 0, 0.8, 0, 1.5, 0]").find("is not constant"),
            std::string::npos);
}

TEST(UrScript, WhatIsMadeOfACorrectedTargetIsSaidToMoveWithIt) {
  const test::Corrected made =
      script("def p():\n" + kTcp +
             "  hole = p[1.8, 0, 0.8, 0, 1.5707963, 0]\n  low = p[1.8, 0, 0.7, 0, 1.5707963, 0]\n"
             "  movej([0, -0.35, 0.35, 0, 0.5, 0])\n  movel(hole)\n  movel(pose_add(hole, off))\n"
             "  h = low[2] + 0.1\n  movel(low)\nend\n");
  EXPECT_TRUE(row_of(made.program, "hole").corrected());
  EXPECT_NE(test::why(made, "pose_add(hole, off)").find("it moves with hole"), std::string::npos);
  EXPECT_NE(test::why(made, "low").find("its numbers are read elsewhere too"), std::string::npos)
      << test::why(made, "low");
}

// Tables

TEST(Tables, CamRobLinesKeepAllButTheirPose) {
  const std::string text =
      "1;1800.0000;-250.0000;800.0000;0.0000;60.0000;0.0000;1;25.000;1;0;0;0;3;0.0000\r\n"
      "2;1800.0000;-249.0000;800.0000;0.0000;60.0000;0.0000;2;25.000;1;0;0;0;3;0.0000\r\n";
  const test::Corrected made = corrected_by_shift(Dialect::kCamRob, {{"p.csv", text}});
  ASSERT_EQ(made.refusal, "");
  EXPECT_EQ(test::without_inserted(made.program),
            "1;1800.1235;-250.2346;800.3457;0.0000;60.0000;0.0000;1;25.000;1;0;0;0;3;0.0000\r\n"
            "2;1800.1235;-249.2346;800.3457;0.0000;60.0000;0.0000;2;25.000;1;0;0;0;3;0.0000\r\n");
}

TEST(Tables, RoboDkHeadersSayWhichColumnsArePoses) {
  const std::string text =
      "Name,X [mm],Y [mm],Z [mm],RX [deg],RY [deg],RZ [deg]\n\"a, b\",1,2\nhole "
      "1,1800.00,0,800,0,60,0\n";
  const test::Corrected made = corrected_by_shift(Dialect::kRoboDk, {{"t.csv", text}});
  EXPECT_EQ(test::without_inserted(made.program),
            "Name,X [mm],Y [mm],Z [mm],RX [deg],RY [deg],RZ [deg]\n\"a, b\",1,2\nhole "
            "1,1800.123,-0.235,800.346,0.0000,60.0000,0.0000\n");
}

const std::string kPose = "p[1.8, 0, 0.8, 0, 1.5707963, 0]";
std::string with_lines(const std::string& lines) {
  return "def p():\n" + kTcp + "  movej([0, -0.35, 0.35, 0, 0.5, 0])\n" + lines + "end\n";
}

TEST(UrScript, AParameterHidesWhatIsCalledSoElsewhere) {
  const test::Corrected made = script(with_lines(
      "  q = " + kPose + "\n  def to(q):\n    movel(q)\n  end\n  to(" + kPose + ")\n  movel(q)\n"));
  EXPECT_EQ(made.program.left_alone(), 2u) << made.refusal;
  EXPECT_NE(test::why(made, "q").find("q is a parameter of to (p.script line 5)"),
            std::string::npos)
      << test::why(made, "q");
}

TEST(UrScript, WhatAnOffsetOrAForceMovesIsLeftUntilItEnds) {
  for (const auto& [begin, end, clause] :
       {std::tuple("path_offset_enable()", "path_offset_disable()",
                   "an offset is added to the path (line 4)"),
        std::tuple("force_mode(tool_pose(), s, w, 2, l)", "end_force_mode()",
                   "a force decides where the tool goes")}) {
    const std::string first = "  " + std::string(begin) + "\n  movel(" + kPose + ")\n";
    const test::Corrected made =
        script(with_lines(first + "  " + end + "\n  movel(p[1.8, 0.1, 0.8, 0, 1.5707963, 0])\n"));
    EXPECT_NE(test::why(made, kPose).find(clause), std::string::npos) << test::why(made, kPose);
    EXPECT_EQ(made.program.left_alone(), 1u) << made.refusal;
  }
}

TEST(UrScript, WhatMovesWhileSomebodyLeadsTheArmIsLeft) {
  for (const auto& [begin, end] : {std::pair("freedrive_mode()", "end_freedrive_mode()"),
                                   std::pair("teach_mode()", "end_teach_mode()")}) {
    const std::string led = "  " + std::string(begin) + "\n  movel(" + kPose + ")\n  " + end + "\n";
    const test::Corrected made = script(with_lines(led + "  movej([0, -0.3, 0.3, 0, 0.5, 0])\n"));
    EXPECT_NE(test::why(made, kPose).find("the arm gives way"), std::string::npos)
        << begin << ": " << test::why(made, kPose);
    EXPECT_EQ(made.program.left_alone(), 1u) << made.refusal;
  }
}

TEST(UrScript, TheMotionsThatChooseTheirOwnSpeedAreMotions) {
  const test::Corrected made = script(with_lines("  optimovel(" + kPose + ", a=0.5, v=0.5)\n"));
  EXPECT_TRUE(row_of(made.program, kPose).corrected()) << made.refusal << test::why(made, kPose);
}

// Yaskawa again

const std::string kCamOthersPoint = "C00000=1800.000,-250.000,800.000,0.0000,60.0000,0.0000\r\n";

TEST(Inform, ARelativeJobThatACallGivesAnotherFrameIsLeft) {
  const std::string relative =
      job("///USER 1\r\n///POSTYPE USER\r\n" + kCamOthersPoint, "MOVL C00000 V=138.0\r\n");
  for (const bool given : {true, false}) {
    const std::string call = "/JOB\r\n//NAME A\r\n//INST\r\nNOP\r\nCALL JOB:DRILL" +
                             std::string(given ? " UF#(2)" : "") + "\r\nEND\r\n";
    const test::Corrected made =
        corrected_by_shift(Dialect::kInform, {{"a.jbi", call}, {"d.jbi", relative}},
                           {.frames = {{"TOOL[1]", kSpindle}, {"USER[1]", Pose::Identity()}}});
    EXPECT_EQ(row_of(made.program, "C00000").corrected(), !given)
        << made.refusal << test::why(made, "C00000");
    EXPECT_EQ(test::why(made, "C00000").find("gives the job another user frame (a.jbi line 5)") !=
                  std::string::npos,
              given);
  }
}

TEST(Inform, AnInstructionThatIsNotKnownLeavesThePositionThatItIsGiven) {
  const test::Corrected made = jbi(job(kCamOthersPoint, "SMOVL C00000 V=138.0\r\n"));
  EXPECT_NE(test::why(made, "C00000").find("SMOVL is not known here: it may move the robot there"),
            std::string::npos)
      << made.refusal << test::why(made, "C00000");
}

TEST(Inform, APositionThatStandsThereTwiceIsLeft) {
  const test::Corrected made =
      jbi(job(kCamOthersPoint + kCamOthersPoint, "MOVL C00000 V=138.0\r\n"));
  EXPECT_NE(test::why(made, "C00000").find("it stands there twice (line 9, line 10)"),
            std::string::npos)
      << made.refusal << test::why(made, "C00000");
}

TEST(OtherDialects, WhatIsNoneIsLeftAsItIs) {
  for (const Dialect dialect :
       {Dialect::kInform, Dialect::kUrScript, Dialect::kCamRob, Dialect::kRoboDk}) {
    for (const std::string& text :
         std::vector<std::string>{"", "\n", ";;;;;;;\n", "//INST\nMOVL", "//INST\nNOP",
                                  "C1=", "C00000=\n//INST\nNOP\nMOVL C00000", "movel(", "movel(p[",
                                  "p=p\nmovel(p)", "x", "movel(p[1,2,3,4,5])", "a[", "set_tcp(",
                                  "\"", "movej(get_inverse_kin(", std::string(5000, '(')}) {
      const test::Corrected made = corrected_by_shift(dialect, {{"p", text}});
      EXPECT_EQ(made.program.files[0].text, text);
    }
  }
}

TEST(Programs, TextInUtf16IsRefusedAsSuchInEveryDialect) {
  const std::string rapid = "MODULE M\r\n";
  for (const Dialect dialect : {Dialect::kRapid, Dialect::kFanuc, Dialect::kKrl, Dialect::kInform,
                                Dialect::kUrScript, Dialect::kCamRob, Dialect::kRoboDk}) {
    for (const bool marked : {true, false}) {
      std::string text = marked ? "\xFF\xFE" : "";
      for (const char c : rapid) text += {c, '\0'};
      const std::string refusal = corrected_by_shift(dialect, {{"m", text}}).refusal;
      EXPECT_NE(refusal.find("text in UTF-16, expected UTF-8"), std::string::npos)
          << name_of(dialect) << refusal;
    }
  }
}

TEST(Programs, AScriptOrJobThatWasCutOffIsRefused) {
  const std::string script =
      corrected_by_shift(Dialect::kUrScript, {{"u", "def a():\n  movel(p[1,0,1,0,0,0])\n"}})
          .refusal;
  EXPECT_NE(script.find("def has no end: the file is not whole"), std::string::npos) << script;
  const std::string cut = "/JOB\n//NAME A\n//INST\nNOP\nMOVL C00000 V=1\n";
  const std::string refusal = corrected_by_shift(Dialect::kInform, {{"j", cut}}).refusal;
  EXPECT_NE(refusal.find("the job has no END: the file is not whole"), std::string::npos)
      << refusal;
}

TEST(Programs, NumbersThatNoRobotReachesAreLeftAndNothingIsWrittenBehindAnUnfinishedLine) {
  const std::string huge =
      "def a():\n  set_tcp(p[0.1, 0, 0.15, 0, -0.785398163, 0])\n  movej([0, -0.349, 0.349, 0, "
      "0.524, 0])\n"
      "  movel(p[1e308, 1e305, -1E300, 1e300, 1.57, 0])\nend\n";
  const test::Corrected left = corrected_by_shift(Dialect::kUrScript, {{"a.script", huge}});
  EXPECT_EQ(left.program.left_alone(), 1u);
  EXPECT_NE(left.program.files[0].text.find("p[1e308, 1e305, -1E300, 1e300, 1.57, 0]"),
            std::string::npos);
  const std::string job =
      "/JOB\n//POS\n///TOOL 1\n///POSTYPE BASE\n///RECTAN\n///RCONF 1,0,0,0,0,0,0,0\n"
      "C00000=1800.000,-100.000,800.000,0.0000,90.0000,0.0000\n//INST\nMOVL C00000 V=10.0\nEND";
  const Pose X_FT = test::spindle_only().tools.at("spindle");
  const test::Corrected made =
      corrected_by_shift(Dialect::kInform, {{"a.jbi", job}}, {.frames = {{"TOOL[1]", X_FT}}});
  ASSERT_EQ(made.program.moves_corrected, 1u);
  EXPECT_EQ(test::without_numbers(test::without_inserted(made.program)),
            test::without_numbers(job));
}

}  // namespace
}  // namespace trammel::cam
