#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "tests/support/shifting_model.h"

namespace trammel::cam {
namespace {

using test::corrected_by_shift;
using test::row_of;

// The tool of the shipped cell: turned by -45 deg about y.
const std::string kConfig =
    "DEFDAT $CONFIG\r\nDECL FRAME TOOL_DATA[16]\r\nTOOL_DATA[1]={X 100.0,Y 0.0,Z 150.0,A 0.0,B "
    "-45.0,C 0.0}\r\n"
    "BASE_DATA[2]={X 1500.0,Y 0.0,Z 500.0,A 0.0,B 0.0,C 0.0}\r\n"
    "LOAD_DATA[1]={M 100.0,CM {X 0.0,Y 0.0,Z 100.0,A 0.0,B 0.0,C 0.0},J {X 0.0,Y 0.0,Z "
    "0.0}}\r\nENDDAT\r\n";
const std::string kSet = "$TOOL=TOOL_DATA[1]\n$BASE=BASE_DATA[2]\n";

test::Corrected krl(const std::string& src, const std::string& dat = "",
                    const ReadOptions& read = {}) {
  std::vector<SourceFile> files = {{"p.src", src}, {"$config.dat", kConfig}};
  if (!dat.empty()) files.push_back({"p.dat", dat});
  return corrected_by_shift(Dialect::kKrl, files, read);
}
std::string program(const std::string& lines) {
  return "&ACCESS RVP\nDEF p( )\nINI\n" + kSet + lines + "END\n";
}
TEST(Krl, PositionsOfTheDataListAreCorrectedWhereTheyStand) {
  const std::string dat =
      "DEFDAT p PUBLIC\r\n; Bohrung gr\xFC"
      "n: XP9={X 1,Y 2}\r\n"
      "DECL E6POS XP1={X 300.0,Y\t-250.00,Z 300,A 0.0,B 60.0,C 0.0,S 2,T 2,E1 0.0,E2 0.0}\r\n"
      "DECL FDAT FP1={TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE,POINT2[] \" \",TQ_STATE "
      "FALSE}\r\nENDDAT\r\n";
  const std::string src =
      "DEF p( )\n;FOLD PTP P1 Vel=100 % PDAT1 Tool[1]:spindle Base[2]:panel;%{PE}%R "
      "8.3,%MKUKATPBASIS\nFDAT_ACT=FP1\n"
      "PTP XP1\n;ENDFOLD\n;LIN XP1\nEND\n";
  const test::Corrected made = krl(src, dat);
  ASSERT_EQ(made.refusal, "");
  EXPECT_EQ(made.program.left_alone(), 0u);
  EXPECT_EQ(made.program.files[0].text, src);
  EXPECT_EQ(test::without_numbers(test::without_inserted(made.program, 2)),
            test::without_numbers(dat));
  EXPECT_NE(made.program.files[2].text.find(
                "{X 300.123,Y\t-250.235,Z 300.346,A 0.0000,B 60.0000,C 0.0000,S 2,T 2,"),
            std::string::npos)
      << made.program.files[2].text;
}

TEST(Krl, FramesInMotionsSplinesAxesAndAssignmentsAreFound) {
  const test::Corrected made =
      krl(program("PTP {A1 0,A2 -20,A3 20,A4 0,A5 30,A6 0}\n"
                  "LIN {X 300,Y 0,Z 500,A 0,B 60,C 0} C_DIS\n"
                  "P1={X 300,Y 10,Z 500,A 0,B 60,C 0}\nLIN P1 C_VEL\n"
                  "CIRC {X 300,Y 20,Z 510,A 0,B 60,C 0},{X 300,Y 40,Z 500,A 0,B 60,C 0},CA 180\n"
                  "SPLINE\nSPL {X 300,Y 50,Z 500,A 0,B 60,C 0}\nSLIN {E6POS: X 300,Y 60,Z 500,A "
                  "0,B 60,C 0} WITH $VEL.CP=0.1\nENDSPLINE\n"
                  "SPTP {X 300,Y 70,Z 500,A 0,B 60,C 0,S 'B010',T 'B000010'}\n"));
  for (const ReceiptRow& row : made.program.rows)
    EXPECT_TRUE(row.corrected()) << row.name << ": " << row.message;
  EXPECT_EQ(made.program.rows.size(), 8u);
  EXPECT_EQ(made.program.moves_corrected, 7u);
}

TEST(Krl, ConstantFramesOfTheGeometricOperatorAreFolded) {
  const test::Corrected made = krl(
      program("P1={X 300,Y 10,Z 500,A 0,B 90,C 0}\nLIN P1:{X 5,Y 0,Z -50,A 0,B 0,C 0}\nLIN P1\n"));
  const ReceiptRow row = row_of(made.program, "P1:{X 5,Y 0,Z -50,A 0,B 0,C 0}");
  ASSERT_TRUE(row.corrected()) << row.message;
  EXPECT_NEAR(row.after[0], 250.123, 1e-3);
  EXPECT_NEAR(row.after[1], 9.765, 1e-3);
  EXPECT_NEAR(row.after[2], 495.346, 1e-3);
  EXPECT_NE(made.program.files[0].text.find(
                "; trammel: was P1:{X 5,Y 0,Z -50,A 0,B 0,C 0}\nLIN {X 250.123,Y 9.765,"),
            std::string::npos)
      << made.program.files[0].text;
}

TEST(Krl, WhatIsDecidedAtRunTimeIsLeftWithTheReason) {
  const test::Corrected made =
      krl(program("P1={X 300,Y 10,Z 500,A 0,B 60,C 0}\nLIN P1\nP1.X=P1.X+5\nP2={X 300,Y 10,Z H,A "
                  "0,B 60,C 0}\nLIN P2\n"
                  "LIN_REL {X 10}\nLIN {Z 400}\nLIN $POS_ACT\nPTP XELSEWHERE\nLIN P1:{X DX,Y 0,Z "
                  "0,A 0,B 0,C 0}\n"
                  "BAS(#BASE,n)\nLIN {X 301,Y 0,Z 500,A 0,B 60,C 0}\n"));
  EXPECT_NE(test::why(made, "P1").find("P1 is set at run time (p.src line"), std::string::npos)
      << test::why(made, "P1");
  EXPECT_NE(test::why(made, "P2").find("Z is not a constant number"), std::string::npos);
  EXPECT_NE(test::why(made, "{X 10}").find("relative"), std::string::npos);
  EXPECT_NE(test::why(made, "{Z 400}").find("does not say X"), std::string::npos);
  EXPECT_NE(test::why(made, "$POS_ACT").find("decides it"), std::string::npos);
  EXPECT_NE(test::why(made, "XELSEWHERE").find("not in the files"), std::string::npos);
  EXPECT_NE(test::why(made, "{X 301,Y 0,Z 500,A 0,B 60,C 0}").find("N chooses it"),
            std::string::npos);
  EXPECT_EQ(made.program.moves_corrected, 0u);
}

TEST(Krl, ToolAndBaseAreFollowedThroughCallsAndBranches) {
  const test::Corrected made = krl(
      program(
          "up( )\nIF $IN[1] THEN\n$BASE=$NULLFRAME\nENDIF\nLIN {X 302,Y 0,Z 500,A 0,B 60,C 0}\n") +
      "DEF up( )\nLIN {X 300,Y 0,Z 500,A 0,B 60,C 0}\nEND\n");
  EXPECT_TRUE(row_of(made.program, "{X 300,Y 0,Z 500,A 0,B 60,C 0}").corrected());
  EXPECT_NE(test::why(made, "{X 302,Y 0,Z 500,A 0,B 60,C 0}").find("branch"), std::string::npos);
}

TEST(Krl, WithoutAToolOrABaseNothingIsGuessed) {
  const test::Corrected made = krl("DEF p()\nLIN {X 300,Y 0,Z 500,A 0,B 60,C 0}\nEND\n");
  EXPECT_NE(made.program.rows[0].message.find("no $TOOL is set"), std::string::npos);
  const test::Corrected other = krl(
      "DEF p()\n$TOOL=TOOL_DATA[1]\n$BASE=BASE_DATA[7]\nLIN {X 300,Y 0,Z 500,A 0,B 60,C 0}\nEND\n");
  EXPECT_NE(other.program.rows[0].message.find("BASE_DATA[7] is not in the files"),
            std::string::npos);
}

TEST(Krl, AToolThatIsNotTheCellsIsRefusedWithBothValues) {
  const test::Corrected made =
      krl("DEF p()\n$TOOL={X 100,Y 0,Z 152.5,A 0,B -45,C 0}\n$BASE=$NULLFRAME\n"
          "LIN {X 1800,Y 0,Z 1000,A 0,B 60,C 0}\nEND\n");
  EXPECT_NE(made.refusal.find("2.500 mm and 0.0000 deg apart"), std::string::npos) << made.refusal;
}

TEST(Krl, WhatIsNoKrlIsLeftAsItIs) {
  for (const std::string& text : std::vector<std::string>{"",
                                                          "\n",
                                                          "DEF",
                                                          "LIN",
                                                          "LIN {",
                                                          "LIN {X",
                                                          "LIN {X 1,{{{{{{{{{{{{{{",
                                                          "\"",
                                                          "'",
                                                          "DEF a()\na()\nEND",
                                                          "P1=P1\nLIN P1",
                                                          "LIN P1:",
                                                          "PTP XP[",
                                                          "$TOOL=",
                                                          "BAS(#TOOL,",
                                                          "FDAT_ACT=",
                                                          "ELSE\nENDIF\nENDIF",
                                                          ";FOLD Tool[",
                                                          "GLOBAL",
                                                          "DECL",
                                                          "DECL E6POS",
                                                          std::string(5000, '{')}) {
    const test::Corrected made = corrected_by_shift(Dialect::kKrl, {{"p.src", text}});
    EXPECT_EQ(made.program.files[0].text, text);
  }
}

const std::string kPoint = "{X 300,Y 0,Z 500,A 0,B 60,C 0}";

TEST(Krl, WhatALoopChangesAtItsEndHoldsAtItsHeadToo) {
  const std::vector<std::pair<std::string, std::string>> loops = {
      {"LOOP\n", "ENDLOOP\n"},        {"WHILE $IN[1]\n", "ENDWHILE\n"},
      {"FOR I=1 TO 2\n", "ENDFOR\n"}, {"REPEAT\n", "UNTIL $IN[1]\n"},
      {"M1:\n", "GOTO M1\n"},         {"M1:\n", "IF $IN[1] THEN\nGOTO M1\nENDIF\n"}};
  for (const auto& [head, end] : loops) {
    const test::Corrected frame =
        krl(program(head + "LIN " + kPoint + "\n$BASE=$NULLFRAME\n" + end));
    EXPECT_NE(test::why(frame, kPoint).find("$BASE: a branch or a loop"), std::string::npos)
        << head << test::why(frame, kPoint);
    const test::Corrected tool =
        krl(program(head + "LIN " + kPoint + "\n$TOOL=$NULLFRAME\n" + end));
    EXPECT_NE(test::why(tool, kPoint).find("$TOOL: a branch or a loop"), std::string::npos)
        << head << test::why(tool, kPoint);
    const test::Corrected called = krl(program(head + "LIN " + kPoint + "\nnull( )\n" + end) +
                                       "DEF null( )\n$BASE=$NULLFRAME\nEND\n");
    EXPECT_FALSE(row_of(called.program, kPoint).corrected()) << head;
  }
}

TEST(Krl, ALoopThatSetsWhatItNeedsIsCorrected) {
  const test::Corrected made =
      krl(program("LOOP\n" + kSet + "LIN " + kPoint + "\n$BASE=$NULLFRAME\nIF $IN[1] THEN\nEXIT\n" +
                  "ENDIF\nENDLOOP\n"));
  EXPECT_TRUE(row_of(made.program, kPoint).corrected()) << test::why(made, kPoint);
}

const std::string kMore = "{X 310,Y 0,Z 500,A 0,B 60,C 0}";

TEST(Krl, WhatAnInterruptRoutineSetsHoldsAnywhereBehindItsDeclaration) {
  const auto with = [](const std::string& handler) {
    return krl(program("LIN " + kMore +
                       "\nINTERRUPT DECL 3 WHEN $IN[1]==TRUE DO stopped( )\nINTERRUPT ON 3\nLIN " +
                       kPoint + "\n") +
               "DEF stopped( )\n" + handler + "END\n");
  };
  for (const char* set :
       {"$BASE=$NULLFRAME\n", "BAS(#BASE,0)\n", "null( )\nEND\nDEF null( )\n$BASE=$NULLFRAME\n"}) {
    const test::Corrected made = with(set);
    EXPECT_TRUE(row_of(made.program, kMore).corrected()) << test::why(made, kMore);
    EXPECT_NE(test::why(made, kPoint).find("$BASE: the interrupt routine STOPPED may change it"),
              std::string::npos)
        << set << test::why(made, kPoint);
  }
  for (const char* harmless :
       {"$OUT[1]=TRUE\n", "$BASE=$NULLFRAME\n$BASE=BASE_DATA[2]\n", "BRAKE F\nRESUME\n"})
    EXPECT_TRUE(row_of(with(harmless).program, kPoint).corrected())
        << harmless << test::why(with(harmless), kPoint);
}

TEST(Krl, AMotionOfAnInterruptRoutineHasTheToolAndBaseOfWhatItComesInto) {
  const std::string declared = "INTERRUPT DECL 3 WHEN $IN[1]==TRUE DO away( )\nLIN " + kMore + "\n";
  const std::string away = "DEF away( )\nLIN " + kPoint + "\nEND\n";
  const test::Corrected one = krl(program(declared) + away);
  EXPECT_TRUE(row_of(one.program, kPoint).corrected()) << test::why(one, kPoint);
  const test::Corrected two = krl(program(declared + "$BASE=$NULLFRAME\n") + away);
  EXPECT_NE(test::why(two, kPoint).find("used in different ways"), std::string::npos)
      << test::why(two, kPoint);
}

TEST(Krl, ResumeEndsWhatWasInterruptedWhereverItWas) {
  const auto with = [](const std::string& last) {
    return krl(program("INTERRUPT DECL 3 WHEN $IN[1]==TRUE DO stopped( )\nsearching( )\nLIN " +
                       kPoint + "\n") +
               "DEF searching( )\n$BASE=$NULLFRAME\nLIN {X 1800,Y 0,Z 1000,A 0,B 60,C "
               "0}\n$BASE=BASE_DATA[2]\nEND\n" +
               "DEF stopped( )\nBRAKE\n" + last + "END\n");
  };
  EXPECT_TRUE(row_of(with("").program, kPoint).corrected()) << test::why(with(""), kPoint);
  EXPECT_FALSE(row_of(with("RESUME\n").program, kPoint).corrected());
}

TEST(Krl, WhatATriggerOrAnotherFileSetsIsNoConstant) {
  const std::string dat =
      "DEFDAT p\nDECL GLOBAL E6POS XP1={X 300,Y 0,Z 500,A 0,B 60,C 0,S 2,T 2}\nENDDAT\n";
  const test::Corrected trigger =
      krl(program("TRIGGER WHEN DISTANCE=0 DELAY=0 DO XP1.X=305\nLIN XP1\n"), dat);
  EXPECT_NE(test::why(trigger, "XP1").find("XP1 is set at run time (p.src line"), std::string::npos)
      << test::why(trigger, "XP1");
  const auto beside = [&](const std::string& line) {
    return corrected_by_shift(Dialect::kKrl,
                              {{"p.src", program("LIN XP1\nBAS(#BASE,2)\nLIN " + kPoint + "\n")},
                               {"p.dat", dat},
                               {"$config.dat", kConfig},
                               {"q.src", "DEF q( )\n" + line + "\nEND\n"}});
  };
  EXPECT_TRUE(row_of(beside("").program, "XP1").corrected());
  EXPECT_NE(test::why(beside("XP1.Z=400"), "XP1").find("(q.src line 2)"), std::string::npos)
      << test::why(beside("XP1.Z=400"), "XP1");
  const test::Corrected base = beside("BASE_DATA[2]={X 1501,Y 0,Z 500,A 0,B 0,C 0}");
  EXPECT_NE(test::why(base, kPoint).find("BASE_DATA[2] is set at run time (q.src line 2)"),
            std::string::npos)
      << test::why(base, kPoint);
  EXPECT_TRUE(
      row_of(beside("BASE_DATA[2]={X 1500,Y 0,Z 500,A 0,B 0,C 0}").program, kPoint).corrected());
}

TEST(Krl, AFunctionInAnExpressionSetsWhatItSets) {
  const test::Corrected made = krl(program("H=null(1)\nLIN " + kPoint + "\n") +
                                   "DEFFCT INT null(n:IN)\n$BASE=$NULLFRAME\nRETURN 1\nENDFCT\n");
  ASSERT_TRUE(row_of(made.program, kPoint).frame == "$NULLFRAME" ||
              !row_of(made.program, kPoint).corrected())
      << row_of(made.program, kPoint).frame;
}

TEST(Krl, ALoadThatMotionsSetIsComparedWithTheCells) {
  const test::Corrected all = krl(program(
      "$LOAD={M 40.0,CM {X 0,Y 0,Z 100,A 0,B 0,C 0},J {X 0,Y 0,Z 0}}\nLIN " + kPoint + "\n"));
  EXPECT_NE(all.refusal.find("40.000 kg"), std::string::npos) << all.refusal;
  EXPECT_NE(all.refusal.find("60.000 kg and 0.0 mm apart"), std::string::npos) << all.refusal;
  const test::Corrected some = krl(
      program("LIN " + kPoint +
              "\n$LOAD={M 40.0,CM {X 0,Y 0,Z 100,A 0,B 0,C 0},J {X 0,Y 0,Z 0}}\n"
              "LIN {X 301,Y 0,Z 500,A 0,B 60,C 0}\n$LOAD.M=W\nLIN {X 302,Y 0,Z 500,A 0,B 60,C 0}\n"
              "$LOAD=LOAD_DATA[1]\nLIN {X 303,Y 0,Z 500,A 0,B 60,C 0}\n"));
  EXPECT_TRUE(row_of(some.program, kPoint).corrected()) << test::why(some, kPoint);
  EXPECT_NE(test::why(some, "{X 301,Y 0,Z 500,A 0,B 60,C 0}").find("60.000 kg"), std::string::npos);
  EXPECT_NE(test::why(some, "{X 302,Y 0,Z 500,A 0,B 60,C 0}").find("a part of $LOAD"),
            std::string::npos);
  EXPECT_TRUE(row_of(some.program, "{X 303,Y 0,Z 500,A 0,B 60,C 0}").corrected());
}

TEST(Krl, WhatIsMadeOfACorrectedTargetIsSaidToMoveWithIt) {
  const std::string dat =
      "DEFDAT p\nDECL E6POS XP1={X 300,Y 0,Z 500,A 0,B 60,C 0,S 2,T 2}\n"
      "DECL E6POS XP2={X 310,Y 0,Z 500,A 0,B 60,C 0,S 2,T 2}\nDECL E6POS Xq={X 1,Y 0,Z 0,A 0,B 0,C "
      "0,S 0,T 0}\n"
      "ENDDAT\n";
  const test::Corrected made =
      krl(program("DECL E6POS XX\nXX=XP1\nXX.Z=XX.Z+50\nLIN XX\nLIN XP1\nH=XP2.Z\nLIN XP2\nLIN "
                  "XP1:{X DX,Y 0,Z 0,A 0,B 0,C 0}\n"),
          dat);
  EXPECT_TRUE(row_of(made.program, "XP1").corrected());
  EXPECT_NE(test::why(made, "XX").find("it moves with XP1, which is corrected"), std::string::npos)
      << test::why(made, "XX");
  EXPECT_NE(test::why(made, "XP1:{X DX,Y 0,Z 0,A 0,B 0,C 0}").find("it moves with XP1"),
            std::string::npos);
  EXPECT_NE(test::why(made, "XP2").find("its numbers are read elsewhere too"), std::string::npos)
      << test::why(made, "XP2");
  EXPECT_NE(fmt::format("{}", fmt::join(made.program.notes, "\n"))
                .find("no motion in these files goes to Xq ("),
            std::string::npos);
}

TEST(Krl, AnArcIsCorrectedWithBothPointsOrWithNone) {
  const std::string dat =
      "DEFDAT p\nDECL E6POS XP1={X 300,Y 0,Z 500,A 0,B 60,C 0,S 2,T 2}\nENDDAT\n";
  const test::Corrected made = krl(program("CIRC {X 300,Y 20,Z 510},XP1\n"), dat);
  EXPECT_FALSE(row_of(made.program, "{X 300,Y 20,Z 510}").corrected());
  EXPECT_NE(test::why(made, "XP1").find("the other point of its arc (p.src line"),
            std::string::npos)
      << test::why(made, "XP1");
  EXPECT_EQ(made.program.moves_corrected, 0u);
}

const std::string kFdat =
    "DEFDAT p\nDECL E6POS XP1={X 300,Y 0,Z 500,A 0,B 60,C 0,S 2,T 2}\n"
    "DECL FDAT FP1={TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE,POINT2[] \" \",TQ_STATE FALSE}\n"
    "DECL FDAT FTCP={TOOL_NO 1,BASE_NO 2,IPO_FRAME #TCP,POINT2[] \" \",TQ_STATE FALSE}\nENDDAT\n";

TEST(Krl, ToolAndBaseOfAnFdatStayWhereItsOtherPartsAreSet) {
  const auto with = [](const std::string& lines) {
    return krl(program("$BASE=$NULLFRAME\n" + lines + "SPLINE WITH $BASE=SBASE(FP1.BASE_NO)\nSPL " +
                       kPoint + "\nENDSPLINE\n"),
               kFdat);
  };
  const test::Corrected other = with("FP1.TQ_STATE=TRUE\nFP1.POINT2[]=\"XP1\"\n");
  ASSERT_EQ(other.refusal, "");
  EXPECT_NEAR(row_of(other.program, kPoint).p_B.x(), 1.8, 1e-9) << test::why(other, kPoint);
  EXPECT_TRUE(row_of(other.program, kPoint).corrected());
  EXPECT_FALSE(row_of(with("FP1.BASE_NO=1\n").program, kPoint).corrected());
}

TEST(Krl, WhatASplineSetsAtItsHeadHoldsForEachOfItsMotions) {
  const std::string far = "{X 1800,Y 0,Z 1000,A 0,B 60,C 0}";
  for (const char* head :
       {"SPLINE WITH $BASE=BASE_DATA[2]\n",
        "SPLINE WITH $VEL={CP 0.2,ORI1 200,ORI2 200}, $BASE=SBASE(FP1.BASE_NO)\n",
        "SPLINE WITH $VEL=SVEL_CP( 0.2, , L1), $TOOL=STOOL2( FP1), $BASE= SBASE( "
        "FP1.BASE_NO),$IPO_MODE=SIPO_MODE( FP1.IPO_FRAME), $LOAD=SLOAD( FP1.TOOL_NO)\n",
        "PTP_SPLINE WITH $BASE=BASE_DATA[2]\n"}) {
    const test::Corrected made =
        krl(program("$BASE=$NULLFRAME\n" + std::string(head) + "SPL " + kPoint + "\nSLIN " + kMore +
                    "\nENDSPLINE\nSLIN " + far + "\n"),
            kFdat);
    ASSERT_EQ(made.refusal, "") << head;
    EXPECT_NEAR(row_of(made.program, kPoint).p_B.x(), 1.8, 1e-9) << head << test::why(made, kPoint);
    EXPECT_NEAR(row_of(made.program, kMore).p_B.x(), 1.81, 1e-9) << head << test::why(made, kMore);
    EXPECT_NEAR(row_of(made.program, far).p_B.x(), 1.8, 1e-9)
        << head << "behind the block, what held before it";
  }
  const test::Corrected tool = krl(program(
      "SPLINE WITH $TOOL={X 100,Y 0,Z 152.5,A 0,B -45,C 0}\nSPL " + kPoint + "\nENDSPLINE\n"));
  EXPECT_NE(tool.refusal.find("2.500 mm"), std::string::npos) << tool.refusal;
}

TEST(Krl, WhatWithSetsAndNobodyCanTellLeavesTheMotion) {
  for (const auto& [with, reason] : std::vector<std::pair<std::string, std::string>>{
           {"$BASE.X=5", "a part of $BASE is set"},
           {"$TOOL.Z=5", "a part of $TOOL is set"},
           {"$BASE=MY_BASE(FP1)", "not constant"},
           {"$BASE=EK(K_ROOT(FP1.BASE_NO),K_TYPE(FP1.BASE_NO),K_OFFS(FP1.BASE_NO))",
            "external kinematics"},
           {"$LOAD=MY_LOAD(1)", "$LOAD is not constant"},
           {"$IPO_MODE=MODE", "$IPO_MODE is not constant"}}) {
    const test::Corrected made =
        krl(program("SLIN " + kPoint + " WITH $VEL.CP=0.1, " + with + "\n"), kFdat);
    EXPECT_NE(test::why(made, kPoint).find(reason), std::string::npos)
        << with << ": " << test::why(made, kPoint) << made.refusal;
  }
}

TEST(Krl, AToolThatStandsIsSaidInEveryForm) {
  for (const char* with : {"$IPO_MODE= SIPO_MODE( FTCP.IPO_FRAME)", "$IPO_MODE=#TCP",
                           "$TOOL= STOOL2( FTCP), $BASE= SBASE( FTCP.BASE_NO),$IPO_MODE= "
                           "SIPO_MODE( FTCP.IPO_FRAME)"}) {
    const test::Corrected made =
        krl(program("SPTP XP1 WITH $VEL_AXIS[1]= SVEL_JOINT( 100.0), " + std::string(with) +
                    "\nPTP {A1 0,A2 -20,A3 20,A4 0,A5 30,A6 0}\nSLIN " + kPoint +
                    " WITH $IPO_MODE= SIPO_MODE( FP1.IPO_FRAME)\n"),
            kFdat);
    EXPECT_NE(test::why(made, "XP1").find("the tool stands"), std::string::npos)
        << with << test::why(made, "XP1");
    EXPECT_TRUE(row_of(made.program, kPoint).corrected()) << with << test::why(made, kPoint);
    const test::Corrected spline =
        krl(program("SPLINE WITH " + std::string(with) + "\nSPL XP1\nENDSPLINE\n"), kFdat);
    EXPECT_NE(test::why(spline, "XP1").find("the tool stands"), std::string::npos)
        << with << test::why(spline, "XP1");
  }
}

TEST(Krl, ABaseThatExternalKinematicsCarryIsLeft) {
  const test::Corrected made = krl(program("LIN " + kPoint + "\nBAS(#EX_BASE,2)\nLIN " + kMore +
                                           "\nBAS(#BASE,2)\nLIN {X 320,Y 0,Z 500,A 0,B 60,C 0}\n"));
  EXPECT_TRUE(row_of(made.program, kPoint).corrected());
  EXPECT_NE(test::why(made, kMore).find("external kinematics carry the base (p.src line"),
            std::string::npos)
      << test::why(made, kMore);
  EXPECT_TRUE(row_of(made.program, "{X 320,Y 0,Z 500,A 0,B 60,C 0}").corrected());
  for (const auto& [index, carried] :
       {std::pair("3", true), std::pair("0", false), std::pair("-1", false)}) {
    const test::Corrected unit =
        krl(program("BAS(#BASE,2)\nLIN " + kPoint + "\n"),
            "DEFDAT p\nMACH_DEF_INDEX[2]=" + std::string(index) + "\nENDDAT\n");
    EXPECT_EQ(row_of(unit.program, kPoint).corrected(), !carried)
        << index << test::why(unit, kPoint);
  }
}

TEST(Krl, ALoadThatNobodyToldIsTheControllersDefault) {
  for (const char* load :
       {"{M -1}", "{M -1.00000,CM {X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0},J {X 0.0,Y 0.0,Z 0.0}}"}) {
    std::string config = kConfig;
    const std::size_t at = config.find("LOAD_DATA[1]=") + 13;
    config.replace(at, config.find("\r\n", at) - at, load);
    const test::Corrected made = corrected_by_shift(
        Dialect::kKrl,
        {{"p.src", program("$LOAD=LOAD_DATA[1]\nLIN " + kPoint + "\n")}, {"$config.dat", config}});
    EXPECT_TRUE(row_of(made.program, kPoint).corrected())
        << test::why(made, kPoint) << made.refusal;
    ASSERT_EQ(made.program.notes.size(), 2u) << load << ": the other one is of the posture";
    EXPECT_NE(made.program.notes[0].find(
                  "a load of -1 kg ($config.dat line 5): the controller takes its default load"),
              std::string::npos)
        << made.program.notes[0];
  }
}

TEST(Krl, TheControllersOwnBasIsKnown) {
  const std::string bas =
      "&ACCESS RO\nGLOBAL DEF BAS(CMD :IN, VAL :IN)\nDECL BAS_COMMAND CMD\nSWITCH CMD\nCASE "
      "#BASE\nTAKE( )\nENDSWITCH\n"
      "END\nDEF TAKE( )\nIF FDAT_ACT.BASE_NO==0 "
      "THEN\n$BASE=$WORLD\nELSE\n$BASE=BASE_DATA[FDAT_ACT.BASE_NO]\nENDIF\n"
      "END\n";
  const auto with = [&](const std::string& name, const std::string& text) {
    return corrected_by_shift(
        Dialect::kKrl, {{"R1/p.src", "DEF p( )\nBAS(#INITMOV,0)\nBAS(#TOOL,1)\nBAS(#BASE,2)\nLIN " +
                                         kPoint + "\nEND\n"},
                        {"R1/$config.dat", kConfig},
                        {name, text}});
  };
  const test::Corrected made = with("R1/System/bas.src", bas);
  EXPECT_TRUE(row_of(made.program, kPoint).corrected()) << test::why(made, kPoint);
  EXPECT_EQ(made.program.files[2].text, bas);
  EXPECT_FALSE(row_of(with("R1/own.src", bas).program, kPoint).corrected())
      << "a routine of the user's own";
}

TEST(Krl, AMotionToWhereTheAxesAreHasNoTarget) {
  const test::Corrected made =
      krl(program("PTP $AXIS_ACT\nPTP $AXIS_ACT C_PTP\nLIN " + kPoint + "\n"));
  EXPECT_EQ(made.program.left_alone(), 0u);
  EXPECT_EQ(made.program.moves, 1u);
  EXPECT_FALSE(row_of(krl(program("LIN $POS_ACT\n")).program, "$POS_ACT").corrected());
  EXPECT_EQ(krl(program("LIN $POS_ACT\n")).program.left_alone(), 1u) << "it depends on the tool";
}

TEST(Krl, WhatARoutineIsHandedIsNothingOfADataListAndMayBeSetByIt) {
  const std::string dat =
      "DEFDAT p PUBLIC\nDECL E6POS XP1={X 300,Y 0,Z 500,A 0,B 60,C 0,S 2,T 2}\nENDDAT\n";
  const std::string by_value = "DEF go(XP1:IN)\nLIN XP1\nEND\n";
  EXPECT_NE(test::why(krl(program("go({X 310,Y 0,Z 500,A 0,B 60,C 0})\n") + by_value, dat), "XP1")
                .find("is a parameter"),
            std::string::npos);
  const auto handed = [&](const std::string& call, const std::string& routine) {
    return test::why(krl(program(call + "\nLIN XP1\n") + routine, dat), "XP1");
  };
  const std::string sets = "DEF shift(P:OUT)\nP.Z=P.Z+10\nEND\n";
  EXPECT_NE(handed("shift(XP1)", sets).find("XP1 may be set by SHIFT (p.src line 6)"),
            std::string::npos)
      << handed("shift(XP1)", sets);
  EXPECT_NE(handed("ELSEWHERE(3,XP1)", "").find("may be set by ELSEWHERE"), std::string::npos);
  EXPECT_NE(
      handed("n=measure(XP1)", "DEFFCT INT measure(P)\nRETURN 1\nENDFCT\n").find("may be set by"),
      std::string::npos);
  for (const char* call :
       {"show(XP1)", "$IN_A=INV_POS(XP1)", "BAS(#PTP_PARAMS,100)", "ELSEWHERE(XP1:XP1)"})
    EXPECT_EQ(handed(call, "DEF show(P:IN)\nEND\n").find("may be set"), std::string::npos) << call;
}

TEST(Krl, RoutinesThatTheFilesLackAreToldWhereTheyMightChangeToolOrBase) {
  const auto notes = [](const std::string& src) {
    return fmt::format("{}", fmt::join(krl(src, kFdat).program.notes, "\n"));
  };
  const std::string calls = "GRIP_OPEN( )\nIF ($IN[1]) THEN\nPULSE($OUT[1],TRUE,1)\nENDIF\nLIN ";
  EXPECT_NE(notes(program(calls + kPoint + "\n"))
                .find("GRIP_OPEN: not in the files handed over, taken to leave $TOOL"),
            std::string::npos)
      << notes(program(calls + kPoint + "\n"));
  EXPECT_EQ(
      notes("DEF p( )\nGRIP_OPEN( )\nFDAT_ACT=FP1\nBAS(#CP_PARAMS,2)\nLIN " + kPoint + "\nEND\n")
          .find("not in the files"),
      std::string::npos);
  EXPECT_EQ(notes(program("LIN " + kPoint + "\n")).find("not in the files"), std::string::npos);
}

TEST(Krl, AToolThatAnIndexMayChangeIsNotConstant) {
  const test::Corrected tool =
      krl(program("TOOL_DATA[i]={X 0,Y 0,Z 1,A 0,B 0,C 0}\nLIN " + kPoint + "\n"));
  EXPECT_NE(test::why(tool, kPoint).find("is set at run time (p.src line 6)"), std::string::npos)
      << test::why(tool, kPoint);
  const test::Corrected load = krl(program("LOAD_DATA[1].M=5\nLIN " + kPoint + "\n"));
  EXPECT_NE(fmt::format("{}", fmt::join(load.program.notes, "\n"))
                .find("is set at run time (p.src line 6)"),
            std::string::npos);
}

TEST(Krl, WhatInitmovSetsIsNotTheToolAndBaseOfBefore) {
  const test::Corrected made = krl(program("BAS(#INITMOV,0)\nLIN " + kPoint + "\n"));
  EXPECT_NE(test::why(made, kPoint).find("BAS(#INITMOV) sets it to its default (p.src line 6)"),
            std::string::npos)
      << test::why(made, kPoint);
  EXPECT_TRUE(
      row_of(krl(program("BAS(#INITMOV,0)\n" + kSet + "LIN " + kPoint + "\n")).program, kPoint)
          .corrected());
}

TEST(Krl, ARowOfFramesThatContradictsTheFilesLeavesThePointWithBothValues) {
  const auto with = [](const std::string& row, double x) {
    Pose X = row.starts_with("TOOL") ? test::spindle_only().tools.at("spindle")
                                     : make_pose(Matrix3::Identity(), {1.5, 0, .5});
    X.translation().x() += x;
    return krl(program("LIN " + kPoint + "\n"), "", {.frames = {{row, X}}});
  };
  for (const char* row : {"TOOL_DATA[1]", "BASE_DATA[2]"}) {
    EXPECT_TRUE(row_of(with(row, 0).program, kPoint).corrected())
        << test::why(with(row, 0), kPoint);
    const std::string said = test::why(with(row, 0.0025), kPoint);
    for (const char* part : {row, "by --frames and [", "by $config.dat line", "2.500 mm"})
      EXPECT_NE(said.find(part), std::string::npos) << said;
  }
}

TEST(Krl, AUnitThatIsNoneCarriesNoBase) {
  const auto with = [](const std::string& type) {
    return krl(program("BAS(#BASE,2)\nLIN " + kPoint + "\n"),
               "DEFDAT p\nMACH_DEF_INDEX[2]=3\nMACHINE_DEF[3]={NAME[] \" \",COOP_KRC_INDEX "
               "0,PARENT[] \" \",ROOT {X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0},MECH_TYPE " +
                   type + ",GEOMETRY[] \" \"}\nENDDAT\n");
  };
  EXPECT_TRUE(row_of(with("#NONE").program, kPoint).corrected())
      << test::why(with("#NONE"), kPoint);
  EXPECT_NE(test::why(with("#EASYS"), kPoint).find("external kinematics carry base 2"),
            std::string::npos);
}

/// As controllers have it in `$config.dat`: the second unit turns, base 2 is on it.
std::vector<SourceFile> with_positioner(const std::string& lines, const std::string& type,
                                        const std::string& index = "2") {
  std::string config = kConfig;
  const std::string units =
      "MACHINE_DEF[2]={NAME[] \"DKP-400\",COOP_KRC_INDEX 1,PARENT[] \"WORLD\",ROOT {X 1200.0,Y "
      "0.0,Z 0.0,A 0.0,B 0.0,C 0.0},MECH_TYPE " +
      type + ",GEOMETRY[] \" \"}\r\nMACHINE_FRAME_DAT[2]={MACH_DEF_INDEX " + index +
      ",PARENT[] \"DKP-400\",GEOMETRY[] \" \"}\r\n";
  config.insert(config.find("ENDDAT"), units);
  return {{"p.src", program(lines)}, {"$config.dat", config}};
}

TEST(Krl, ABaseOnAPositionerIsMovingHoweverItIsSet) {
  for (const char* set : {"$BASE=BASE_DATA[2]", "$BASE=BASE_DATA[2]:{X 10,Y 0,Z 0,A 0,B 0,C 0}",
                          "$BASE=MACHINE_DEF[2].ROOT:{X 300,Y 0,Z 500,A 0,B 0,C 0}", "BAS(#BASE,2)",
                          "$BASE=EK(MACHINE_DEF[2].ROOT,MACHINE_DEF[2].MECH_TYPE,BASE_DATA[2])",
                          "MACH_DEF_INDEX[2]=2\n$BASE={X 1500,Y 0,Z 500,A 0,B 0,C 0}"}) {
    const test::Corrected made = corrected_by_shift(
        Dialect::kKrl,
        with_positioner(std::string(set) + "\nLIN " + kPoint + "\n$BASE=$NULLFRAME\n", "#EASYS"));
    EXPECT_FALSE(row_of(made.program, kPoint).corrected()) << set;
    EXPECT_NE(test::why(made, kPoint).find("external kinematics"), std::string::npos)
        << set << ": " << test::why(made, kPoint);
  }
  for (const auto& [type, index] : {std::pair("#NONE", "2"), std::pair("#EASYS", "0")}) {
    const test::Corrected made = corrected_by_shift(
        Dialect::kKrl, with_positioner("$BASE=BASE_DATA[2]\nLIN " + kPoint + "\n", type, index));
    EXPECT_TRUE(row_of(made.program, kPoint).corrected()) << type << test::why(made, kPoint);
  }
}

TEST(Krl, HomesAreToldAsWhatTheyAre) {
  const std::string axes = "{A1 0,A2 -20,A3 20,A4 0,A5 30,A6 0}";
  for (const char* motion : {"PTP XHOME", "PTP HOME Vel=100 % DEFAULT", "PTP $H_POS"}) {
    const std::string lines = program(std::string(motion) + "\nLIN " + kPoint + "\n");
    const test::Corrected elsewhere = krl(lines);
    EXPECT_NE(elsewhere.program.rows[0].message.find("it is a home position of the controller"),
              std::string::npos)
        << motion << ": " << elsewhere.program.rows[0].message;
    const std::string home = "DEFDAT p\nE6AXIS XHOME=" + axes + "\n$H_POS=XHOME\nENDDAT\n";
    const test::Corrected here = krl(lines, home);
    EXPECT_EQ(here.program.left_alone(), 0u) << motion << ": " << here.program.rows[0].message;
    EXPECT_EQ(here.program.moves_corrected, 2u) << motion;
    ReadOptions folder;
    folder.spared = {"p.dat"};
    const test::Corrected spared = krl(lines, home, folder);
    EXPECT_NE(spared.program.rows[0].message.find("it is a home position, joints in a system file"),
              std::string::npos)
        << motion << ": " << spared.program.rows[0].message;
  }
}

TEST(Krl, AnExternalAxisThatMovesWithoutATargetMovesBeneathAll) {
  for (const char* motion :
       {"PTP {E1 90}", "ASYPTP {E1 90}", "PTP_REL {E1 90}", "LIN_REL {X 5,Y 0,Z 0,E1 90}"}) {
    const test::Corrected made =
        krl(program("LIN " + kPoint + "\n" + motion + "\nLIN " + kMore + "\n"));
    EXPECT_NE(test::why(made, kPoint).find("external axis a moves"), std::string::npos)
        << motion << test::why(made, kPoint);
    EXPECT_NE(test::why(made, kMore).find("external axis a moves"), std::string::npos) << motion;
    Program read = read_program(Dialect::kKrl,
                                {{"p.src", program("LIN " + kPoint + "\n" + motion + "\n")}}, {});
    ASSERT_TRUE(take_idle_axes(read, {"external axis a"})) << motion;
    EXPECT_TRUE(read.moved_axes.empty());
  }
  EXPECT_TRUE(
      row_of(krl(program("LIN_REL {Z 5,E1 0}\nLIN " + kPoint + "\n")).program, kPoint).corrected());
}

TEST(Krl, FdatThatTheProgramMakesItselfIsNotGuessed) {
  for (const char* line :
       {"FDAT_ACT.BASE_NO=2", "FDAT_ACT={TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE}"}) {
    const test::Corrected made =
        krl(program(std::string(line) + "\nBAS(#FRAMES)\nLIN " + kPoint + "\n"));
    EXPECT_NE(test::why(made, kPoint).find("FDAT_ACT is set by itself (p.src line 6)"),
              std::string::npos)
        << line;
  }
}

TEST(Krl, ABaseThatEachBranchOfASwitchSetsAlikeIsKnown) {
  const auto with = [](const std::string& first) {
    return krl(program("$BASE=$NULLFRAME\nSWITCH n\n; hole\nCASE 1\n" + first +
                       "\nDEFAULT\n$BASE=BASE_DATA[2]\nENDSWITCH\nLIN " + kPoint + "\n"));
  };
  EXPECT_TRUE(row_of(with("$BASE=BASE_DATA[2]").program, kPoint).corrected())
      << test::why(with("$BASE=BASE_DATA[2]"), kPoint);
  EXPECT_NE(test::why(with("n=2"), kPoint).find("a branch"), std::string::npos);
}

}  // namespace
}  // namespace trammel::cam
