#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "tests/support/shifting_model.h"

namespace trammel::cam {
namespace {

using test::corrected_by_shift;
using test::kShift_mm;
using test::row_of;

const std::string kCamRapidTool =
    "  PERS tooldata "
    "tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,0]];"
    "\n";
const std::string kPanel =
    "  PERS wobjdata "
    "wPanel:=[FALSE,TRUE,\"\",[[1500,0,500],[1,0,0,0]],[[300,-250,300],[1,0,0,0]]];\n";
const std::string kRest = ",[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]";

std::string target(const std::string& name, const std::string& position) {
  return "  CONST robtarget " + name + ":=[[" + position + "]" + kRest + ";\n";
}
std::string program(const std::string& data, const std::string& motions) {
  return "MODULE M\n" + kCamRapidTool + kPanel + data + "  PROC main()\n" + motions +
         "  ENDPROC\nENDMODULE\n";
}
std::string move_l(const std::string& point, const std::string& wobj = "\\WObj:=wPanel") {
  return "    MoveL " + point + ",v100,fine,tSpindle" + wobj + ";\n";
}
test::Corrected rapid(const std::string& text, const ReadOptions& read = {},
                      const CorrectProgramOptions& options = {}) {
  return corrected_by_shift(Dialect::kRapid, {{"m.mod", text}}, read, options);
}
TEST(Rapid, OnlyNumbersOfTargetsChangeAndWholeLinesAreInserted) {
  const std::string text =
      "\xEF\xBB\xBF" + program(
                           "\t! Sch\xE4"
                           "fte: p10:=[[1,2,3],[1,0,0,0]]; MoveL p10\r\n" +
                               target("p10", "0, 125.00,\t400.5") +
                               "  CONST string s:=\"MoveL p10,\"\"v100\"\",fine;\"; ! p10\n",
                           move_l("p10"));
  const test::Corrected made = rapid(text);
  ASSERT_EQ(made.refusal, "");
  EXPECT_EQ(test::without_numbers(test::without_inserted(made.program)),
            test::without_numbers(text));
  EXPECT_NE(made.program.files[0].text.find(
                "[[0.123, 124.765,\t400.846],[0.707107,0.000000,0.707107,0.000000],[0,0,0,0]"),
            std::string::npos)
      << made.program.files[0].text;
  ASSERT_EQ(made.program.inserted.size(), 1u);
  EXPECT_NE(made.program.inserted[0].text.find(
                "TRAMMEL model=0123456789ab version=0.1.0 date=2026-11-22 original="),
            std::string::npos);
}

TEST(Rapid, WhatIsSetAtRunTimeIsNamedAlsoWhereOneOfItsNumbersIs) {
  std::string data = target("p10", "0,0,400");
  data.replace(data.find("CONST"), 5, "PERS");
  const test::Corrected made = rapid(program(data, "    p10.trans.z:=reg1;\n" + move_l("p10")));
  EXPECT_NE(test::why(made, "p10").find("p10 is set at run time (m.mod line"), std::string::npos)
      << test::why(made, "p10");
}

TEST(Rapid, AFileWhoseLinesEndInCrAloneIsRefused) {
  std::string text = program(target("p10", "0,0,400"), move_l("p10"));
  std::replace(text.begin(), text.end(), '\n', '\r');
  EXPECT_NE(rapid(text).refusal.find("end in CR alone"), std::string::npos) << rapid(text).refusal;
}

TEST(Rapid, ALoadBesideACellWithoutPayloadsIsSaidNotToBeCompared) {
  CellTools cell = test::spindle_only();
  cell.payloads.clear();
  const std::string text = program(target("p10", "0,0,400"), move_l("p10"));
  const test::Corrected made = corrected_by_shift(Dialect::kRapid, {{"m.mod", text}}, {}, {}, cell);
  ASSERT_EQ(made.program.notes.size(), 1u);
  EXPECT_NE(
      made.program.notes[0].find("load of tool tSpindle is 100.000 kg at [0.0, 0.0, 100.0] mm in "
                                 "the program, the cell has no payloads: it is not compared"),
      std::string::npos)
      << made.program.notes[0];
  EXPECT_TRUE(rapid(text).program.notes.empty()) << "with a payload it is compared";
}

TEST(Rapid, NumbersKeepTheWayTheyAreWritten) {
  const test::Corrected made = rapid(program(target("p10", ".5,+250.,4E+02"), move_l("p10")));
  EXPECT_NE(made.program.files[0].text.find("[[.623,+249.765,4.00346E+02]"), std::string::npos)
      << made.program.files[0].text;
}

TEST(Rapid, DigitsAreAddedWhereRoundingWouldTakeATenthOfWhatIsKnownUnlessForbidden) {
  const std::string text = program(target("p10", "0.0,125.0,400.0"), move_l("p10"));
  const test::Corrected more = rapid(text);
  EXPECT_LE(row_of(more.program, "p10").rounding_mm, std::sqrt(3.0) * 0.001);
  CorrectProgramOptions options;
  options.keep_digits = true;
  const test::Corrected same = rapid(text, {}, options);
  EXPECT_NE(same.program.files[0].text.find("[[0.1,124.8,400.3]"), std::string::npos)
      << same.program.files[0].text;
  const ReceiptRow row = row_of(same.program, "p10");
  EXPECT_NEAR(row.rounding_mm, Vector3(0.0234567, 0.0345678, 0.0456789).norm(), 1e-6);
  EXPECT_GT(row.error_after_mm, row.rounding_mm);
}

TEST(Rapid, ConstantOffsetsAreFoldedAndKeptAsAComment) {
  const test::Corrected made =
      rapid(program("  CONST num up:=2*(10+15);\n" + target("p10", "0,125,400"),
                    move_l("p10") + move_l("Offs(Offs(p10,-up,0,0),0,0,up/2)") +
                        move_l("RelTool(p10,0,0,-10\\Rz:=90)")));
  ASSERT_EQ(made.program.left_alone(), 0u) << made.program.rows[0].message;
  const std::string& text = made.program.files[0].text;
  EXPECT_NE(text.find("    ! trammel: was Offs(Offs(p10,-up,0,0),0,0,up/2)\n    MoveL "
                      "[[-49.877,124.765,425.346],["),
            std::string::npos)
      << text;
  // The tool's z is the base's x here: 10 mm back.
  EXPECT_NE(text.find("MoveL [[-9.877,124.765,400.346],[0.500000,0.500000,0.500000,0.500000],"),
            std::string::npos)
      << text;
  EXPECT_EQ(made.program.moves_corrected, 3u);
}

TEST(Rapid, ATargetIsCorrectedInItsWorkObjectWithItsMovedObjectFrame) {
  // Both frames turned about z by 90 deg: the object's x is the base's -x.
  const test::Corrected made = rapid(
      program("  PERS wobjdata "
              "wTurned:=[FALSE,TRUE,\"\",[[1800,0,1000],[0.70710678,0,0,0.70710678]],[[0,0,0],[0."
              "70710678,0,0,0.70710678]]];\n  CONST robtarget "
              "p10:=[[0,10,0],[0,-0.70710678,0,0.70710678],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n",
              move_l("p10", "\\WObj:=wTurned")));
  const ReceiptRow row = row_of(made.program, "p10");
  ASSERT_TRUE(row.corrected()) << row.message;
  EXPECT_NEAR(row.after[0], -kShift_mm.x(), 1e-3);
  EXPECT_NEAR(row.after[1], 10 - kShift_mm.y(), 1e-3);
  EXPECT_NEAR(row.after[2], kShift_mm.z(), 1e-3);
  EXPECT_NEAR(row.p_B.x(), 1.8, 1e-9);
  EXPECT_NEAR(row.p_B.y(), -0.01, 1e-9);
}

TEST(Rapid, ArraysRecordsInlineTargetsAndArcsAreFound) {
  const std::string data =
      "  RECORD hole\n    num depth;\n    robtarget place;\n  ENDRECORD\n"
      "  CONST hole h:=[12,[[0,100,400]" +
      kRest +
      "];\n"
      "  CONST robtarget a{2,2}:=[[[[0,0,0]" +
      kRest + ",[[0,0,100]" + kRest + "],\n    [[[0,100,0]" + kRest + ",[[0,100,100]" + kRest +
      "]];\n" + target("p1", "0,200,200") + target("p2", "0,210,210");
  const test::Corrected made = rapid(program(
      data,
      "    FOR i FROM 1 TO 2 DO\n" + move_l("a{i,2}") + "    ENDFOR\n" + move_l("a{2,1}") +
          move_l("h.place") + move_l("[[0,50,50]" + kRest) +
          "    MoveC p1,p2\\ID:=4,v100,z10,tSpindle,\\WObj:=wPanel;\n"
          "    IF i>3 TriggL Offs(p2,0,0,5),v100,trig1\\T2:=trig2,z10,tSpindle\\WObj:=wPanel;\n"));
  for (const ReceiptRow& row : made.program.rows)
    EXPECT_TRUE(row.corrected()) << row.name << ": " << row.message;
  EXPECT_EQ(made.program.rows.size(), 3u + 1 + 1 + 2 + 1) << made.program.files[0].text;
  EXPECT_EQ(made.program.moves_corrected, 6u);
}

TEST(Rapid, WhatTheProgramDecidesAtRunTimeIsLeftWithTheReason) {
  const std::string data = target("p10", "0,0,0") + target("a", "0,1,0") +
                           "  VAR robtarget pVar:=[[0,9,0]" + kRest +
                           ";\n  VAR num n:=3;\n  PERS num nPers:=3;\n  VAR robtarget pFound;\n";
  const test::Corrected made = rapid(program(
      data, move_l("p10") + move_l("a") + move_l("Offs(p10,n,0,0)") +
                move_l("Offs(p10,nPers,0,0)") + move_l("pVar") +
                "    SearchL di1,pFound,a,v20,tSpindle\\WObj:=wPanel;\n" +
                move_l("Offs(pFound,0,0,1)") + move_l("fWhere(2)") + move_l("pElsewhere") +
                "    FOR k FROM 1 TO 3 DO\n" + move_l("Offs(p10,0,k*10,0)") + "    ENDFOR\n" +
                "    n:=n+1;\n    pVar.trans.z:=5;\n    PDispOn p10,tSpindle;\n" +
                move_l("Offs(p10,1,0,0)") + "    PDispOff;\n" + move_l("Offs(p10,2,0,0)")));
  EXPECT_NE(test::why(made, "Offs(p10,n,0,0)").find("n is set at run time (m.mod line"),
            std::string::npos);
  EXPECT_NE(test::why(made, "Offs(p10,nPers,0,0)").find("persistent"), std::string::npos);
  EXPECT_NE(test::why(made, "pVar").find("set at run time"), std::string::npos);
  EXPECT_NE(test::why(made, "Offs(pFound,0,0,1)").find("SearchL"), std::string::npos);
  EXPECT_NE(test::why(made, "fWhere(2)").find("function"), std::string::npos);
  EXPECT_NE(test::why(made, "pElsewhere").find("not in the files"), std::string::npos);
  EXPECT_NE(test::why(made, "Offs(p10,0,k*10,0)").find("loop counts k"), std::string::npos);
  EXPECT_NE(test::why(made, "Offs(p10,1,0,0)").find("PDispOn"), std::string::npos);
  EXPECT_TRUE(row_of(made.program, "Offs(p10,2,0,0)").corrected());
  EXPECT_NE(test::why(made, "p10").find("a displacement is measured from it (PDispOn"),
            std::string::npos)
      << test::why(made, "p10");
}

TEST(Rapid, TheSamePointInTwoFramesIsRefusedOrSplit) {
  const std::string text = program(
      "  PERS wobjdata wOther:=[FALSE,TRUE,\"\",[[1800,0,800],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n" +
          target("p10", "0,125,400"),
      move_l("p10") + move_l("p10", "\\WObj:=wOther"));
  EXPECT_NE(test::why(rapid(text), "p10")
                .find("used in different ways: tool tSpindle in wPanel (m.mod line"),
            std::string::npos);
  const test::Corrected split = rapid(text, {.split = true});
  ASSERT_EQ(split.program.rows.size(), 2u);
  for (const ReceiptRow& row : split.program.rows) EXPECT_TRUE(row.corrected()) << row.message;
  EXPECT_NE(split.program.files[0].text.find("MoveL [[0.123,124.765,400.346],"), std::string::npos)
      << split.program.files[0].text;
}

TEST(Rapid, ParametersAreFollowedToWhatIsHandedOver) {
  const test::Corrected made = rapid(program(
      target("p10", "0,125,400") + target("p20", "0,225,400"),
      "    rDrill p10,tSpindle,50;\n    rDrill p20,tSpindle,50;\n    rOnce p20;\n  ENDPROC\n"
      "  PROC rDrill(robtarget pAt,PERS tooldata tWith,num nBack)\n"
      "    MoveL pAt,v10,fine,tWith\\WObj:=wPanel;\n    MoveL "
      "Offs(pAt,-nBack,0,0),v10,fine,tWith\\WObj:=wPanel;\n  ENDPROC\n"
      "  PROC rOnce(robtarget pAt)\n    MoveL "
      "Offs(pAt,-20,0,0),v10,fine,tSpindle\\WObj:=wPanel;\n"));
  EXPECT_TRUE(row_of(made.program, "p10").corrected()) << test::why(made, "p10");
  EXPECT_TRUE(row_of(made.program, "p20").corrected());
  EXPECT_NE(test::why(made, "Offs(pAt,-nBack,0,0)").find("different values"), std::string::npos);
  EXPECT_TRUE(row_of(made.program, "Offs(pAt,-20,0,0)").corrected());
}

TEST(Rapid, ModulesShareTheirDataAndKeepTheirOwn) {
  const std::string data = "MODULE D(SYSMODULE)\n" + kCamRapidTool + kPanel +
                           target("p10", "0,125,400") + "  LOCAL" +
                           target("p20", "0,1,1").substr(1) + "ENDMODULE\n";
  const std::string moves = "MODULE P\n  LOCAL" + target("p20", "0,200,200").substr(1) +
                            "  PROC main()\n" + move_l("p10") + move_l("p20") +
                            "  ENDPROC\nENDMODULE\n";
  const test::Corrected made =
      corrected_by_shift(Dialect::kRapid, {{"d.sys", data}, {"p.mod", moves}});
  ASSERT_EQ(made.refusal, "");
  EXPECT_NE(made.program.files[0].text.find("[[0.123,124.765,400.346]"), std::string::npos);
  EXPECT_NE(made.program.files[0].text.find("[[0,1,1]"), std::string::npos);
  EXPECT_NE(made.program.files[1].text.find("[[0.123,199.765,200.346]"), std::string::npos);
}

TEST(Rapid, AToolThatIsNotTheCellsIsRefusedWithBothValues) {
  std::string text = program(target("p10", "0,125,400"), move_l("p10"));
  text.replace(text.find("[100,0,150]"), 11, "[100,0,153]");
  const std::string refusal = rapid(text).refusal;
  EXPECT_NE(refusal.find("100.000, 0.000, 153.000"), std::string::npos) << refusal;
  EXPECT_NE(refusal.find("100.000, 0.000, 150.000"), std::string::npos) << refusal;
  EXPECT_NE(refusal.find("3.000 mm and 0.0000 deg apart"), std::string::npos) << refusal;
  EXPECT_NE(refusal.find("m.mod row 2"), std::string::npos) << refusal;
  std::string heavy = program(target("p10", "0,125,400"), move_l("p10"));
  heavy.replace(heavy.find("[100,[0,0,100]"), 14, "[130,[0,0,100]");
  EXPECT_NE(rapid(heavy).refusal.find("30.000 kg"), std::string::npos) << rapid(heavy).refusal;
}

TEST(Rapid, JointTargetsAreCorrectedInJointsOrKept) {
  const std::string text =
      program("  CONST jointtarget j:=[[0,-20,20,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n",
              "    MoveAbsJ j\\NoEOffs,v100,fine,tSpindle;\n");
  EXPECT_NE(rapid(text).program.files[0].text.find(
                "[[0.01235,-19.98765,20.01235,0.01235,30.01235,0.01235]"),
            std::string::npos)
      << rapid(text).program.files[0].text;
  EXPECT_EQ(rapid(text, {.keep_joints = true}).program.files[0].text, text);
}

TEST(Rapid, AMarkedProgramIsNotCorrectedTwice) {
  const std::string text = program(target("p10", "0,125,400"), move_l("p10"));
  const test::Corrected twice = rapid(rapid(text).program.files[0].text);
  EXPECT_NE(twice.refusal.find("corrected already, by model 0123456789ab on 2026-11-22"),
            std::string::npos)
      << twice.refusal;
}

TEST(Rapid, WhatIsNoRapidIsLeftAsItIs) {
  for (const std::string& text : std::vector<std::string>{
           "", "\n", "MODULE", "MODULE M\nPROC main()\nMoveL ,,,;", "\"", "!", "[[[[", "MoveL p",
           "%%%", "CONST robtarget p:=p;\nMoveL p,v1,fine,t;", std::string(5000, '('),
           std::string(5000, '['), "IF IF IF MoveL",
           "PROC a()\na;\nENDPROC\nPROC b(robtarget p)\nb p;\nMoveL p,v,z,t;"}) {
    const test::Corrected made = rapid(text);
    if (made.refusal.empty())
      EXPECT_EQ(made.program.files.at(0).text, text);
    else
      EXPECT_NE(made.refusal.find("the file is not whole"), std::string::npos)
          << text.substr(0, 50) << made.refusal;
  }
}

const std::string kLoads =
    "  PERS loaddata lPart:=[40,[0,0,300],[1,0,0,0],0,0,0];\n  PERS loaddata "
    "lAll:=[100,[0,0,100],[1,0,0,0],0,0,0];\n";

TEST(Rapid, ALoadThatMotionsSetIsComparedWithTheCells) {
  const std::string points =
      kLoads + target("p10", "0,125,400") + target("p20", "0,135,400") + target("p30", "0,145,400");
  const test::Corrected all = rapid(program(points, "    GripLoad lPart;\n" + move_l("p10")));
  EXPECT_NE(all.refusal.find("load of tool tSpindle carrying lPart is 140.000 kg"),
            std::string::npos)
      << all.refusal;
  const test::Corrected total =
      rapid(program(points, move_l("p10", "\\WObj:=wPanel\\TLoad:=lPart")));
  EXPECT_NE(total.refusal.find("60.000 kg"), std::string::npos) << total.refusal;
  const test::Corrected same = rapid(program(points, move_l("p10", "\\WObj:=wPanel\\TLoad:=lAll")));
  EXPECT_TRUE(row_of(same.program, "p10").corrected()) << same.refusal;
  const test::Corrected some =
      rapid(program(points, move_l("p10") + "    GripLoad lPart;\n" + move_l("p20") +
                                "    GripLoad load0;\n" + move_l("p30")));
  EXPECT_TRUE(row_of(some.program, "p10").corrected()) << some.refusal << test::why(some, "p10");
  EXPECT_NE(test::why(some, "p20").find("carrying lPart"), std::string::npos)
      << test::why(some, "p20");
  EXPECT_TRUE(row_of(some.program, "p30").corrected());
}

TEST(Rapid, WhatALoopChangesAtItsEndHoldsAtItsHeadToo) {
  const std::string points = kLoads + target("p10", "0,125,400") + target("p20", "0,135,400");
  for (const auto& [head, end] : std::vector<std::pair<std::string, std::string>>{
           {"    WHILE TRUE DO\n", "    ENDWHILE\n"},
           {"    FOR i FROM 1 TO 2 DO\n", "    ENDFOR\n"},
           {"    again:\n", "    GOTO again;\n"},
           {"    again:\n", "    IF di1=1 GOTO again;\n"}}) {
    const test::Corrected load =
        rapid(program(points, move_l("p20") + head + move_l("p10") + "    GripLoad lPart;\n" + end +
                                  "    GripLoad load0;\n"));
    EXPECT_NE(test::why(load, "p10").find("a branch, a loop or a caller"), std::string::npos)
        << head << test::why(load, "p10");
    const test::Corrected shifted =
        rapid(program(points, head + move_l("p10") + "    PDispSet peX;\n    IF di2=1 PDispOff;\n" +
                                  end + "    PDispOff;\n"));
    EXPECT_NE(test::why(shifted, "p10").find("PDispSet displaces it"), std::string::npos)
        << head << test::why(shifted, "p10");
  }
}

const std::string kPart = "  PERS loaddata lPart:=[40,[0,0,100],[1,0,0,0],0,0,0];\n";

/// p1 behind GripLoad load0, in a program with these routines beside main.
test::Corrected beside(const std::string& routines, const std::string& rest_of_main = "",
                       const std::string& before = "") {
  return rapid("MODULE M\n" + kCamRapidTool + kPanel + kPart + target("p1", "0,0,300") +
               target("p2", "0,10,300") + "  PROC main()\n    GripLoad load0;\n" + before +
               move_l("p1") + rest_of_main + "  ENDPROC\n" + routines + "ENDMODULE\n");
}

TEST(Rapid, WhatATrapChangesMayHoldAnywhere) {
  const auto with = [](const std::string& lines) {
    return beside("  TRAP tStop\n" + lines + "  ENDTRAP\n");
  };
  EXPECT_NE(
      test::why(with("    GripLoad lPart;\n"), "p1").find("GripLoad: the TRAP tStop may change"),
      std::string::npos)
      << test::why(with("    GripLoad lPart;\n"), "p1");
  EXPECT_NE(test::why(with("    PDispSet dNow;\n"), "p1").find("PDispSet displaces it"),
            std::string::npos);
  for (const std::string& harmless :
       std::vector<std::string>{"", "    StopMove;\n    SetDO do1,1;\n    StartMove;\n",
                                "    GripLoad lPart;\n    GripLoad load0;\n"})
    EXPECT_TRUE(row_of(with(harmless).program, "p1").corrected())
        << harmless << test::why(with(harmless), "p1");
}

TEST(Rapid, AMotionInATrapHasTheLoadOfWhatItComesInto) {
  const std::string trap = "  TRAP tAway\n" + move_l("p2") + "  ENDTRAP\n";
  EXPECT_TRUE(row_of(beside(trap).program, "p2").corrected()) << test::why(beside(trap), "p2");
  const test::Corrected gripped = beside(trap, "    GripLoad lPart;\n" + move_l("p1"));
  EXPECT_FALSE(row_of(gripped.program, "p2").corrected());
}

TEST(Rapid, WhatAnErrorHandlerChangesHoldsWhereItGoesBack) {
  const auto with = [](const std::string& lines, const std::string& head = "  ERROR\n") {
    return beside("", head + lines);
  };
  for (const std::string& back : std::vector<std::string>{"RETRY", "TRYNEXT"}) {
    const test::Corrected made = with("    GripLoad lPart;\n    " + back + ";\n");
    EXPECT_NE(test::why(made, "p1").find("GripLoad: the handler 'error' of its routine may change"),
              std::string::npos)
        << back << test::why(made, "p1");
    EXPECT_TRUE(row_of(with("    SetDO do1,1;\n    " + back + ";\n").program, "p1").corrected());
  }
  const test::Corrected numbered =
      with("    GripLoad lPart;\n    RETRY;\n", "  ERROR (ERR_1, LONG_JMP_ERR)\n");
  EXPECT_FALSE(row_of(numbered.program, "p1").corrected());
  EXPECT_TRUE(row_of(with("    GripLoad lPart;\n    RAISE;\n").program, "p1").corrected())
      << "it does not come back";
  for (const std::string& kind : std::vector<std::string>{"  UNDO\n", "  BACKWARD\n"})
    EXPECT_TRUE(row_of(with("    GripLoad lPart;\n", kind).program, "p1").corrected()) << kind;
}

TEST(Rapid, WhatHoldsWhereARoutineFailsHoldsInTheHandlerOfItsCaller) {
  const auto with = [](const std::string& handler) {
    return beside(
        "  PROC part()\n    GripLoad lPart;\n    WaitDI di1,1;\n    GripLoad load0;\n  ENDPROC\n",
        "  ERROR\n" + handler, "    part;\n");
  };
  EXPECT_FALSE(row_of(with("    TRYNEXT;\n").program, "p1").corrected());
  EXPECT_TRUE(row_of(with("    RETURN;\n").program, "p1").corrected())
      << test::why(with("    RETURN;\n"), "p1");
}

TEST(Rapid, WhatIsMadeOfACorrectedTargetIsSaidToMoveWithIt) {
  const test::Corrected made = rapid(
      program(target("pA", "0,125,400") + "  VAR robtarget pX;\n  VAR num n;\n",
              move_l("pA") + "    pX:=pA;\n    pX.trans.z:=pX.trans.z+10;\n" + move_l("pX") +
                  "    n:=n+1;\n" + move_l("Offs(pA,0,0,n)") + "    TPWrite \"at\"\\Pos:=pA;\n"));
  EXPECT_TRUE(row_of(made.program, "pA").corrected());
  EXPECT_NE(test::why(made, "pX").find("pX is set at run time"), std::string::npos)
      << test::why(made, "pX");
  EXPECT_NE(test::why(made, "pX").find("it moves with pA, which is corrected"), std::string::npos)
      << test::why(made, "pX");
  EXPECT_NE(test::why(made, "Offs(pA,0,0,n)").find("it moves with pA"), std::string::npos)
      << test::why(made, "Offs(pA,0,0,n)");
  EXPECT_NE(
      fmt::format("{}", fmt::join(made.program.notes, "\n")).find("reads pA, which is corrected"),
      std::string::npos);
}

TEST(Rapid, ATargetWhoseNumbersAreReadElsewhereStaysUnlessItIsSplit) {
  for (const std::string& reading : std::vector<std::string>{
           "    h:=pA.trans.y;\n", "    IF pA.trans.x=0 Stop;\n",
           "    IF pA.trans.x=0 THEN\n    ENDIF\n", "    look pA.trans;\n", "    height pA;\n"}) {
    const std::string text = program(
        target("pA", "0,125,400") + "  VAR num h;\n",
        reading + move_l("pA") + "  ENDPROC\n  PROC height(robtarget p)\n    h:=p.trans.z;\n");
    const test::Corrected left = rapid(text);
    EXPECT_NE(test::why(left, "pA").find("its numbers are read elsewhere too (m.mod line"),
              std::string::npos)
        << reading << test::why(left, "pA");
    EXPECT_EQ(left.program.files[0].text, text);
    const test::Corrected split = rapid(text, {.split = true});
    EXPECT_TRUE(row_of(split.program, "pA").corrected()) << reading << test::why(split, "pA");
    EXPECT_NE(split.program.files[0].text.find("pA:=[[0,125,400]"), std::string::npos)
        << split.program.files[0].text;
  }
}

TEST(Rapid, AConfigurationThatContradictsItselfIsSaid) {
  std::string text = program(target("p10", "0,0,0"), move_l("p10"));
  text.replace(text.find("[0,0,0,0],[9E9"), 9, "[-1,-1,0,0]");
  const test::Corrected made = rapid(text);
  ASSERT_TRUE(row_of(made.program, "p10").corrected());
  EXPECT_NE(test::why(made, "p10").find("contradicts itself: branch 0 has joint 4 at"),
            std::string::npos)
      << test::why(made, "p10");
  ASSERT_EQ(made.program.notes.size(), 1u);
  text.replace(text.find("[-1,-1,0,0]"), 11, "[-1,-1,0,1]");
  const test::Corrected consistent = rapid(text);
  EXPECT_EQ(test::why(consistent, "p10"), "");
  EXPECT_TRUE(consistent.program.notes.empty());
}

TEST(Rapid, NamesAreSpelledAsTheProgramSpellsThemAndOptionalArgumentsAreFollowed) {
  const test::Corrected made = rapid(
      program(target("pUnUsed", "0,125,400") + target("pA", "0,125,400"),
              "    drill pA\\w:=wPanel;\n  ENDPROC\n  PROC drill(robtarget p\\PERS wobjdata w)\n"
              "    MoveL p,v100,fine,tSpindle\\WObj?w;\n"));
  EXPECT_EQ(made.program.left_alone(), 0u);
  ASSERT_EQ(made.program.notes.size(), 1u);
  EXPECT_NE(made.program.notes[0].find("no motion in these files goes to pUnUsed (m.mod line"),
            std::string::npos)
      << made.program.notes[0];
  EXPECT_TRUE(row_of(made.program, "pA").corrected()) << test::why(made, "pA");
}

TEST(Rapid, TheToolOfAMotionThatSetsASignalStandsBehindItsZone) {
  CorrectProgramOptions options;
  options.tool = "spindle";
  const test::Corrected made =
      rapid("MODULE M\n" + kPanel + target("p10", "0,125,400") + target("p20", "0,125,410") +
                "  PROC main()\n    MoveLDO p10,v100,fine,tHand\\WObj:=wPanel,doVacuum,1;\n"
                "    MoveCSync p10,p20,v100,fine,tHand\\WObj:=wPanel,\"proc\";\n"
                "  ENDPROC\nENDMODULE\n",
            {}, options);
  ASSERT_EQ(made.refusal, "");
  EXPECT_EQ(made.program.left_alone(), 0u) << test::why(made, "p10") << test::why(made, "p20");
  EXPECT_NE(made.program.notes.at(0).find("tool tHand is not in the files"), std::string::npos)
      << made.program.notes[0];
}

TEST(Rapid, WhereExternalAxesAreDisplacedTargetsThatHaveThemAreLeft) {
  const std::string on_axis = ",[0.707107,0,0.707107,0],[0,0,0,0],[100,9E9,9E9,9E9,9E9,9E9]]";
  const std::string data = target("p10", "0,125,400") + "  CONST robtarget p20:=[[0,125,410]" +
                           on_axis + ";\n  CONST robtarget p30:=[[0,125,420]" + on_axis + ";\n";
  for (const char* displace : {"EOffsSet eOffs", "EOffsOn\\ExeP:=p10,p20"}) {
    const test::Corrected made =
        rapid(program(data, move_l("p30") + "    " + displace + ";\n" + move_l("p10") +
                                move_l("p20") + "    EOffsOff;\n"));
    EXPECT_TRUE(row_of(made.program, "p10").corrected()) << test::why(made, "p10");
    EXPECT_NE(test::why(made, "p20").find("displaces its external axes (m.mod line"),
              std::string::npos)
        << test::why(made, "p20");
    EXPECT_TRUE(row_of(made.program, "p30").corrected()) << test::why(made, "p30");
  }
}

/// deg, of the target of that name.
std::vector<double> joints_of(const test::Corrected& made, const std::string& name) {
  return row_of(made.program, name).joints;
}

TEST(Rapid, WithConfLOffALineStaysInThePostureOfTheJointsBeforeIt) {
  // Both bring the tool to where p10 is; its configuration is a placeholder.
  const std::string data =
      "  CONST jointtarget jFlip:=[[4,-10,20,178,-60,-176],[9E9,9E9,9E9,9E9,9E9,9E9]];\n" +
      target("p10", "0,125,400") + target("p20", "0,125,410");
  const auto with = [&](const std::string& confs) {
    return rapid(program(
        data, confs + "    MoveAbsJ jFlip,v500,fine,tSpindle;\n" + move_l("p10") + move_l("p20")));
  };
  const test::Corrected on = with("");
  const test::Corrected off = with("    ConfJ\\Off;\n    ConfL\\Off;\n");
  ASSERT_EQ(off.program.left_alone(), 0u) << test::why(off, "p10");
  EXPECT_GT(joints_of(on, "p10").at(4), 0);
  EXPECT_LT(joints_of(off, "p10").at(4), 0);
  EXPECT_LT(joints_of(off, "p20").at(4), 0);
  EXPECT_TRUE(off.program.notes.empty());
}

TEST(Rapid, WithConfLOffAndNoJointsBeforeANoteSaysThatTheConfigurationIsTaken) {
  const test::Corrected made = rapid(program(
      target("p10", "0,125,400"), "    ConfL\\Off;\n" + move_l("p10") + "    ConfL\\On;\n"));
  EXPECT_TRUE(row_of(made.program, "p10").corrected());
  ASSERT_EQ(made.program.notes.size(), 1u);
  EXPECT_NE(made.program.notes[0].find("p10 (m.mod line"), std::string::npos)
      << made.program.notes[0];
}

TEST(Rapid, MotionsOfAToolThatTheModelHasNotLearnedWithAreLeft) {
  const std::string other =
      "  PERS tooldata tGripper:=[TRUE,[[0,0,350],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n";
  cam::CellTools cell = test::spindle_only();
  cell.tools["gripper"] = make_pose(Matrix3::Identity(), {0, 0, .35});
  cell.check_known = [](const std::string& tool, const std::string&) -> Status {
    if (tool == "gripper") return refused("not trained with gripper");
    return {};
  };
  const std::string text =
      program(other + target("p10", "0,125,400") + target("p20", "0,125,410"),
              move_l("p10") + "    MoveL p20,v100,fine,tGripper\\WObj:=wPanel;\n");
  const test::Corrected made = corrected_by_shift(Dialect::kRapid, {{"m.mod", text}}, {}, {}, cell);
  EXPECT_TRUE(row_of(made.program, "p10").corrected()) << made.refusal << test::why(made, "p10");
  EXPECT_NE(test::why(made, "p20").find("not trained with gripper"), std::string::npos)
      << test::why(made, "p20");
}

/// A program as planning software posts it: what a tool and a work object are is assigned before
/// the motions.
std::string posted(const std::string& motions) {
  return "MODULE M\n  LOCAL PERS tooldata "
         "tOlp:=[TRUE,[[0,0,0],[1,0,0,0]],[100,[0,0,100],[1,0,0,0],0,0,0]];\n"
         "  LOCAL PERS wobjdata "
         "wOlp:=[FALSE,TRUE,\"\",[[0,0,0],[1,0,0,0]],[[300,-250,300],[1,0,0,0]]];\n" +
         target("p10", "0,125,400") + target("p20", "0,125,410") + "  PROC main()\n" + motions +
         "  ENDPROC\nENDMODULE\n";
}
const std::string kSetTool = "    tOlp.tframe:=[[100,0,150],[0.923879533,0,-0.382683432,0]];\n";
std::string to(const std::string& point) {
  return "    MoveL " + point + ",v100,fine,tOlp\\WObj:=wOlp;\n";
}

TEST(Rapid, ConstantsThatAreAssignedToToolsAndWorkObjectsHoldUntilTheNext) {
  const test::Corrected made = rapid(
      posted(kSetTool +
             "    wOlp.uframe:=[[1400,0,500],[1,0,0,0]];\n    wOlp.uframe.trans:=[1500,0,500];\n" +
             to("p10") + "    wOlp.uframe:=[[1490,0,500],[1,0,0,0]];\n" + to("p20")));
  ASSERT_EQ(made.refusal, "");
  EXPECT_EQ(made.program.left_alone(), 0u) << test::why(made, "p10");
  EXPECT_LT((row_of(made.program, "p10").p_B - Vector3(1.8, -.125, 1.2)).norm(), 1e-12);
  EXPECT_LT((row_of(made.program, "p20").p_B - Vector3(1.79, -.125, 1.21)).norm(), 1e-12);
}

TEST(Rapid, AnAssignmentThatABranchDecidesOrThatIsNotConstantLeavesItsMotions) {
  const std::string frame = "    wOlp.uframe:=[[1500,0,500],[1,0,0,0]];\n";
  const test::Corrected branch = rapid(posted(
      kSetTool + frame + to("p10") +
      "    IF di1=1 THEN\n      wOlp.uframe:=[[1490,0,500],[1,0,0,0]];\n    ENDIF\n" + to("p20")));
  EXPECT_TRUE(row_of(branch.program, "p10").corrected())
      << branch.refusal << test::why(branch, "p10");
  EXPECT_NE(test::why(branch, "p20").find("wOlp is set at run time"), std::string::npos)
      << test::why(branch, "p20");
  const test::Corrected number =
      rapid(posted(kSetTool + frame + "    wOlp.uframe.trans.x:=reg1;\n" + to("p10")));
  EXPECT_FALSE(row_of(number.program, "p10").corrected());
  const test::Corrected function =
      rapid(posted(kSetTool + frame + "    ok:=set();\n" + to("p10") +
                   "  ENDPROC\n  FUNC bool set()\n    wOlp.uframe:=[[1490,0,500],[1,0,0,0]];\n    "
                   "RETURN TRUE;\n  ENDFUNC\n"
                   "  PROC other()\n"));
  EXPECT_FALSE(row_of(function.program, "p10").corrected())
      << "the function comes in before the motion";
  const test::Corrected before = rapid(posted(kSetTool + to("p10") + frame + to("p20")));
  EXPECT_FALSE(row_of(before.program, "p10").corrected())
      << "the end of main comes before its head, too";
  EXPECT_TRUE(row_of(before.program, "p20").corrected()) << test::why(before, "p20");
}

TEST(Rapid, APointThatADisplacementIsMeasuredFromStaysUnlessItIsSplit) {
  const std::string points = target("pRef", "0,125,400") + target("pNow", "0,125,420") +
                             target("pNext", "0,225,400") +
                             "  VAR robtarget pCopy;\n  VAR pose shift;\n";
  const std::string moves = move_l("pRef") + move_l("pNow");
  const std::string last = move_l("pNext") + "    PDispOff;\n";
  for (const std::string& displaced :
       {"    PDispOn\\Rot\\ExeP:=pNow,pRef,tSpindle\\WObj:=wPanel;\n" + last,
        "    pCopy:=pRef;\n    PDispOn pCopy,tSpindle\\WObj:=wPanel;\n" + last,
        "    shift:=DefDFrame(pRef,pRef,pRef,pNow,pNow,pNow);\n    PDispSet shift;\n" + last}) {
    const std::string text = program(points, moves + displaced);
    const test::Corrected left = rapid(text);
    EXPECT_NE(test::why(left, "pRef").find("a displacement is measured from it"), std::string::npos)
        << test::why(left, "pRef");
    EXPECT_TRUE(row_of(left.program, "pNow").corrected()) << test::why(left, "pNow");
    EXPECT_FALSE(row_of(left.program, "pNext").corrected());
    const test::Corrected split = rapid(text, {.split = true});
    EXPECT_TRUE(row_of(split.program, "pRef").corrected()) << test::why(split, "pRef");
    EXPECT_NE(split.program.files[0].text.find(target("pRef", "0,125,400")), std::string::npos);
  }
  const test::Corrected array = rapid(
      program("  CONST robtarget p{2}:=[[[0,125,400]" + kRest + ",[[0,225,400]" + kRest + "];\n",
              move_l("p{1}") + move_l("p{2}") + "    PDispOn p{1},tSpindle;\n    PDispOff;\n"));
  EXPECT_NE(test::why(array, "p{1}").find("a displacement is measured from it"), std::string::npos)
      << test::why(array, "p{1}");
  EXPECT_TRUE(row_of(array.program, "p{2}").corrected()) << test::why(array, "p{2}");
}

TEST(Rapid, AModuleThatIsNotWholeIsRefusedWithTheBlockThatHasNoEnd) {
  const std::string data =
      "MODULE M\n" + kCamRapidTool + kPanel + target("p10", "0,0,400") + "  PROC main()\n";
  const std::string move = move_l("p10");
  const std::vector<std::pair<std::string, std::string>> cases = {
      {data + move, "PROC main has no ENDPROC"},
      {data + move + "    MoveL p10,v100,fi", "PROC main has no ENDPROC"},
      {data + move + "  ENDPROC\n", "MODULE M has no ENDMODULE"},
      {data + move + "ENDMODULE\n", "PROC main has no ENDPROC"},
      {data + move + "  PROC other()\n  ENDPROC\nENDMODULE\n", "PROC main has no ENDPROC"},
      {data + "    IF di1=1 THEN\n" + move + "  ENDPROC\nENDMODULE\n", "IF has no ENDIF"},
      {data + "    FOR i FROM 1 TO 3 DO\n" + move + "    ENDWHILE\n  ENDPROC\nENDMODULE\n",
       "ENDWHILE has no WHILE"}};
  for (const auto& [text, clause] : cases) {
    const std::string refusal = rapid(text).refusal;
    EXPECT_NE(refusal.find(clause + ": the file is not whole"), std::string::npos)
        << clause << ": " << refusal;
  }
  const std::string whole =
      "    IF di1=1 THEN\n      IF di2=1 WaitTime 1;\n    ELSEIF di2=1 THEN\n    ELSE\n    ENDIF\n"
      "    TEST n\n    CASE 1,2:\n      WHILE TRUE DO\n      ENDWHILE\n    DEFAULT:\n    ENDTEST\n";
  EXPECT_EQ(rapid(data + whole + move +
                  "  ERROR\n    RETRY;\n  ENDPROC\n  LOCAL FUNC num f(num n)\n    RETURN n;\n"
                  "  ENDFUNC\n  TRAP t\n  ENDTRAP\nENDMODULE\n")
                .refusal,
            "");
}

TEST(Rapid, APointThatOnlyAnUnknownInstructionIsGivenIsLeftAndNotCalledUnused) {
  const test::Corrected made =
      rapid(program(target("p10", "0,0,400") + target("p20", "0,10,400"),
                    move_l("p10") + "    FCPressL p20,v50,100,fine,tSpindle;\n"));
  EXPECT_NE(test::why(made, "p20").find("FCPressL is not known here: it may move the robot there"),
            std::string::npos)
      << test::why(made, "p20");
  EXPECT_TRUE(row_of(made.program, "p10").corrected());
  const test::Corrected read =
      rapid(program(target("p10", "0,0,400") + target("p20", "0,10,400"),
                    move_l("p10") + "    TPWrite \"x\"\\Pos:=p20.trans;\n"));
  EXPECT_EQ(read.program.left_alone(), 0u) << "a point that is shown only is unused";
}

TEST(Rapid, ANameThatAFileDeclaresTwiceIsLeft) {
  const std::string first = program(target("p10", "0,0,400"), move_l("p10"));
  const test::Corrected made = rapid(first + "MODULE N\n" + target("p10", "0,50,400") +
                                     "  PROC other()\n" + move_l("p10") + "  ENDPROC\nENDMODULE\n");
  EXPECT_NE(test::why(made, "p10").find("p10 is declared twice (m.mod line"), std::string::npos)
      << test::why(made, "p10");
}

TEST(Rapid, AMotionThatASensorCorrectsIsLeft) {
  const test::Corrected made =
      rapid(program(target("p10", "0,0,400"), move_l("p10", "\\WObj:=wPanel\\Corr")));
  EXPECT_NE(test::why(made, "p10").find("a sensor corrects the path"), std::string::npos)
      << test::why(made, "p10");
}

TEST(Rapid, WhatAnotherTaskSetsOfASharedPersistentIsSetAtRunTime) {
  const std::string background = "MODULE Bg\n" + kPanel +
                                 "  PROC main()\n    wPanel.oframe.trans.x:=nCam;\n  ENDPROC\n"
                                 "ENDMODULE\n";
  const std::string text = program(target("p10", "0,0,400"), move_l("p10"));
  for (const auto& [task, shared] : {std::pair("TASK2", true), std::pair("TASK1", false)}) {
    const test::Corrected made = corrected_by_shift(
        Dialect::kRapid, {{"RAPID/TASK1/PROGMOD/m.mod", text},
                          {std::string("RAPID/") + task + "/PROGMOD/b.mod", background}});
    EXPECT_EQ(row_of(made.program, "p10").corrected(), !shared)
        << task << made.refusal << test::why(made, "p10");
    EXPECT_EQ(test::why(made, "p10").find("wPanel is set at run time") != std::string::npos, shared)
        << test::why(made, "p10");
  }
}

TEST(Rapid, AProcedureThatIsMerelyCalledLikeAMotionIsNotTakenForOne) {
  const test::Corrected made = rapid(
      program(target("p10", "0,0,400"), "    MoveLOffset p10,v100,fine,tSpindle\\WObj:=wPanel;\n"));
  EXPECT_NE(test::why(made, "p10").find("MoveLOffset is not known here"), std::string::npos)
      << test::why(made, "p10");
}

}  // namespace
}  // namespace trammel::cam
