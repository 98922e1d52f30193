#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "clients/programs/receipt_text.h"
#include "tests/support/shifting_model.h"

namespace trammel::cam {
namespace {

using test::corrected_by_shift;
using test::kShift_mm;
using test::row_of;

// A robot that stands 600 mm up, turned by 90 deg about z: its x is the world's y. The tool's point
// is 1800 mm in front of it, 1000 mm up.
const Pose kStands = make_pose(rotation_exp({0, 0, kPi / 2}), {0, 0, .6});
const Vector3 kInBase(1.8, 0, 1);
const Vector3 kShiftInWorld(-kShift_mm.y(), kShift_mm.x(), kShift_mm.z());

const std::string kConfig =
    "DEFDAT $CONFIG\nTOOL_DATA[1]={X 100.0,Y 0.0,Z 150.0,A 0.0,B -45.0,C 0.0}\n"
    "BASE_DATA[2]={X 0.0,Y 1500.0,Z 1100.0,A 90.0,B 0.0,C 0.0}\nENDDAT\n";
const std::string kRoot = "FRAME $ROBROOT={X 0.0,Y 0.0,Z 600.0,A 90.0,B 0.0,C 0.0}\n";
const std::string kInWorld = "{X 0.0,Y 1800.0,Z 1600.0,A 90.0,B 60.0,C 0.0}";

std::string machine(const std::string& lines) {
  return "&ACCESS R\nDEFDAT $MACHINE PUBLIC\n" + lines + "ENDDAT\n";
}
std::string src(const std::string& lines) {
  return "DEF p( )\n$TOOL=TOOL_DATA[1]\n" + lines + "END\n";
}
test::Corrected krl(const std::string& lines, const std::string& of_machine,
                    const ReadOptions& read = {}) {
  std::vector<SourceFile> files = {{"R1/Program/p.src", src(lines)},
                                   {"R1/System/$config.dat", kConfig}};
  if (!of_machine.empty()) files.push_back({"R1/Mada/$machine.dat", machine(of_machine)});
  return corrected_by_shift(Dialect::kKrl, files, read);
}
std::string all(const std::vector<std::string>& notes) {
  return fmt::format("{}", fmt::join(notes, "\n"));
}
bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

void expect_in_base(const ReceiptRow& row, const std::string& what) {
  ASSERT_TRUE(row.corrected()) << what << ": " << row.message;
  EXPECT_LT((row.p_B - kInBase).norm(), 1e-5) << what;
  const double unit = row.coordinates == Coordinates::kRotationVector ? 1e-3 : 1;
  for (std::size_t k = 0; k < 3; ++k)
    EXPECT_NEAR(row.after[k] - row.before[k], unit * kShiftInWorld(static_cast<Eigen::Index>(k)),
                1.1e-3 * unit)
        << what;
}

TEST(RobotBase, TheRobrootOfAFolderSaysWhereTheRobotStandsInTheWorld) {
  for (const char* base : {"$BASE=$WORLD\n", "$BASE=$NULLFRAME\n", "BAS(#BASE,0)\n"}) {
    const test::Corrected made = krl(base + ("LIN " + kInWorld + "\n"), kRoot);
    ASSERT_EQ(made.refusal, "");
    expect_in_base(row_of(made.program, kInWorld), base);
    EXPECT_TRUE(has(all(made.program.notes), "$ROBROOT (R1/Mada/$machine.dat line 3)"))
        << all(made.program.notes);
  }
  const std::string in_base = "{X 300.0,Y 0.0,Z 500.0,A 0.0,B 60.0,C 0.0}";
  const ReceiptRow row =
      row_of(krl("$BASE=BASE_DATA[2]\nLIN " + in_base + "\n", kRoot).program, in_base);
  EXPECT_LT((row.p_B - kInBase).norm(), 1e-5) << row.message;
  const std::string at_root = "{X 1800.0,Y 0.0,Z 1000.0,A 0.0,B 60.0,C 0.0}";
  const ReceiptRow own =
      row_of(krl("$BASE=$ROBROOT\nLIN " + at_root + "\n", kRoot).program, at_root);
  EXPECT_LT((own.p_B - kInBase).norm(), 1e-5) << own.message;
}

/// The same target in each dialect, in its controller's world.
std::vector<std::pair<Dialect, std::vector<SourceFile>>> programs_in_the_world() {
  const std::string angles = "0.0,1800.0,1600.0,0.0,60.0,90.0";
  const Vector3 w = rotation_log(kStands.linear() * rotation_exp({0, kPi / 3, 0}));
  const Eigen::Quaterniond q(kStands.linear() * rotation_exp({0, kPi / 3, 0}));
  return {
      {Dialect::kKrl,
       {{"p.src", src("$BASE=$WORLD\nLIN " + kInWorld + "\n")}, {"$config.dat", kConfig}}},
      {Dialect::kRapid,
       {{"m.mod", fmt::format("MODULE M\n  PERS tooldata "
                              "tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,["
                              "0,0,100],[1,0,0,0],0,0,0]];\n  PROC main()\n    MoveL "
                              "[[0,1800,1600],[{:.9f},{:.9f},{:.9f},{:.9f}],[0,0,0,0],[9E9,9E9,9E9,"
                              "9E9,9E9,9E9]],v100,fine,tSpindle;\n  ENDPROC\nENDMODULE\n",
                              q.w(), q.x(), q.y(), q.z())}}},
      {Dialect::kFanuc,
       {{"p.ls",
         "/PROG  P\n/MN\n   1:L P[1] 100mm/sec FINE ;\n/POS\nP[1]{\n   GP1:\n\tUF : 0, UT : "
         "2,\t\tCONFIG : 'N U T, 0, 0, 0',\n\tX =   0.000  mm,\tY =  1800.000  mm,\tZ =  1600.000  "
         "mm,\n\tW =   .000 deg,\tP =    60.000 deg,\tR =   90.000 deg\n};\n/END\n"}}},
      {Dialect::kInform,
       {{"p.jbi",
         "/JOB\r\n//NAME P\r\n//POS\r\n///NPOS 1,0,0,0,0,0\r\n///TOOL 1\r\n///POSTYPE "
         "BASE\r\n///RECTAN\r\n///RCONF 1,0,0,0,0,0,0,0\r\nC00000=" +
             angles + "\r\n//INST\r\n///GROUP1 RB1\r\nNOP\r\nMOVL C00000 V=100.0\r\nEND\r\n"}}},
      {Dialect::kUrScript,
       {{"p.script",
         fmt::format(
             "def p():\n  set_tcp(p[0.1, 0, 0.15, 0, -0.785398163, 0])\n  movej([0, -0.35, 0.35, "
             "0, 0.5, 0])\n  movel(p[0.0, 1.8, 1.6, {:.9f}, {:.9f}, {:.9f}], a=1, v=0.1)\nend\n",
             w.x(), w.y(), w.z())}}},
      {Dialect::kCamRob, {{"p.csv", "1;0.0;1800.0;1600.0;90.0;60.0;0.0;1;25.0\n"}}},
      {Dialect::kRoboDk, {{"p.csv", "name,x,y,z,rx,ry,rz\nh," + angles + "\n"}}},
  };
}

TEST(RobotBase, ARowOfFramesStandsTheRobotInEveryDialect) {
  const Pose X_FT = test::spindle_only().tools.at("spindle");
  for (const auto& [dialect, files] : programs_in_the_world()) {
    ReadOptions read;
    read.frames = {{"robot_base", kStands}, {"UTOOL[2]", X_FT}, {"TOOL[1]", X_FT}};
    const test::Corrected made = corrected_by_shift(dialect, files, read);
    ASSERT_EQ(made.refusal, "") << name_of(dialect);
    ASSERT_FALSE(made.program.rows.empty()) << name_of(dialect);
    expect_in_base(made.program.rows.back(), name_of(dialect));
  }
}

TEST(RobotBase, ARowOfFramesThatContradictsTheFolderIsRefusedWithBothPlacesAndValues) {
  ReadOptions read;
  read.frames = {{"robot_base", make_pose(kStands.linear(), {0, 0, .603})}};
  const test::Corrected made = krl("$BASE=$WORLD\nLIN " + kInWorld + "\n", kRoot, read);
  for (const char* part : {"robot_base of --frames", "[0.000, 0.000, 603.000] mm",
                           "$ROBROOT (R1/Mada/$machine.dat line 3)", "[0.000, 0.000, 600.000] mm",
                           "3.000 mm and 0.0000 deg apart"})
    EXPECT_TRUE(has(made.refusal, part)) << part << ": " << made.refusal;
  read.frames = {{"robot_base", kStands}};
  EXPECT_EQ(krl("$BASE=$WORLD\nLIN " + kInWorld + "\n", kRoot, read).refusal, "")
      << "the same place twice";
}

TEST(RobotBase, AFrameOfARowIsSeenFromTheRobotAndThisIsSaid) {
  const std::string in_base = "{X 300.0,Y 0.0,Z 500.0,A 0.0,B 60.0,C 0.0}";
  ReadOptions read;
  read.frames = {{"BASE_DATA[7]", make_pose(Matrix3::Identity(), {1.5, 0, .5})}};
  const test::Corrected made = krl("BAS(#BASE,7)\nLIN " + in_base + "\n", kRoot, read);
  EXPECT_LT((row_of(made.program, in_base).p_B - kInBase).norm(), 1e-5);
  EXPECT_TRUE(
      has(all(made.program.notes), "BASE_DATA[7] of --frames: taken as seen from the robot's base"))
      << all(made.program.notes);
}

TEST(RobotBase, OnARailTheRobrootMovesAndIsNotUsed) {
  const std::string in_base = "{X 1800.0,Y 0.0,Z 1000.0,A 0.0,B 60.0,C 0.0}";
  const test::Corrected made = krl("$BASE=$WORLD\nLIN " + in_base + "\n",
                                   kRoot + "DECL EX_KIN $EX_KIN={ET1 #ERSYS,ET2 #NONE}\n");
  EXPECT_LT((row_of(made.program, in_base).p_B - kInBase).norm(), 1e-5);
  EXPECT_TRUE(has(all(made.program.notes), "an external axis carries the robot"))
      << all(made.program.notes);
}

TEST(StatedRobot, LengthsOfTheFolderThatAreNotThoseOfTheRobotFileAreRefused) {
  const std::string line = "$BASE=$WORLD\nLIN {X 1800.0,Y 0.0,Z 1000.0,A 0.0,B 60.0,C 0.0}\n";
  // Of the IRB 6640: 780 up, 320 out, 1280 and hypot(200, 1142) long, 200 from the wrist to the
  // flange.
  const std::string right =
      "INT $NUM_AX=6\nFRAME $TIRORO={X 0.0,Y 0.0,Z 780.0,A 0.0,B 0.0,C 0.0}\nREAL "
      "$LENGTH_A=320.000\n"
      "REAL $LENGTH_B=1280.00\nFRAME $TX3P3={X 1142.0,Y 0.0,Z -200.0,A 0.0,B 90.0,C 0.0}\n"
      "FRAME $TFLWP={X 0.0,Y 0.0,Z 200.0,A 0.0,B 0.0,C 0.0}\n";
  EXPECT_EQ(krl(line, right).refusal, "");
  EXPECT_EQ(krl(line, "REAL $LENGTH_A=0.0\nFRAME $TFLWP={X 0,Y 0,Z 0,A 0,B 0,C 0}\n").refusal, "");
  for (const auto& [was, is, told] : std::vector<std::array<std::string, 3>>{
           {"Z 200.0,A 0.0,B 0.0", "Z 225.0,A 0.0,B 0.0",
            "$TFLWP says 225.000 mm from the wrist to the flange"},
           {"Z 200.0,A 0.0,B 0.0,C 0.0", "Z 200.0,A 0.0,B 0.0,C 90.0",
            "$TFLWP says 90.000 deg from the last axis to that of the flange"},
           {"Z 780.0", "Z 650.0", "$TIRORO says 650.000 mm from the base up to axis 2"},
           {"=320.000", "=330.5", "$LENGTH_A says 330.500 mm from axis 1 to axis 2"},
           {"=1280.00", "=1150.00", "$LENGTH_B says 1150.000 mm from axis 2 to axis 3"},
           {"X 1142.0", "X 1200.0", "from axis 3 to the wrist"},
           {"$NUM_AX=6", "$NUM_AX=4", "$NUM_AX says 4 turning axes"}}) {
    std::string wrong = right;
    wrong.replace(wrong.find(was), was.size(), is);
    const test::Corrected made = krl(line, wrong);
    EXPECT_TRUE(has(made.refusal, told)) << is << ": " << made.refusal;
    EXPECT_TRUE(has(made.refusal, "R1/Mada/$machine.dat row ")) << made.refusal;
    EXPECT_TRUE(has(made.refusal, "the robot file of ABB IRB 6640-205/2.75 has")) << made.refusal;
  }
}

TEST(StatedRobot, ATypeOfAnotherRobotIsRefused) {
  const auto named = [](const std::string& robot, const std::string& type,
                        const std::string& variable = "$TRAFONAME") {
    const Cell cell = *test::small_cell("cam");
    std::vector<Joint> joints;
    for (int j = 0; j < cell.robot.size(); ++j) joints.push_back(cell.robot.joint(j));
    const Program program =
        read_program(Dialect::kKrl,
                     {{"$machine.dat", machine(variable + "[]=\"" + type + "\"\n")},
                      {"$config.dat", kConfig},
                      {"p.src", src("$BASE=$WORLD\nLIN {X 1800,Y 0,Z 1000,A 0,B 60,C 0}\n")}},
                     {});
    const auto made = correct_program(program, Chain::make(robot, joints).value(),
                                      test::spindle_only(), test::shift, {});
    return made ? std::string() : sentence(made.error());
  };
  const std::string type = "#KR210R2700 EXTRA C4 FLR";
  EXPECT_EQ(named("KUKA KR 210 R2700 extra", type), "");
  EXPECT_EQ(named("kuka_kr210-r2700-extra", type), "");
  EXPECT_EQ(named("robot 7", type), "");
  EXPECT_EQ(named("KUKA KR 16-2", "#KR16_2 C2 FLR ZH16"), "");
  for (const char* other : {"KUKA KR 240 R2700 prime", "KUKA KR 210 R3100 ultra"}) {
    EXPECT_TRUE(
        has(named(other, type),
            "$TRAFONAME says #KR210R2700 EXTRA C4 FLR, the robot file is of " + std::string(other)))
        << named(other, type);
    EXPECT_TRUE(has(named(other, type, "$MODEL_NAME"), "$MODEL_NAME says #KR210R2700 EXTRA C4 FLR"))
        << named(other, type, "$MODEL_NAME");
  }
}

TEST(StatedRobot, AxisEndsOfTheFolderThatAreNotTheRobotFilesLeadWithBothPlacesAndValues) {
  const Chain robot = test::small_cell("cam")->robot;
  const auto ends = [&](double more_of_axis_3) {
    std::string lines;
    for (int j = 0; j < robot.size(); ++j) {
      const double more = j == 2 ? more_of_axis_3 : 0;
      lines += fmt::format("$SOFTN_END[{0}]={1:.3f}\n$SOFTP_END[{0}]={2:.3f}\n", j + 1,
                           to_deg(robot.joint(j).lower), to_deg(robot.joint(j).upper) + more);
    }
    return lines;
  };
  const std::string line = "$BASE=$WORLD\nLIN {X 1800.0,Y 0.0,Z 1000.0,A 0.0,B 60.0,C 0.0}\n";
  EXPECT_TRUE(krl(line, ends(0)).program.contradictions.empty());
  const std::string upper = fmt::format("{:g}", to_deg(robot.joint(2).upper));
  for (const auto& [more, told] : {std::pair(7.0, "may be of another arm"),
                                   std::pair(-7.0, "stops short of the robot file")}) {
    const test::Corrected made = krl(line, ends(more));
    ASSERT_EQ(made.program.contradictions.size(), 1u) << more << made.refusal;
    const std::string said = made.program.contradictions[0];
    for (const std::string& part :
         {std::string("R1/Mada/$machine.dat"), std::string("$SOFTP_END[3] (line 8)"),
          fmt::format("{:g}", to_deg(robot.joint(2).upper) + more), upper,
          std::string("the robot file of ABB IRB 6640-205/2.75"), std::string(told)})
      EXPECT_TRUE(has(said, part)) << part << ": " << said;
    EXPECT_FALSE(has(said, "$SOFTP_END[2]")) << said;
    EXPECT_EQ(receipt_summary(made.program).rfind("warning: ends of axes in", 0), 0u)
        << receipt_summary(made.program);
    EXPECT_TRUE(has(receipt_json(made.program), "\"contradiction\"")) << "for programs";
  }
}

TEST(StatedRobot, AnArmThatHangsByTheFolderAndStandsByTheCellLeadsWithBoth) {
  const std::string line = "$BASE=$ROBROOT\nLIN {X 1800.0,Y 0.0,Z 1000.0,A 0.0,B 60.0,C 0.0}\n";
  CellTools cell = test::spindle_only();
  cell.gravity_B = -Vector3::UnitZ();
  for (const char* turned : {"A 0.0,B 0.0,C 180.0", "A 0.0,B 180.0,C 0.0"}) {
    const std::vector<SourceFile> files = {
        {"R1/Program/p.src", src(line)},
        {"R1/System/$config.dat", kConfig},
        {"R1/Mada/$machine.dat",
         machine("FRAME $ROBROOT={X 0,Y 0,Z 2500," + std::string(turned) + "}\n")}};
    const test::Corrected made = corrected_by_shift(Dialect::kKrl, files, {}, {}, cell);
    ASSERT_EQ(made.program.contradictions.size(), 1u) << made.refusal;
    const std::string said = made.program.contradictions[0];
    for (const char* part : {"$ROBROOT (R1/Mada/$machine.dat line 3) the robot is hanging",
                             "by the cell's base and gravity it is standing", "180 deg apart"})
      EXPECT_TRUE(has(said, part)) << part << ": " << said;
    EXPECT_EQ(receipt_summary(made.program).rfind("warning: by $ROBROOT", 0), 0u);
    EXPECT_FALSE(has(all(made.program.notes), "hanging")) << "said once";
    cell.gravity_B = Vector3::UnitZ();
    EXPECT_TRUE(
        corrected_by_shift(Dialect::kKrl, files, {}, {}, cell).program.contradictions.empty());
    cell.gravity_B = -Vector3::UnitZ();
  }
}

}  // namespace
}  // namespace trammel::cam
