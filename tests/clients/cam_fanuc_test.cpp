#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "tests/support/shifting_model.h"

namespace trammel::cam {
namespace {

using test::corrected_by_shift;
using test::row_of;

std::string setting(const std::string& name, const std::vector<std::string>& numbers) {
  std::string lines;
  for (std::size_t k = 0; k < 6; ++k)
    lines +=
        fmt::format("   1:  PR[{},{}]={}    ;\n", name == "UTOOL[2]" ? 5 : 6, k + 1, numbers[k]);
  return lines + fmt::format("   7:  {}=PR[{}] ;\n", name, name == "UTOOL[2]" ? 5 : 6);
}

std::string position(int number, const std::string& xyz, const std::string& rest = "") {
  return fmt::format(
      "P[{}{}]{{\n   GP1:\n\tUF : 1, UT : 2,\t\tCONFIG : 'N U T, 0, 0, 0',\n{},\n"
      "\tW =      .000 deg,\tP =    60.000 deg,\tR =      .000 deg\n}};\n",
      number, rest, xyz);
}
const std::string kXyz = "\tX =   300.000  mm,\tY =     -.384  mm,\tZ =   500.000  mm";

std::string program(const std::string& lines, const std::string& positions) {
  return "/PROG  P1\n/ATTR\nCOMMENT\t\t= \"\xC4\x8D\";\nLINE_COUNT\t= 3;\n/MN\n   1:  UFRAME_NUM=1 "
         ";\n" +
         lines + "/POS\n" + positions + "/END\n";
}
test::Corrected ls(const std::string& text, ReadOptions read = {}) {
  read.frames.emplace("UFRAME[1]", make_pose(Matrix3::Identity(), {1.5, 0, .5}));
  read.frames.emplace("UTOOL[2]", test::spindle_only().tools.at("spindle"));
  return corrected_by_shift(Dialect::kFanuc, {{"p1.ls", text}}, read);
}
TEST(Fanuc, OnlyNumbersOfPositionsChange) {
  const std::string text =
      program("   2:J P[1] 100% FINE ;\n   3:L P[2:\"hole; 2\"] 250mm/sec CNT50 ;\n",
              position(1, kXyz) + position(2, kXyz, ":\"hole; 2\""));
  const test::Corrected made = ls(text);
  ASSERT_EQ(made.refusal, "");
  EXPECT_EQ(made.program.left_alone(), 0u) << made.program.rows[0].message;
  EXPECT_EQ(test::without_numbers(test::without_inserted(made.program)),
            test::without_numbers(text));
  EXPECT_NE(made.program.files[0].text.find(
                "\tX =   300.123  mm,\tY =     -.619  mm,\tZ =   500.346  mm,\n"
                "\tW =      .0000 deg,\tP =    60.0000 deg,\tR =      .0000 deg"),
            std::string::npos)
      << made.program.files[0].text;
  EXPECT_NE(made.program.files[0].text.find("/MN\n   0:  !TRAMMEL model=0123456789ab ;\n"),
            std::string::npos);
}

TEST(Fanuc, JointsArcsAndSeveralGroupsAreRead) {
  const std::string joints =
      "P[3]{\n   GP1:\n\tUF : 1, UT : 2,\n\tJ1=     0.000 deg,\tJ2=   -20.000 deg,\tJ3=    20.000 "
      "deg,\n"
      "\tJ4=     0.000 deg,\tJ5=    30.000 deg,\tJ6=     0.000 deg\n   GP2:\n\tUF : 0, UT : "
      "1,\n\tJ1=    12.000 deg\n};\n";
  const test::Corrected made =
      ls(program("   2:J P[3] 100% FINE ;\n   3:C P[1]\n    :  P[2] 100mm/sec FINE ;\n",
                 position(1, kXyz) + position(2, kXyz) + joints));
  for (const ReceiptRow& row : made.program.rows)
    EXPECT_TRUE(row.corrected()) << row.name << ": " << row.message;
  EXPECT_EQ(made.program.rows.size(), 3u);
  EXPECT_NE(made.program.files[0].text.find("J1=     0.01235 deg"), std::string::npos)
      << made.program.files[0].text;
}

TEST(Fanuc, WhatIsDecidedAtRunTimeIsLeftWithTheReason) {
  const test::Corrected made =
      ls(program("   2:L PR[4] 100mm/sec FINE ;\n   3:L P[1] 100mm/sec FINE Offset,PR[1] ;\n"
                 "   4:L P[2] 100mm/sec FINE Tool_Offset,PR[2] ;\n   5:  P[3]=LPOS ;\n   6:L P[3] "
                 "50mm/sec FINE ;\n"
                 "   7:L P[5] 50mm/sec FINE Skip,LBL[1] ;\n   8:L P[9] 50mm/sec FINE ;\n",
                 position(1, kXyz) + position(2, kXyz) + position(3, kXyz) + position(4, kXyz) +
                     position(5, kXyz)));
  EXPECT_NE(why(made, "PR[4]").find("register"), std::string::npos);
  EXPECT_NE(why(made, "P[1]").find("Offset"), std::string::npos);
  EXPECT_NE(why(made, "P[2]").find("Tool_Offset"), std::string::npos);
  EXPECT_NE(why(made, "P[3]").find("set at run time"), std::string::npos);
  EXPECT_NE(fmt::format("{}", fmt::join(made.program.notes, "\n"))
                .find("no motion in these files goes to P[4]"),
            std::string::npos);
  EXPECT_NE(why(made, "P[5]").find("sensor"), std::string::npos);
  EXPECT_NE(why(made, "P[9]").find("not in /POS"), std::string::npos);
}

TEST(Fanuc, AToolFromARegisterThatTheProgramSetsIsCompared) {
  std::string lines = setting("UTOOL[2]", {"100", "0", "153.5", "0", "-45", "0"}) +
                      "   9:L P[1] 100mm/sec FINE ;\n";
  const auto made =
      corrected_by_shift(Dialect::kFanuc, {{"p.ls", program(lines, position(1, kXyz))}},
                         {.frames = {{"UFRAME[1]", make_pose(Matrix3::Identity(), {1.5, 0, .5})}}});
  EXPECT_NE(made.refusal.find("3.500 mm and 0.0000 deg apart"), std::string::npos) << made.refusal;
}

TEST(Fanuc, FramesThatOnlyTheControllerKnowsAreNotGuessed) {
  const auto made = corrected_by_shift(
      Dialect::kFanuc, {{"p.ls", program("   2:L P[1] 100mm/sec FINE ;\n", position(1, kXyz))}});
  EXPECT_NE(made.program.rows[0].message.find("UFRAME[1] is not in the files"), std::string::npos)
      << made.program.rows[0].message;
}

TEST(Fanuc, WhatIsNoLsFileIsLeftAsItIs) {
  for (const std::string& text : std::vector<std::string>{
           "", "\n", "/POS", "/POS\nP[1]{", "/POS\nP[1", "/MN\nL P[",
           "/MN\n1:L P[1] ;\n/POS\nP[1]{};", "/MN\n;;;:::", "/",
           "/POS\nP[1]{GP1: X =", "/MN\nL P[1]", "/MN\nPR[1,9]=3;\nUTOOL[1]=PR[1];"}) {
    const test::Corrected made = corrected_by_shift(Dialect::kFanuc, {{"p.ls", text}});
    EXPECT_EQ(made.program.files[0].text, text);
  }
}

std::string selected_position(int number) {
  std::string text = position(number, kXyz);
  return text.replace(text.find("UF : 1, UT : 2"), 14, "UF : F, UT : F");
}

TEST(Fanuc, FMeansTheFrameAndToolThatAreSelected) {
  const test::Corrected made =
      ls(program("   2:  UTOOL_NUM=2 ;\n   3:L P[1] 100mm/sec FINE ;\n   4:  CALL OTHER ;\n"
                 "   5:L P[2] 100mm/sec FINE ;\n",
                 selected_position(1) + selected_position(2)));
  EXPECT_TRUE(row_of(made.program, "P[1]").corrected()) << why(made, "P[1]");
  EXPECT_NE(made.program.files[0].text.find("X =   300.123  mm"), std::string::npos)
      << "taken out of UFRAME[1]";
  EXPECT_NE(why(made, "P[2]").find("CALL OTHER may select"), std::string::npos)
      << why(made, "P[2]");
  const test::Corrected none = ls(program("   3:L P[1] 100mm/sec FINE ;\n", selected_position(1)));
  EXPECT_NE(why(none, "P[1]").find("no UTOOL_NUM is set before it"), std::string::npos)
      << why(none, "P[1]");
}

TEST(Fanuc, WhereAnotherFrameOrToolIsSelectedThanThePointHasTheControllerStops) {
  const test::Corrected tool =
      ls(program("   2:  UTOOL_NUM=3 ;\n   3:L P[1] 100mm/sec FINE ;\n", position(1, kXyz)));
  EXPECT_NE(why(tool, "P[1]").find("UT : 2, and UTOOL_NUM is 3 there"), std::string::npos)
      << why(tool, "P[1]");
  const test::Corrected frame =
      ls(program("   2:  UFRAME_NUM=2 ;\n   3:L P[1] 100mm/sec FINE ;\n", position(1, kXyz)));
  EXPECT_NE(why(frame, "P[1]").find("UF : 1, and UFRAME_NUM is 2 there"), std::string::npos)
      << why(frame, "P[1]");
  const test::Corrected same =
      ls(program("   2:  UTOOL_NUM=2 ;\n   3:L P[1] 100mm/sec FINE ;\n", position(1, kXyz)));
  EXPECT_TRUE(row_of(same.program, "P[1]").corrected()) << why(same, "P[1]");
}

TEST(Fanuc, WhatAJumpBackChangesHoldsAtItsLabelToo) {
  for (const std::string& jump : std::vector<std::string>{"JMP LBL[1]", "IF DI[1]=ON,JMP LBL[1]",
                                                          "IF (DI[1]=ON),JMP LBL[1]"}) {
    const test::Corrected made =
        ls(program("   2:  UTOOL_NUM=2 ;\n   3:  LBL[1:again] ;\n   4:L P[1] 100mm/sec FINE ;\n   "
                   "5:  UFRAME_NUM=3 ;\n   6:  " +
                       jump + " ;\n",
                   selected_position(1)));
    EXPECT_NE(why(made, "P[1]").find("a branch, a jump or a loop"), std::string::npos)
        << jump << why(made, "P[1]");
  }
}

TEST(Fanuc, WhatAMonitorMaySelectIsNotKnown) {
  for (const std::string& line :
       std::vector<std::string>{"MONITOR CHECK", "ERROR_PROG=CHECK", "RESUME_PROG=CHECK"}) {
    const test::Corrected made =
        ls(program("   2:  UTOOL_NUM=2 ;\n   3:L P[1] 100mm/sec FINE ;\n   4:  " + line +
                       " ;\n   5:  UTOOL_NUM=2 ;\n   6:L P[2] 100mm/sec FINE ;\n"
                       "   7:L P[3] 100mm/sec FINE ;\n",
                   selected_position(1) + selected_position(2) + position(3, kXyz)));
    EXPECT_TRUE(row_of(made.program, "P[1]").corrected()) << why(made, "P[1]");
    EXPECT_NE(why(made, "P[2]").find(line + " may select another one"), std::string::npos)
        << why(made, "P[2]");
    EXPECT_TRUE(row_of(made.program, "P[3]").corrected()) << "its own numbers are said";
  }
}

TEST(Fanuc, ARegisterThatAnotherProgramSetsIsNoConstant) {
  const auto with = [](const std::string& x) {
    return corrected_by_shift(
        Dialect::kFanuc,
        {{"p.ls", program(setting("UTOOL[2]", {"100", "0", "150", "0", "-45", "0"}) +
                              "   9:L P[1] 100mm/sec FINE ;\n",
                          position(1, kXyz))},
         {"q.ls", "/PROG Q\n/MN\n   1:  PR[5,1]=" + x + " ;\n/POS\n/END\n"}},
        {.frames = {{"UFRAME[1]", make_pose(Matrix3::Identity(), {1.5, 0, .5})}}});
  };
  EXPECT_TRUE(row_of(with("100").program, "P[1]").corrected()) << why(with("100"), "P[1]");
  EXPECT_FALSE(with("101").refusal.empty() && row_of(with("101").program, "P[1]").corrected());
}

TEST(Fanuc, AnApostropheInARemarkHidesNoMotion) {
  const test::Corrected made =
      ls(program("   2:  !Don't stop here ;\n   3:L P[1:it's] 100mm/sec FINE ;\n"
                 "   4:  !it isn't \"closed ;\n   5:C P[2]\n    :  P[3] 100mm/sec FINE ;\n",
                 position(1, kXyz) + position(2, kXyz) + position(3, kXyz)));
  for (const ReceiptRow& row : made.program.rows)
    EXPECT_TRUE(row.corrected()) << row.name << ": " << row.message;
  EXPECT_EQ(made.program.moves_corrected, 2u);
}

TEST(Fanuc, PointsOfOneArcAreCorrectedTogether) {
  const auto with = [](const std::string& last) {
    return ls(
        program("   2:A P[1] 100mm/sec FINE ;\n   3:A P[2] 100mm/sec FINE ;\n   4:A " + last +
                    " 100mm/sec FINE ;\n   5:L P[4] 100mm/sec FINE ;\n",
                position(1, kXyz) + position(2, kXyz) + position(3, kXyz) + position(4, kXyz)));
  };
  EXPECT_TRUE(row_of(with("P[3]").program, "P[1]").corrected());
  EXPECT_NE(why(with("PR[3]"), "P[1]").find("the other point of its arc"), std::string::npos);
  EXPECT_TRUE(row_of(with("PR[3]").program, "P[4]").corrected());
}

TEST(Fanuc, AMotionThatIsLeftIsSaidToMoveWithItsPositionWhereAnotherCorrectsIt) {
  const auto with = [](const std::string& first) {
    return ls(program("   2:" + first + "   3:L P[1] 100mm/sec FINE Offset,PR[1] ;\n",
                      position(1, kXyz)));
  };
  const auto left = [](const test::Corrected& made) {
    for (const ReceiptRow& row : made.program.rows) {
      if (!row.corrected()) return row.message;
    }
    return std::string();
  };
  EXPECT_EQ(left(with("L P[1] 100mm/sec FINE ;\n")),
            "Offset displaces it at run time; it moves with P[1], which is corrected");
  EXPECT_EQ(left(with("  !none ;\n")), "Offset displaces it at run time");
}

TEST(Fanuc, APayloadThatOnlyTheControllerKnowsIsSaid) {
  const test::Corrected made =
      ls(program("   2:  PAYLOAD[3] ;\n   3:L P[1] 100mm/sec FINE ;\n", position(1, kXyz)));
  ASSERT_EQ(made.program.notes.empty(), false);
  EXPECT_NE(made.program.notes[0].find("PAYLOAD[3] (p1.ls line"), std::string::npos)
      << made.program.notes[0];
}

TEST(Fanuc, APayloadThatIsSelectedOftenIsSaidOnce) {
  std::string lines;
  for (int k = 2; k < 33; ++k) lines += fmt::format("  {:2}:  PAYLOAD[3] ;\n", k);
  const test::Corrected made =
      ls(program(lines + "  33:L P[1] 100mm/sec FINE ;\n", position(1, kXyz)));
  ASSERT_EQ(made.program.notes.size(), 1u);
  EXPECT_NE(made.program.notes[0].find("PAYLOAD[3] (p1.ls line 7 and 30 more)"), std::string::npos)
      << made.program.notes[0];
}

TEST(Fanuc, AToolOfARowThatIsNotTheCellsIsRefusedAtTheRow) {
  ReadOptions read;
  read.frames = {
      {"UTOOL[2]", make_pose(test::spindle_only().tools.at("spindle").linear(), {.1, 0, .1525})}};
  const test::Corrected made = ls(program("   2:J P[1] 100% FINE ;\n", position(1, kXyz)), read);
  EXPECT_NE(made.refusal.find("in the row of --frames"), std::string::npos) << made.refusal;
  EXPECT_EQ(made.refusal.find("row 0"), std::string::npos) << made.refusal;
}

TEST(Fanuc, ARegisterThatIsMadeOfACorrectedPositionIsSaidToMoveWithIt) {
  const test::Corrected made = ls(
      program("   2:  PR[5]=P[1] ;\n   3:L P[1] 100mm/sec FINE ;\n   4:L PR[5] 100mm/sec FINE ;\n",
              position(1, kXyz)));
  EXPECT_TRUE(row_of(made.program, "P[1]").corrected());
  EXPECT_NE(why(made, "PR[5]").find("it moves with P[1], which is corrected"), std::string::npos)
      << why(made, "PR[5]");
}

std::string with_line_track(const std::string& schedule) {
  std::string text = program("   2:L P[1] 100mm/sec FINE ;\n", position(1, kXyz));
  return text.replace(
      text.find("/MN"), 0,
      "/APPL\n  LINE_TRACK ;\n    LINE_TRACK_SCHEDULE_NUMBER      : " + schedule + " ;\n");
}

TEST(Fanuc, WhatIsSeenFromAConveyorIsLeft) {
  EXPECT_NE(
      why(ls(with_line_track("1")), "P[1]").find("LINE_TRACK (line 6): it is seen from a conveyor"),
      std::string::npos)
      << why(ls(with_line_track("1")), "P[1]");
  EXPECT_TRUE(row_of(ls(with_line_track("0")).program, "P[1]").corrected());
}

TEST(Fanuc, WhatASeamTrackerMovesIsLeftUntilItEnds) {
  const test::Corrected made =
      ls(program("   2:L P[1] 100mm/sec FINE ;\n   3:Track TAST[1] ;\n"
                 "   4:L P[2] 100mm/sec FINE ;\n   5:Track End ;\n   6:L P[3] 100mm/sec FINE ;\n",
                 position(1, kXyz) + position(2, kXyz) + position(3, kXyz)));
  EXPECT_TRUE(row_of(made.program, "P[1]").corrected());
  EXPECT_NE(why(made, "P[2]").find("Track TAST (line 8) moves it at run time"), std::string::npos)
      << why(made, "P[2]");
  EXPECT_TRUE(row_of(made.program, "P[3]").corrected());
}

/// A servo gun as group 2, which opens and closes.
std::string with_gun(const std::string& more = "") {
  const auto gun = [](const std::string& text, const std::string& opening) {
    return text.substr(0, text.find("\n};")) + "\n   GP2:\n\tUF : 1, UT : 2,\n\tJ1=    " + opening +
           "  mm\n};\n";
  };
  return program("   2:L P[1] 100mm/sec FINE ;\n   3:L P[2] 100mm/sec FINE ;\n" + more,
                 gun(position(1, kXyz), "60.000") + gun(position(2, kXyz), "12.000"));
}

TEST(Fanuc, AnAxisThatMovesIsNamedByGroupAndNumberUnlessItIsSaidToCarryNothing) {
  EXPECT_NE(why(ls(with_gun()), "P[1]").find("group 2, axis 1 moves, and the cell has none"),
            std::string::npos)
      << why(ls(with_gun()), "P[1]");
  Program program =
      read_program(Dialect::kFanuc, {{"p1.ls", with_gun()}},
                   {.frames = {{"UFRAME[1]", make_pose(Matrix3::Identity(), {1.5, 0, .5})}}});
  ASSERT_EQ(program.targets.size(), 2u);
  const Status unknown = take_idle_axes(program, {"g"});
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().field, "--idle-axis");
  ASSERT_TRUE(take_idle_axes(program, {"group 2, axis 1"}));
  for (const ProgramTarget& target : program.targets) EXPECT_TRUE(target.external.empty());
}

TEST(Fanuc, ACellMaySayThatAnAxisCarriesNothing) {
  ReadOptions read;
  read.frames.emplace("UFRAME[1]", make_pose(Matrix3::Identity(), {1.5, 0, .5}));
  read.frames.emplace("UTOOL[2]", test::spindle_only().tools.at("spindle"));
  CellTools cell = test::spindle_only();
  cell.idle_axes = {"gun", "group 2, axis 1"};  // one that no program here has says nothing of it
  const test::Corrected made =
      corrected_by_shift(Dialect::kFanuc, {{"p1.ls", with_gun()}}, read, {}, cell);
  EXPECT_EQ(made.refusal, "");
  EXPECT_EQ(made.program.left_alone(), 0u) << why(made, "P[1]");
}

TEST(Fanuc, APointThatNoMotionGoesToIsANoteAndNothingThatIsLeft) {
  const test::Corrected made =
      ls(program("   2:L P[1] 100mm/sec FINE ;\n", position(1, kXyz) + position(2, kXyz)));
  EXPECT_EQ(made.program.left_alone(), 0u);
  ASSERT_EQ(made.program.notes.size(), 1u);
  EXPECT_NE(made.program.notes[0].find("no motion in these files goes to P[2] (p1.ls line"),
            std::string::npos)
      << made.program.notes[0];
}

std::string with_frame(const std::string& x, const std::string& more = "") {
  return program(setting("UFRAME[1]", {x, "0", "500", "0", "0", "0"}) + more +
                     "   9:L P[1] 100mm/sec FINE ;\n",
                 position(1, kXyz));
}
ReadOptions frame_at(double x) {
  return {.frames = {{"UFRAME[1]", make_pose(Matrix3::Identity(), {x, 0, .5})}}};
}

TEST(Fanuc, ARowOfFramesThatContradictsWhatTheProgramSetsLeavesThePointWithBothValues) {
  const test::Corrected apart = ls(with_frame("1500"), frame_at(1.5025));
  for (const char* part :
       {"UFRAME[1] is [1502.500, 0.000, 500.000]", "by --frames and [1500.000, 0.000, 500.000]",
        "p1.ls line 13", "2.500 mm"})
    EXPECT_NE(why(apart, "P[1]").find(part), std::string::npos) << why(apart, "P[1]");
  EXPECT_TRUE(row_of(ls(with_frame("1500"), frame_at(1.5)).program, "P[1]").corrected());
  const std::string tool = program(
      setting("UTOOL[2]", {"100", "0", "153", "0", "-45", "0"}) + "   9:L P[1] 100mm/sec FINE ;\n",
      position(1, kXyz));
  EXPECT_NE(why(ls(tool), "P[1]").find("UTOOL[2] is [100.000, 0.000, 150.000]"), std::string::npos)
      << why(ls(tool), "P[1]");
}

TEST(Fanuc, ARowThatIsContradictedIsNoRowThatNothingUses) {
  const Program read =
      read_program(Dialect::kFanuc, {{"p1.ls", with_frame("1500")}}, frame_at(1.5025));
  EXPECT_TRUE(rows_of(read).used.contains("UFRAME[1]"));
}

TEST(Fanuc, AProgramsFrameIsHeldAgainstARowAsTheRobotStandsInTheWorld) {
  ReadOptions read = frame_at(1.5);
  read.frames.emplace("robot_base", make_pose(Matrix3::Identity(), {0, 0, .8}));
  EXPECT_FALSE(row_of(ls(with_frame("1500"), read).program, "P[1]").corrected());
  read.frames.at("UFRAME[1]").translation().z() = -.3;
  EXPECT_EQ(why(ls(with_frame("1500"), read), "P[1]").find("by --frames"), std::string::npos)
      << why(ls(with_frame("1500"), read), "P[1]");
}

TEST(Fanuc, AFrameThatTheProgramChangesAtRunTimeIsLeftWhateverTheRowSays) {
  for (const char* line : {"UFRAME[1]=PR[7]", "UFRAME[R[1]]=PR[7]", "PR[6]=LPOS", "PR[R[1]]=LPOS",
                           "PR[GP1:6]=LPOS", "PR[6,1]=PR[6,1]+(5)", "IF (DI[1]),PR[6,1]=(200)",
                           "IF (DI[1]),UFRAME[1]=PR[7]", "PR[6,2]=(-1)"}) {
    const test::Corrected made =
        ls(with_frame("1500", fmt::format("   8:  {} ;\n", line)), frame_at(1.5));
    EXPECT_FALSE(row_of(made.program, "P[1]").corrected()) << line;
  }
  for (const char* line : {"UFRAME[1]=VR[1].OFFSET", "UFRAME[1]=UFRAME[2]", "UFRAME[1]=PR[R[2]]",
                           "$MNUFRAME[1,1]=PR[9]", "$MNUFRAME[1,R[1]]=PR[9]"}) {
    const test::Corrected made = ls(program(
        fmt::format("   2:  {} ;\n   3:L P[1] 100mm/sec FINE ;\n", line), position(1, kXyz)));
    EXPECT_FALSE(row_of(made.program, "P[1]").corrected()) << line;
  }
  const std::string elsewhere =
      program("   2:  UFRAME[1]=PR[9] ;\n   3:L P[1] 100mm/sec FINE ;\n", position(1, kXyz));
  EXPECT_TRUE(row_of(ls(elsewhere).program, "P[1]").corrected())
      << "nothing here says PR[9]: the row does";
}

TEST(Fanuc, NegativeElementsStandInBrackets) {
  const Program read =
      read_program(Dialect::kFanuc, {{"p.ls", with_frame("(-1500.25)")}},
                   {.frames = {{"UTOOL[2]", test::spindle_only().tools.at("spindle")}}});
  ASSERT_EQ(read.targets.size(), 1u);
  EXPECT_NEAR(read.frames[read.targets[0].frame].X_BO.translation().x(), -1.50025, 1e-12);
}

TEST(Fanuc, WhatIsSelectedOnAConditionOrForAnotherGroupIsToldApart) {
  const auto said = [](const std::string& line) {
    return why(
        ls(program("   2:  UTOOL_NUM=2 ;\n   3:  " + line + " ;\n   4:L P[1] 100mm/sec FINE ;\n",
                   selected_position(1))),
        "P[1]");
  };
  EXPECT_NE(said("IF (DI[1]=ON),UFRAME_NUM=(3)").find("a branch"), std::string::npos);
  EXPECT_NE(said("UFRAME_NUM[GP1]=R[2]").find("is set at run time"), std::string::npos);
  EXPECT_NE(said("$MNUFRAMENUM[1]=R[2]").find("is set at run time"), std::string::npos);
  EXPECT_NE(said("JMP LBL[R[1]] ;\n   3:  LBL[1]").find("a branch, a jump"), std::string::npos);
  EXPECT_NE(
      said("WAIT DI[1]=ON TIMEOUT,LBL[1] ;\n   3:  UFRAME_NUM=3 ;\n   3:  LBL[1]").find("a branch"),
      std::string::npos);
  for (const char* line :
       {"UFRAME_NUM[GP2]=3", "$MNUFRAMENUM[2]=3", "//UFRAME_NUM=3", "--eg:UFRAME_NUM=3",
        "UFRAME_NUM=(1)", "CALL_LOG('UFRAME_NUM=3, Offset')"})
    EXPECT_EQ(said(line).find("UFRAME_NUM"), std::string::npos) << said(line);
}

TEST(Fanuc, WordsInCommentsOfPointsMeanNothingAndHideNothing) {
  const test::Corrected made = ls(program(
      "   2:L P[1:don't] 100mm/sec FINE Offset,PR[1] ;\n   3:L P[2:Offset; Skip] 100mm/sec FINE ;\n"
      "   4:// L P[3] 100mm/sec FINE ;\n",
      position(1, kXyz) + position(2, kXyz) + position(3, kXyz)));
  EXPECT_NE(why(made, "P[1]").find("Offset displaces it"), std::string::npos) << why(made, "P[1]");
  EXPECT_TRUE(row_of(made.program, "P[2]").corrected()) << why(made, "P[2]");
  EXPECT_EQ(made.program.moves_corrected, 1u);
}

TEST(Fanuc, WhatATouchSearchesOrDisplacesIsLeftUntilItEnds) {
  const test::Corrected made = ls(program(
      "   2:  Search Start[1] PR[3] ;\n   3:L P[1] 100mm/sec FINE Search[-X] ;\n   4:  Search End "
      ";\n"
      "   5:  Touch Offset PR[3] ;\n   6:L P[2] 100mm/sec FINE ;\n   7:  Touch Offset End ;\n"
      "   8:L P[3] 100mm/sec FINE ;\n",
      position(1, kXyz) + position(2, kXyz) + position(3, kXyz)));
  EXPECT_NE(why(made, "P[1]").find("a sensor may end the motion (Search)"), std::string::npos)
      << why(made, "P[1]");
  EXPECT_NE(why(made, "P[2]").find("Touch Offset (line 10) moves it"), std::string::npos)
      << why(made, "P[2]");
  EXPECT_TRUE(row_of(made.program, "P[3]").corrected()) << why(made, "P[3]");
}

TEST(Fanuc, AToolThatStandsIsLeft) {
  const test::Corrected made =
      ls(program("   2:L P[1] 100mm/sec FINE RTCP ;\n", position(1, kXyz)));
  EXPECT_NE(why(made, "P[1]").find("the tool stands"), std::string::npos) << why(made, "P[1]");
}

TEST(Fanuc, ASecondRobotInAPointIsNamed) {
  const std::string two = position(1, kXyz).substr(0, position(1, kXyz).find("\n};")) +
                          "\n   GP2:\n\tUF : 1, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',\n" + kXyz +
                          ",\n\tW = 0 deg,\tP = 60 deg,\tR = 0 deg\n};\n";
  const test::Corrected made = ls(program("   2:L P[1] 100mm/sec FINE ;\n", two));
  EXPECT_NE(why(made, "P[1]").find("its group 2 is another robot"), std::string::npos)
      << why(made, "P[1]");
}

TEST(Fanuc, APointThatSaysNoFrameOrToolIsLeftWithWhatIsMissing) {
  const auto without = [](const std::string& what) {
    std::string text = position(1, kXyz);
    text.erase(text.find(what), what.size());
    return why(ls(program("   2:L P[1] 100mm/sec FINE ;\n", text)), "P[1]");
  };
  EXPECT_NE(without("UF : 1, ").find("the point does not say its UF"), std::string::npos)
      << without("UF : 1, ");
  EXPECT_NE(without("UT : 2,").find("the point does not say its UT"), std::string::npos)
      << without("UT : 2,");
}

}  // namespace
}  // namespace trammel::cam
