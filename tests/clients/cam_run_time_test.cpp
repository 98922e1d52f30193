#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "tests/support/shifting_model.h"

// What a controller makes of a program while it runs: sensors, forces, soft axes, tools that it
// measures, variables that are set again, postures that nobody says.
namespace trammel::cam {
namespace {

using test::corrected_by_shift;
using test::row_of;

std::string notes(const test::Corrected& made) {
  return fmt::format("{}", fmt::join(made.program.notes, "\n"));
}
bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}
bool is_corrected(const test::Corrected& made, const std::string& name) {
  return row_of(made.program, name).corrected();
}

// ABB

const std::string kRapidTool =
    "  PERS tooldata "
    "tGun:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,0]];\n";
const std::string kTarget =
    ":=[[1800,-250,800],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n";
std::string module_with(const std::string& data, const std::string& motions,
                        const std::string& routines = "") {
  return "MODULE M\n" + kRapidTool + data + "  PROC main()\n" + motions + "  ENDPROC\n" + routines +
         "ENDMODULE\n";
}
test::Corrected rapid(const std::string& text, const ReadOptions& read = {}) {
  return corrected_by_shift(Dialect::kRapid, {{"m.mod", text}}, read);
}
const std::string kMove = "    MoveL p10,v100,fine,tGun;\n";

TEST(RunTimeRapid, WhereTheArmGivesWayOrAxis4IsHeldTargetsAreLeftUntilThatEnds) {
  const std::string data = "  CONST robtarget p10" + kTarget + "  CONST robtarget p20" + kTarget;
  const std::string second = "    MoveL p20,v100,fine,tGun;\n";
  const std::tuple<std::string, std::string, std::string> ways[] = {
      {"SingArea\\LockAxis4", "SingArea\\Off", "holds axis 4"},
      {"SingArea\\LockAxis4", "SingArea\\Wrist", "holds axis 4"},
      {"FCAct tGun", "FCDeact", "a force decides"},
      {"CSSAct\\RefFrame:=1,20", "CSSDeact", "the arm gives way"}};
  for (const auto& [begins, ends, reason] : ways) {
    const test::Corrected made =
        rapid(module_with(data, "    " + begins + ";\n" + kMove + "    " + ends + ";\n" + second));
    EXPECT_TRUE(has(why(made, "p10"), reason)) << begins << ": " << why(made, "p10");
    EXPECT_TRUE(has(why(made, "p10"), "(m.mod line 6)")) << why(made, "p10");
    EXPECT_TRUE(is_corrected(made, "p20")) << begins << ": " << why(made, "p20");
  }
  for (const char* harmless :
       {"SingArea\\Wrist", "SingArea\\Off", "PathAccLim TRUE\\AccMax:=4,FALSE"})
    EXPECT_TRUE(is_corrected(
        rapid(module_with(data, std::string("    ") + harmless + ";\n" + kMove)), "p10"))
        << harmless;
}

TEST(RunTimeRapid, ASoftAxisIsANote) {
  const test::Corrected made = rapid(module_with(
      "  CONST robtarget p10" + kTarget, "    SoftAct 3,20;\n" + kMove + "    SoftDeact;\n"));
  EXPECT_TRUE(is_corrected(made, "p10")) << why(made, "p10");
  EXPECT_TRUE(has(notes(made), "SoftAct (m.mod line 5): a soft axis gives way")) << notes(made);
}

TEST(RunTimeRapid, ASeamThatASensorTracksIsLeft) {
  const test::Corrected made =
      rapid(module_with("  CONST robtarget p10" + kTarget,
                        "    ArcL p10,v100,seam1,weld1\\Track:=track1,fine,tGun;\n"));
  EXPECT_TRUE(has(why(made, "p10"), "a sensor corrects the path (\\Track)")) << why(made, "p10");
}

TEST(RunTimeRapid, AToolThatIsMeasuredAtRunTimeIsNotTheOneOfTheFile) {
  const std::string data = "  CONST robtarget p10" + kTarget;
  for (const char* measures :
       {"MToolTCPCalib j1,j2,j3,j4,tGun,max,mean", "MToolRotCalib pZ,pX\\XPos:=pY,tGun",
        "SToolRotCalib pR,pZ,pX,tGun", "SetDataVal \"tGun\",tNew", "SetDataVal sName,tNew"}) {
    const test::Corrected made =
        rapid(module_with(data + "  VAR tooldata tNew;\n  VAR string sName;\n",
                          std::string("    ") + measures + ";\n" + kMove));
    EXPECT_TRUE(has(why(made, "p10"), "(m.mod line ")) << measures << ": " << why(made, "p10");
    EXPECT_FALSE(is_corrected(made, "p10")) << measures;
  }
  const test::Corrected load =
      rapid(module_with(data, "    LoadId TOOL_LOAD_ID,MASS_WITH_AX3,tGun;\n" + kMove));
  EXPECT_TRUE(is_corrected(load, "p10")) << why(load, "p10");
  EXPECT_TRUE(has(notes(load), "the load of tool tGun is found at run time (LoadId, m.mod line 5)"))
      << notes(load);
}

TEST(RunTimeRapid, APositionThatIsSetByItsNameIsSetAtRunTime) {
  const std::string data =
      "  PERS robtarget p10" + kTarget + "  VAR robtarget pNew;\n  VAR string sName;\n";
  const auto made = [&](const std::string& name) {
    return rapid(module_with(data, "    SetDataVal " + name + ",pNew;\n" + kMove));
  };
  EXPECT_TRUE(has(why(made("\"P10\""), "p10"), "SetDataVal may set it (m.mod line"))
      << why(made("\"P10\""), "p10");
  EXPECT_FALSE(is_corrected(made("sName"), "p10"));
  EXPECT_TRUE(is_corrected(made("\"other\""), "p10"));
}

TEST(RunTimeRapid, ARoutineThatIsNamedAtRunTimeDoesWhatItDoes) {
  const std::string data = "  CONST robtarget p10" + kTarget + "  VAR string sName;\n";
  const std::string shifts = "  PROC shifted()\n    PDispSet fShift;\n  ENDPROC\n";
  const std::string grips = "  PROC grips()\n    GripLoad lPart;\n  ENDPROC\n";
  const std::string part = "  PERS loaddata lPart:=[50,[0,0,50],[1,0,0,0],0,0,0];\n";
  for (const char* call : {"%\"Grips\"%", "%sName%", "%\"gri\"+sName%", "CallByVar \"gri\",1"}) {
    const test::Corrected made =
        rapid(module_with(data + part, std::string("    ") + call + ";\n" + kMove, grips));
    EXPECT_FALSE(made.refusal.empty() && is_corrected(made, "p10")) << call;
  }
  EXPECT_TRUE(is_corrected(
      rapid(module_with(data, "    %\"other\"%;\n" + kMove, "  PROC other()\n  ENDPROC\n")),
      "p10"));
  EXPECT_FALSE(
      is_corrected(rapid(module_with(data, "    %\"shifted\"%;\n" + kMove, shifts)), "p10"));
  // The head of a module file names nothing.
  EXPECT_TRUE(is_corrected(
      rapid("%%%\n  VERSION:1\n  LANGUAGE:ENGLISH\n%%%\n\n" + module_with(data, kMove)), "p10"));
}

TEST(RunTimeRapid, NamesAreLookedUpInTheirOwnTask) {
  const auto of_task = [](const std::string& task, const std::string& x) {
    std::string target = "MODULE Data\n  CONST robtarget p10" + kTarget + "ENDMODULE\n";
    target.replace(target.find("1800"), 4, x);
    return std::vector<SourceFile>{
        {"RAPID/" + task + "/PROGMOD/data.mod", target},
        {"RAPID/" + task + "/PROGMOD/main.mod",
         "MODULE Main\n" + kRapidTool + "  PROC main()\n" + kMove + "  ENDPROC\nENDMODULE\n"}};
  };
  std::vector<SourceFile> files = of_task("TASK1", "1700");
  for (const SourceFile& file : of_task("TASK2", "1800")) files.push_back(file);
  const test::Corrected made = corrected_by_shift(Dialect::kRapid, files);
  ASSERT_EQ(made.program.rows.size(), 2u);
  for (const ReceiptRow& row : made.program.rows)
    EXPECT_TRUE(row.corrected()) << row.file << row.message;
}

TEST(RunTimeRapid, WhatATaskThatIsNotTakenSetsIsSetAllTheSame) {
  const std::string text = module_with("  CONST robtarget p10" + kTarget, kMove);
  const auto made = [&](const std::string& declared) {
    ReadOptions read;
    read.beside = {{"RAPID/TASK2/PROGMOD/b.mod",
                    "MODULE B\n" + declared +
                        " tooldata tGun:=[TRUE,[[0,0,0],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n"
                        "  PROC main()\n    tGun.tframe.trans.z:=nWear;\n  ENDPROC\nENDMODULE\n"}};
    return corrected_by_shift(Dialect::kRapid, {{"RAPID/TASK1/PROGMOD/m.mod", text}}, read);
  };
  EXPECT_TRUE(
      has(why(made("  PERS"), "p10"), "tGun is set at run time (RAPID/TASK2/PROGMOD/b.mod line 4)"))
      << why(made("  PERS"), "p10");
  EXPECT_TRUE(is_corrected(made("  TASK PERS"), "p10")) << why(made("  TASK PERS"), "p10");
  EXPECT_TRUE(is_corrected(made("  LOCAL PERS"), "p10")) << why(made("  LOCAL PERS"), "p10");
}

// FANUC

std::string point(int number, const std::string& frame = "1", const std::string& tool = "2") {
  return fmt::format(
      "P[{}]{{\n   GP1:\n\tUF : {}, UT : {},\t\tCONFIG : 'N U T, 0, 0, 0',\n\tX = 300.000 mm, Y = "
      "-0.384 mm, Z = 500.000 mm,\n\tW = .000 deg, P = 60.000 deg, R = .000 deg\n}};\n",
      number, frame, tool);
}
std::string ls(const std::string& name, const std::string& lines, const std::string& points) {
  return "/PROG  " + name + "\n/ATTR\n/MN\n" + lines + "/POS\n" + points + "/END\n";
}
test::Corrected fanuc(const std::vector<SourceFile>& files, ReadOptions read = {}) {
  read.frames.emplace("UFRAME[1]", make_pose(Matrix3::Identity(), {1.5, 0, .5}));
  read.frames.emplace("UTOOL[2]", test::spindle_only().tools.at("spindle"));
  return corrected_by_shift(Dialect::kFanuc, files, read);
}

TEST(RunTimeFanuc, AProgramThatIsCalledSelectsForItsCallerAndHasWhatItsCallerSelected) {
  const std::string moves = "   2:L P[1] 100mm/sec FINE ;\n";
  const auto made = [&](const std::string& of_main, const std::string& of_sub) {
    return fanuc({{"main.ls", ls("MAIN", of_main, point(1, "F", "F"))},
                  {"sub.ls", ls("SUB", of_sub, point(7, "F", "F"))}});
  };
  const std::string select = "   1:  UFRAME_NUM=1 ;\n   1:  UTOOL_NUM=2 ;\n";
  const std::string in_sub = "   1:L P[7] 100mm/sec FINE ;\n";
  const test::Corrected inherited = made(select + "   2:  CALL SUB ;\n", in_sub);
  EXPECT_TRUE(is_corrected(inherited, "P[7]")) << why(inherited, "P[7]");
  const test::Corrected given = made("   1:  CALL SUB(1,'a') ;\n" + moves, select + in_sub);
  EXPECT_TRUE(is_corrected(given, "P[1]")) << why(given, "P[1]");
  const test::Corrected perhaps =
      made(select + "   1:  IF R[1]=1,CALL SUB ;\n" + moves, "   1:  UFRAME_NUM=3 ;\n");
  EXPECT_TRUE(has(why(perhaps, "P[1]"), "decides it")) << why(perhaps, "P[1]");
  const test::Corrected elsewhere = made(select + "   1:  CALL OTHER ;\n" + moves, in_sub);
  EXPECT_TRUE(has(why(elsewhere, "P[1]"), "CALL OTHER may select another one"))
      << why(elsewhere, "P[1]");
  // A block that has no beginning ends no program.
  const test::Corrected odd = made("   1:  ENDIF ;\n" + select + moves, in_sub);
  EXPECT_TRUE(is_corrected(odd, "P[1]")) << why(odd, "P[1]");
}

TEST(RunTimeFanuc, AMacroMaySelectAnotherFrame) {
  const std::string select = "   1:  UFRAME_NUM=1 ;\n   1:  UTOOL_NUM=2 ;\n";
  const auto made = [&](const std::string& line) {
    return fanuc({{"p.ls", ls("P", select + "   2:  " + line + " ;\n   3:L P[1] 100mm/sec FINE ;\n",
                              point(1, "F", "F"))}});
  };
  EXPECT_TRUE(has(why(made("GRIPPER OPEN"), "P[1]"), "GRIPPER OPEN (line 6) is not known here"))
      << why(made("GRIPPER OPEN"), "P[1]");
  for (const char* line : {"DO[1:clamp]=ON", "R[1]=R[1]+1", "WAIT   1.00(sec)", "OVERRIDE=50%",
                           "$WAITTMOUT=200", "! GRIPPER OPEN", "MESSAGE[open it]", "Weave Sine[1]"})
    EXPECT_TRUE(is_corrected(made(line), "P[1]")) << line << why(made(line), "P[1]");
}

TEST(RunTimeFanuc, WhatGivesWayAndPointsOfAPalletAreLeft) {
  const auto made = [&](const std::string& lines) {
    return fanuc({{"p.ls", ls("P", lines, point(1) + point(2))}});
  };
  const test::Corrected soft = made(
      "   1:  SOFTFLOAT[1] ;\n   2:L P[1] 100mm/sec FINE ;\n   3:  SOFTFLOAT END ;\n   4:L P[2] "
      "100mm/sec FINE ;\n");
  EXPECT_TRUE(has(why(soft, "P[1]"), "SOFTFLOAT (line 4)")) << why(soft, "P[1]");
  EXPECT_TRUE(is_corrected(soft, "P[2]")) << why(soft, "P[2]");
  const test::Corrected limited = made(
      "   1:  TORQ_LIMIT 50.0% ;\n   2:L P[1] 100mm/sec FINE ;\n   3:  TORQ_LIMIT 100.0% ;\n   4:L "
      "P[2] 100mm/sec FINE ;\n");
  EXPECT_TRUE(has(why(limited, "P[1]"), "TORQ_LIMIT (line 4)")) << why(limited, "P[1]");
  EXPECT_TRUE(is_corrected(limited, "P[2]")) << why(limited, "P[2]");
  const test::Corrected pallet =
      made("   1:  PALLETIZING-B_1 ;\n   2:L PAL_1[BTM] 100mm/sec FINE ;\n");
  EXPECT_TRUE(has(why(pallet, "PAL_1"), "it is no point of /POS")) << why(pallet, "PAL_1");
}

const std::string kSystemFrames =
    "[*SYSTEM*]$MNUFRAME  Storage: SHADOW  Access: RW  : ARRAY[2,2] OF POSITION\n    [1,1] = \n  "
    "Group: 1   Config: N U T, 0, 0, 0\n  X:  1500.000   Y:     0.000   Z:   500.000\n  W:     "
    "0.000   P:     0.000   R:     0.000\n    [1,2] = \n"
    "  Group: 1   Config: N D B, 0, 0, 0\n  X: ********   Y: ********   Z: ********\n  W: ******** "
    "  P: ********   R: ********\n    [2,1] = \n  Group: 2   Config: N U T, 0, 0, 0\n  X:     "
    "9.000   Y:     0.000   Z:     0.000\n  W:     0.000   P:     0.000   R:     "
    "0.000\n\n[*SYSTEM*]$MNUTOOL  Storage: SHADOW  Access: RW  : ARRAY[1,2] OF POSITION\n"
    "    [1,2] = \n  Group: 1   Config: N U T, 0, 0, 0\n  X:   100.000   Y:     0.000   Z:   "
    "150.000\n  W:     0.000   P:   -45.000   R:     0.000\n";

TEST(RunTimeFanuc, TheControllersOwnFramesAndToolsAreTakenFromItsSystemVariables) {
  const std::string text = ls("P", "   1:L P[1] 100mm/sec FINE ;\n   2:L P[2] 100mm/sec FINE ;\n",
                              point(1) + point(2, "2"));
  ReadOptions read;
  read.beside = {{"sysframe.va", kSystemFrames}};
  const test::Corrected made = corrected_by_shift(Dialect::kFanuc, {{"p.ls", text}}, read);
  ASSERT_TRUE(is_corrected(made, "P[1]")) << made.refusal << why(made, "P[1]");
  EXPECT_LT((row_of(made.program, "P[1]").p_B - Vector3(1.8, -.000384, 1)).norm(), 1e-9);
  EXPECT_TRUE(has(notes(made), "UFRAME[1], UTOOL[2]: taken from sysframe.va")) << notes(made);
  EXPECT_TRUE(has(why(made, "P[2]"), "UFRAME[2] is not in the files")) << why(made, "P[2]");
  read.frames.emplace("UFRAME[1]", make_pose(Matrix3::Identity(), {1.5, 0, .502}));
  const test::Corrected contradicted = corrected_by_shift(Dialect::kFanuc, {{"p.ls", text}}, read);
  EXPECT_TRUE(has(why(contradicted, "P[1]"), "sysframe.va line 2: 2.000 mm"))
      << why(contradicted, "P[1]");
  read.frames.clear();
  std::string other = kSystemFrames;
  other.replace(other.find("1500.000"), 8, "1501.000");
  read.beside.push_back({"old/sysframe.va", other});
  EXPECT_TRUE(has(why(corrected_by_shift(Dialect::kFanuc, {{"p.ls", text}}, read), "P[1]"),
                  "has two values"));
  std::string tool = kSystemFrames;
  tool.replace(tool.find("150.000"), 7, "151.000");
  read.beside = {{"sysframe.va", tool}};
  EXPECT_TRUE(has(corrected_by_shift(Dialect::kFanuc, {{"p.ls", text}}, read).refusal, "1.000 mm"));
}

// Universal Robots

test::Corrected script(const std::string& text, const CellTools& cell = test::spindle_only()) {
  return corrected_by_shift(Dialect::kUrScript, {{"p.script", text}}, {}, {}, cell);
}
const std::string kTcp =
    "  set_tcp(p[0.1, 0, 0.15, 0, -0.785398163, 0])\n  movej([0, -0.35, 0.35, 0, 0.5, 0])\n";
const std::string kInFrame = "pose_trans(ref, p[0.3, -0.25, 0.3, 0, 1.0472, 0])";

TEST(RunTimeUr, AFrameThatIsSetAgainHoldsUntilTheNext) {
  const test::Corrected made =
      script("def prog():\n  global ref = p[0, 0, 0, 0, 0, 0]\n" + kTcp +
             "  ref = p[1.5, 0, 0.5, 0, 0, 0]\n  movel(" + kInFrame + ")\nend\nprog()\n");
  ASSERT_TRUE(is_corrected(made, kInFrame)) << made.refusal << why(made, kInFrame);
  EXPECT_LT((row_of(made.program, kInFrame).p_B - Vector3(1.8, -.25, .8)).norm(), 1e-9);
}

TEST(RunTimeUr, AFrameThatABranchALoopOrAThreadSetsIsLeft) {
  const std::string begin = "def prog():\n  global ref = p[1.4, 0, 0.5, 0, 0, 0]\n" + kTcp;
  const std::string set = "  ref = p[1.5, 0, 0.5, 0, 0, 0]\n", move = "  movel(" + kInFrame + ")\n";
  const std::string programs[] = {
      begin + "  if x > 1:\n" + set + "  end\n" + move + "end\n",
      begin + "  while True:\n" + move + set + "  end\nend\n",
      begin + "  def other():\n" + set + "  end\n  if x > 1:\n    other()\n  end\n" + move +
          "end\n",
      begin + "  thread t():\n" + set + "  end\n  run t()\n" + move + "end\n",
      begin + set + "  ref[0] = 1\n" + move + "end\n",
      begin + "  ref = get_actual_tcp_pose()\n" + move + "end\n",
      // Two variables of one name, and one that was made of another before that changed.
      "def a():\n  ref = p[1.5, 0, 0.5, 0, 0, 0]\nend\ndef prog():\n  ref = p[1.4, 0, 0.5, 0, 0, "
      "0]\n" +
          kTcp + "  a()\n" + move + "end\nprog()\n",
      begin + "  there = " + kInFrame + "\n" + set + "  movel(there)\nend\n"};
  for (const std::string& text : programs) {
    const test::Corrected made = script(text);
    const std::string last = made.program.rows.back().message;
    EXPECT_FALSE(made.program.rows.back().corrected()) << text;
    EXPECT_TRUE(has(last, "ref is set at run time (p.script line")) << text << last;
  }
}

TEST(RunTimeUr, AWaypointThatIsSetAgainIsCorrectedEachTime) {
  const test::Corrected made = script("def prog():\n" + kTcp +
                                      "  at = p[1.8, -0.25, 0.8, 0, 1.0472, 0]\n  movel(at)\n"
                                      "  at = p[1.8, -0.2, 0.8, 0, 1.0472, 0]\n  movel(at)\nend\n");
  EXPECT_TRUE(has(made.program.files[0].text, "p[1.800123, -0.250235, 0.800346"))
      << made.program.files[0].text;
  EXPECT_TRUE(has(made.program.files[0].text, "p[1.800123, -0.200235, 0.800346"))
      << made.program.files[0].text;
}

TEST(RunTimeUr, AMountingThatIsNotTheCellsIsRefused) {
  const auto made = [](const std::string& up, bool known = true) {
    CellTools cell = test::spindle_only();
    if (known) cell.gravity_B = -Vector3::UnitZ();
    return script("def prog():\n  set_gravity(" + up + ")\n" + kTcp +
                      "  movel(p[1.8, -0.25, 0.8, 0, 1.0472, 0])\nend\n",
                  cell);
  };
  EXPECT_EQ(made("[0.0, 0.0, 9.82]").refusal, "");
  const std::string refusal = made("[0.0, 9.82, 0.0]").refusal;
  EXPECT_TRUE(has(refusal, "by set_gravity up is (0.00, 1.00, 0.00)")) << refusal;
  EXPECT_TRUE(has(refusal, "90 deg otherwise")) << refusal;
  EXPECT_EQ(made("[0.0, 9.82, 0.0]", false).refusal, "");
  EXPECT_TRUE(has(notes(made("g")), "set_gravity (p.script line 2) is not constant"))
      << notes(made("g"));
}

// KUKA

const std::string kConfig =
    "DEFDAT $CONFIG\nDECL FRAME TOOL_DATA[16]\nTOOL_DATA[1]={X 100.0,Y 0.0,Z 150.0,A 0.0,B -45.0,C "
    "0.0}\n"
    "BASE_DATA[2]={X 1500.0,Y 0.0,Z 500.0,A 0.0,B 0.0,C 0.0}\nENDDAT\n";
test::Corrected krl(const std::string& lines, const CellTools& cell = test::spindle_only()) {
  return corrected_by_shift(
      Dialect::kKrl,
      {{"p.src", "DEF p( )\n$TOOL=TOOL_DATA[1]\n$BASE=BASE_DATA[2]\n" + lines + "END\n"},
       {"$config.dat", kConfig}},
      {}, {}, cell);
}
const std::string kPose = "{X 300,Y -250,Z 300,A 0,B 60,C 0}",
                  kVia = "{X 310,Y -250,Z 300,A 0,B 60,C 0}";

TEST(RunTimeKrl, APostureThatTheBeginningDoesNotSayIsANote) {
  const std::string note =
      "(p.src line 4): the program begins there and does not say the arm's posture";
  EXPECT_TRUE(has(notes(krl("PTP " + kPose + "\n")), note)) << notes(krl("PTP " + kPose + "\n"));
  const std::string said = "PTP {X 300,Y -250,Z 300,A 0,B 60,C 0,S 2,T 2}\nLIN " + kPose + "\n";
  EXPECT_FALSE(has(notes(krl(said)), "does not say the arm's posture")) << notes(krl(said));
  const std::string axes = "PTP {A1 0,A2 -20,A3 20,A4 0,A5 30,A6 0}\nLIN " + kPose + "\n";
  EXPECT_FALSE(has(notes(krl(axes)), "does not say the arm's posture")) << notes(krl(axes));
}

TEST(RunTimeKrl, AnArcThatEndsByItsAngleIsSaid) {
  const auto made = [](const std::string& rest) {
    return krl("LIN {X 290,Y -250,Z 300,A 0,B 60,C 0}\nCIRC " + kVia + "," + kPose + rest + "\n");
  };
  EXPECT_TRUE(is_corrected(made(",CA 360"), kPose)) << why(made(",CA 360"), kPose);
  EXPECT_TRUE(has(notes(made(", CA 360 C_DIS")),
                  "an arc ends by its angle CA and not at its end point (p.src line 5)"));
  EXPECT_FALSE(has(notes(made(" C_DIS")), "CA"));
}

TEST(RunTimeKrl, WhatASensorCorrectsIsLeftUntilItEnds) {
  const std::string lines = "LIN " + kVia + "\nret=RSI_ON(#RELATIVE)\nLIN " + kPose +
                            "\nret=RSI_OFF()\nLIN {X 305,Y -250,Z 300,A 0,B 60,C 0}\n";
  const test::Corrected made = krl(lines);
  EXPECT_TRUE(is_corrected(made, kVia)) << why(made, kVia);
  EXPECT_TRUE(has(why(made, kPose), "a sensor corrects the path (RSI_ON, p.src line 5)"))
      << why(made, kPose);
  EXPECT_TRUE(made.program.rows.back().corrected()) << made.program.rows.back().message;
}

TEST(RunTimeKrl, WhatMovesWithLimitedTorquesIsLeftUntilTheyAreWhole) {
  const std::pair<std::string, std::string> ways[] = {
      {"SET_TORQUE_LIMITS(3,lims)", "RESET_TORQUE_LIMITS(3)"},
      {"$CURR_RED[3,1]=20", "$CURR_RED[3,1]=100"},
      {"$TORQUE_AXIS='B000100'", "$TORQUE_AXIS=0"}};
  for (const auto& [begins, ends] : ways) {
    const test::Corrected made = krl("LIN " + kVia + "\n" + begins + "\nLIN " + kPose + "\n" +
                                     ends + "\nLIN {X 305,Y -250,Z 300,A 0,B 60,C 0}\n");
    EXPECT_TRUE(is_corrected(made, kVia)) << why(made, kVia);
    EXPECT_TRUE(has(why(made, kPose), "a force may move the axes"))
        << begins << ": " << why(made, kPose);
    EXPECT_TRUE(has(why(made, kPose), "p.src line 5)")) << why(made, kPose);
    EXPECT_TRUE(made.program.rows.back().corrected())
        << begins << ": " << made.program.rows.back().message;
  }
}

TEST(RunTimeKrl, ARobotThatHangsByItsRobrootAndStandsByTheCellIsAContradiction) {
  CellTools cell = test::spindle_only();
  cell.gravity_B = -Vector3::UnitZ();
  const auto made = [&](const std::string& turned) {
    return corrected_by_shift(Dialect::kKrl,
                              {{"p.src",
                                "DEF p( )\n$TOOL=TOOL_DATA[1]\n$BASE=$ROBROOT\nPTP {X 1800,Y "
                                "-250,Z 800,A 0,B 60,C 0,S 2,T 2}\nEND\n"},
                               {"$config.dat", kConfig},
                               {"$machine.dat", "DEFDAT $MACHINE\nFRAME $ROBROOT={X 0,Y 0,Z 800," +
                                                    turned + "}\nENDDAT\n"}},
                              {}, {}, cell);
  };
  const std::vector<std::string> said = made("A 0,B 180,C 0").program.contradictions;
  ASSERT_EQ(said.size(), 1u);
  EXPECT_TRUE(has(said[0], "180 deg apart")) << said[0];
  EXPECT_TRUE(made("A 90,B 0,C 0").program.contradictions.empty());
}

// Yaskawa

std::string job(const std::string& positions, const std::string& lines,
                const std::string& type = "ROBOT") {
  return "/JOB\n//NAME J\n//POS\n///NPOS 3,0,0,0,0,0\n///TOOL 1\n///POSTYPE " + type +
         (type == "PULSE" ? "\n///PULSE\n" : "\n///RECTAN\n///RCONF 1,0,0,0,0,0,0,0\n") +
         positions + "//INST\n///DATE 2026/11/22 10:00\n///ATTR SC,RW\n///GROUP1 RB1\nNOP\n" +
         lines + "END\n";
}
test::Corrected jbi(const std::string& text, ReadOptions read = {}) {
  read.frames.emplace("TOOL[1]", test::spindle_only().tools.at("spindle"));
  return corrected_by_shift(Dialect::kInform, {{"j.jbi", text}}, read);
}

TEST(RunTimeInform, WhatASensorOrASoftAxisMovesIsLeftUntilItEnds) {
  const std::string positions =
      "C00000=1800.000,-250.000,800.000,0.0000,60.0000,0.0000\nC00001=1800.000,-240.000,800.000,0."
      "0000,60.0000,0.0000\n";
  for (const auto& [begins, ends] :
       {std::pair("COMARCON ASF#(1)", "COMARCOF"), std::pair("FLOATON RB1", "FLOATOF RB1")}) {
    const test::Corrected made = jbi(job(
        positions, fmt::format("{}\nMOVL C00000 V=10.0\n{}\nMOVL C00001 V=10.0\n", begins, ends)));
    EXPECT_TRUE(has(why(made, "C00000"), "a sensor or a soft axis moves it: "))
        << why(made, "C00000");
    EXPECT_TRUE(has(why(made, "C00000"), "(j.jbi line ")) << why(made, "C00000");
    EXPECT_TRUE(is_corrected(made, "C00001")) << why(made, "C00001");
  }
}

TEST(RunTimeInform, PulsesAreJointsWhereItIsToldHowManyMakeADegree) {
  const std::string text =
      job("C00000=0,-20000,20000,0,-30000,0\n", "MOVJ C00000 VJ=10.0\n", "PULSE");
  EXPECT_TRUE(has(why(jbi(text), "C00000"), "give --pulses-per-deg S,L,U,R,B,T"))
      << why(jbi(text), "C00000");
  ReadOptions read;
  read.pulses_per_deg = {1000, 1000, 1000, 1000, -1000, 500};
  const test::Corrected made = jbi(text, read);
  ASSERT_TRUE(is_corrected(made, "C00000")) << made.refusal << why(made, "C00000");
  // 0.0123456 deg more of each axis, in whole pulses.
  EXPECT_TRUE(has(made.program.files[0].text, "C00000=12,-19988,20012,12,-30012,6\n"))
      << made.program.files[0].text;
  EXPECT_GT(row_of(made.program, "C00000").rounding_mm, 0.001);
  read.keep_joints = true;
  EXPECT_FALSE(is_corrected(jbi(text, read), "C00000"));
}

}  // namespace
}  // namespace trammel::cam
