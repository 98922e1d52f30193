#include "clients/cam/backup/backup.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>
#include <tuple>

#include "clients/cli/command_line.h"
#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/robot/cell_rules.h"
#include "tests/support/temporary_folder.h"

namespace trammel::cli {
namespace {

const std::string kBackup = TRAMMEL_SOURCE_DIR "/config/programs/backup";
const std::string kRobot = TRAMMEL_SOURCE_DIR "/models/abb_irb6640-205-275.yaml";

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  const std::size_t at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return text.replace(at, what.size(), by);
}

class ImportBackup : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::copy(kBackup, file("backup"), std::filesystem::copy_options::recursive);
  }
  int run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"trammel", "import-backup", file("backup")});
    std::vector<const char*> argv;
    for (const std::string& argument : arguments) argv.push_back(argument.c_str());
    return run_command_line(static_cast<int>(argv.size()), argv.data());
  }
  std::string file(const std::string& name) const { return folder_.file(name); }
  std::string text(const std::string& name) const { return read_text_file(file(name)).value(); }
  void change(const std::string& name, const std::string& what, const std::string& by) {
    ASSERT_TRUE(write_text_file(file(name), replaced(text(name), what, by)));
  }
  std::vector<std::string> differing(const std::string& cell) {
    EXPECT_NE(run({"--compare", cell, "--json", file("d.json")}), 3);
    return nlohmann::json::parse(text("d.json"))["differences"].get<std::vector<std::string>>();
  }
  /// The exit code, and what was said on standard error.
  std::pair<int, std::string> told(std::vector<std::string> arguments) {
    testing::internal::CaptureStderr();
    const int code = run(std::move(arguments));
    return {code, testing::internal::GetCapturedStderr()};
  }
  void clear_backup() const {
    std::filesystem::remove_all(file("backup"));
    std::filesystem::create_directories(file("backup"));
  }
  const std::string moc = "backup/SYSPAR/MOC.cfg", user = "backup/RAPID/TASK1/SYSMOD/user.sys";

  test::TemporaryFolder folder_;
};

TEST_F(ImportBackup, MakesACellOfWhatTheControllerHas) {
  ASSERT_EQ(run({"-o", file("cell.yaml"), "--name", "cell-7", "--robot", kRobot, "--frames",
                 file("frames.csv")}),
            0);
  const Cell cell = read_cell(file("cell.yaml")).value();
  EXPECT_EQ(cell.name, "cell-7");
  ASSERT_TRUE(cell.tools.at("spindle"));
  EXPECT_LT((cell.tools.at("spindle")->translation() - Vector3(.1, 0, .15)).norm(), 1e-9);
  EXPECT_NEAR(cell.payloads.at("spindle").mass, 100, 1e-9);
  EXPECT_NEAR(cell.payloads.at("lPanel").mass, 12.5, 1e-9);
  ASSERT_EQ(cell.joint_ranges.size(), 6u);
  EXPECT_NEAR(to_deg(cell.joint_ranges[2].second), 70, 1e-3);
  EXPECT_FALSE(rules_of(cell)->controller_compensates);
  EXPECT_NE(text("frames.csv").find("wPanel,1800,-250,800,1,0,0,0"), std::string::npos)
      << text("frames.csv");
  EXPECT_TRUE(differing(file("cell.yaml")).empty());
}

TEST_F(ImportBackup, TellsWhereACellDiffersWithBothValuesAndHowFar) {
  ASSERT_EQ(run({"-o", file("cell.yaml"), "--name", "cell-7", "--robot", kRobot}), 0);
  change(user, "[100,0,150]", "[100,0,153.5]");
  change(user, "[100,[0,0,100]", "[112,[0,0,100]");
  change(moc, "r1_uncalib", "r1_calib");
  change(moc, "-base_frame_pos_x 0 ", "-base_frame_pos_x 0.25 ");
  change(moc, "-upper_joint_bound 1.48353", "-upper_joint_bound 1.2");
  const std::vector<std::string> found = differing(file("cell.yaml"));
  ASSERT_EQ(found.size(), 5u) << fmt::format("{}", fmt::join(found, "\n"));
  EXPECT_NE(found[0].find("250.000 mm and 0.0000 deg apart"), std::string::npos) << found[0];
  EXPECT_NE(found[1].find("tool spindle"), std::string::npos);
  EXPECT_NE(found[1].find("3.500 mm and 0.0000 deg apart"), std::string::npos) << found[1];
  EXPECT_NE(found[2].find("12.000 kg"), std::string::npos) << found[2];
  EXPECT_NE(found[3].find("axis 2"), std::string::npos) << found[3];
  EXPECT_NE(found[4].find("controller_compensates: false"), std::string::npos) << found[4];
  EXPECT_EQ(run({"--compare", file("cell.yaml")}), 1);
  ASSERT_EQ(run({"-o", file("now.yaml"), "--name", "cell-7", "--robot", kRobot}), 0);
  EXPECT_TRUE(differing(file("now.yaml")).empty());
  EXPECT_TRUE(rules_of(read_cell(file("now.yaml")).value())->controller_compensates);
}

TEST_F(ImportBackup, RefusesWhatDoesNotMakeACell) {
  EXPECT_EQ(run({"-o", "-", "--name", "c"}), 2) << "where does the robot file go?";
  EXPECT_EQ(run({}), 2);
  const std::string good = text(moc);
  change(moc, "-base_frame_orient_u0 1", "-base_frame_orient_u0 2");
  EXPECT_EQ(run({"-o", file("cell.yaml"), "--name", "c", "--robot", kRobot}), 3);
  folder_.write(moc, replaced(good, "-base_frame_pos_x 0", "-base_frame_pos_x zero"));
  EXPECT_EQ(run({"-o", file("cell.yaml"), "--name", "c", "--robot", kRobot}), 3);
  folder_.write(moc, "MOC:CFG_1.0:6:1::\n");
  EXPECT_EQ(run({"-o", file("cell.yaml"), "--name", "c", "--robot", kRobot}), 3);
  folder_.write(moc, good + "#\nROBOT:\n\n  -name \"ROB_2\"\n");
  EXPECT_EQ(run({"-o", file("cell.yaml"), "--name", "c", "--robot", kRobot}), 3) << "which of two?";
  EXPECT_EQ(run({"-o", file("cell.yaml"), "--name", "c", "--robot", kRobot, "--unit", "ROB_1"}), 0);
  EXPECT_EQ(run({"-o", file("cell.yaml"), "--name", "c", "--robot", kRobot, "--unit", "ROB_1",
                 "--task", "T"}),
            3);
  std::filesystem::create_directories(file("backup/RAPID/TASK2/SYSMOD"));
  folder_.write("backup/RAPID/TASK2/SYSMOD/user.sys",
                replaced(text(user), "[100,0,150]", "[1,0,150]"));
  EXPECT_EQ(run({"-o", file("cell.yaml"), "--name", "c", "--robot", kRobot, "--unit", "ROB_1"}), 3)
      << "two spindles";
  EXPECT_EQ(run({"-o", file("cell.yaml"), "--name", "c", "--robot", kRobot, "--unit", "ROB_1",
                 "--task", "task1"}),
            0);
}

/// m and rad: the largest difference of two arms' flanges at poses within a turn.
double farthest_apart(const Chain& one, const Chain& other) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> angle(-kPi, kPi);
  double farthest = 0;
  for (int pose = 0; pose < 60; ++pose) {
    JointVector q(6);
    for (Eigen::Index j = 0; j < q.size(); ++j) q(j) = angle(random);
    const Eigen::Matrix4d apart = one.flange_pose(q).matrix() - other.flange_pose(q).matrix();
    farthest = std::max(farthest, apart.cwiseAbs().maxCoeff());
  }
  return farthest;
}

TEST_F(ImportBackup, OfAnAbbTheShippedRobotOfItsTypeIsWrittenBesideTheCell) {
  ASSERT_EQ(run({"-o", file("cell-7.yaml")}), 0);
  const Cell cell = read_cell(file("cell-7.yaml")).value();
  EXPECT_EQ(cell.name, "cell-7");
  EXPECT_TRUE(std::filesystem::exists(file("cell-7-robot.yaml")));
  const Chain shipped = read_robot(kRobot).value();
  EXPECT_EQ(cell.robot.name(), shipped.name());
  EXPECT_LT(farthest_apart(cell.robot, shipped), 1e-12);
  EXPECT_EQ(cell.robot.joint(1).upper, shipped.joint(1).upper);
  EXPECT_EQ(cell.robot.joint(1).compliance_prior, 0);
}

TEST_F(ImportBackup, OfAnAbbWhatTheMakerMeasuredIsShownAndCompliancesAreAFirstGuess) {
  const std::string measured =
      "#\nARM_CALIB:\n\n      -name \"rob1_1\" -error_offset_x 0.0002 -error_roll -0.0003\n\n"
      "      -name \"rob1_3\" -arm_compliance_z 2.5E-05\n#\nJOINT_CALIB:\n\n"
      "      -name \"rob1_1\"\n\n      -name \"rob1_2\" -Compl 1.5E-06\n";
  folder_.write(moc, text(moc) + measured);
  ASSERT_EQ(run({"-o", file("cell.yaml"), "--json", file("j.json")}), 0);
  const Chain robot = read_cell(file("cell.yaml"))->robot;
  EXPECT_EQ(robot.joint(0).compliance_prior, 0);
  EXPECT_NEAR(robot.joint(1).compliance_prior, 1.5e-6, 1e-15);
  EXPECT_LT(farthest_apart(robot, read_robot(kRobot).value()), 1e-12) << "offsets are not taken";
  const auto json = nlohmann::json::parse(text("j.json"));
  ASSERT_EQ(json["factory"].size(), 4u) << json["factory"].dump();
  EXPECT_EQ(json["factory"][0]["name"], "error_offset_x");
  EXPECT_EQ(json["factory"][0]["unit"], "m");
  EXPECT_EQ(json["factory"][0]["axis"], 1);
  EXPECT_NE(json["notes"].dump().find("3 values of ARM_CALIB"), std::string::npos);
  folder_.write(moc, replaced(text(moc), "-Compl 1.5E-06", "-Compl much"));
  EXPECT_EQ(run({"-o", file("cell.yaml")}), 3);
}

TEST_F(ImportBackup, ATypeOfWhichNoRobotFileShipsIsNamed) {
  const std::string good = text(moc);
  for (const char* type : {"ROB1_4600_2.55_40", "ROB1_6640_3.2_130", "ROB1_6640_2.75_130"}) {
    folder_.write(moc, replaced(good, "ROB1_6640_205_275", type));
    const auto [code, said] = told({"-o", file("cell.yaml")});
    EXPECT_EQ(code, 3) << type;
    EXPECT_NE(said.find(type), std::string::npos) << said;
    EXPECT_NE(said.find("--robot names its file"), std::string::npos) << said;
    EXPECT_FALSE(std::filesystem::exists(file("cell.yaml")));
    EXPECT_FALSE(std::filesystem::exists(file("cell-robot.yaml")));
  }
  folder_.write(moc, replaced(good, "ROB1_6640_205_275", "ROB1_6640_2.75_205"));
  EXPECT_EQ(run({"-o", file("cell.yaml")}), 0) << "as newer controllers spell it";
}

TEST_F(ImportBackup, OfAFanucAndAYaskawaTheTypeSelectsAShippedRobotOrIsNamed) {
  clear_backup();
  folder_.write("backup/SYSFRAME.VA",
                "[*SYSTEM*]$MNUTOOL  Storage: SHADOW\n    [1,2] = \n"
                "  X:   100.000   Y:      .000   Z:   150.000\n"
                "  W:      .000   P:   -45.000   R:      .000\n");
  EXPECT_EQ(told({"-o", file("c.yaml")}).first, 3) << "nobody says which robot it is";
  const std::string id =
      "[*SYSTEM*]$SCR_GRP\n     Field: $SCR_GRP[1].$ROBOT_ID Access: RO: STRING[37] = '{}'\n";
  folder_.write("backup/SYSVARS.VA", fmt::format(fmt::runtime(id), "M-20iA"));
  ASSERT_EQ(run({"-o", file("c.yaml")}), 0);
  EXPECT_EQ(read_cell(file("c.yaml"))->robot.name(), "FANUC M-20iA");
  folder_.write("backup/SYSVARS.VA", fmt::format(fmt::runtime(id), "R-2000iC/165F"));
  EXPECT_NE(told({"-o", file("d.yaml")}).second.find("R-2000iC/165F"), std::string::npos);
  std::filesystem::remove(file("backup/SYSVARS.VA"));
  folder_.write("backup/SUMMARY.DG",
                "Robot No. : F1\nM-20iA        V9.30P/15 \nServo Code   : V09\n");
  EXPECT_EQ(run({"-o", file("e.yaml")}), 0);

  clear_backup();
  folder_.write("backup/TOOL.CND",
                "//TOOL 1\n///NAME SPINDLE\n100.000,0.000,150.000,0.0000,-45.0000,0.0000\n"
                "0.000,0.000,100.000\n10.000\n0.000,0.000,0.000\n");
  const std::string system = "/SYSTEM 8\n//ROBOT NAME\nR1 : 1-06VX25-A0*({})    0011_1111\n";
  folder_.write("backup/SYSTEM.SYS", fmt::format(fmt::runtime(system), "GP25"));
  ASSERT_EQ(run({"-o", file("f.yaml")}), 0);
  EXPECT_EQ(read_cell(file("f.yaml"))->robot.name(), "Yaskawa Motoman GP25");
  folder_.write("backup/SYSTEM.SYS", fmt::format(fmt::runtime(system), "GP88"));
  const auto [code, said] = told({"-o", file("g.yaml")});
  EXPECT_EQ(code, 3);
  EXPECT_NE(said.find("GP88"), std::string::npos) << said;
}

TEST_F(ImportBackup, AWorkObjectWithTwoValuesIsLeftOutAndNamedWithBoth) {
  const std::string belt =
      "MODULE {}\n  TASK PERS wobjdata "
      "wBelt:=[FALSE,TRUE,\"\",[[{},0,500],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n"
      "  PERS loaddata lBelt:=[{},[0,0,50],[1,0,0,0],0,0,0];\nENDMODULE\n";
  folder_.write("backup/RAPID/TASK1/PROGMOD/a.mod", fmt::format(fmt::runtime(belt), "A", 1500, 4));
  folder_.write("backup/RAPID/TASK1/PROGMOD/b.mod", fmt::format(fmt::runtime(belt), "B", 700, 5));
  ASSERT_EQ(run({"-o", file("cell.yaml"), "--name", "c", "--robot", kRobot, "--frames",
                 file("frames.csv"), "--json", file("j.json")}),
            0);
  EXPECT_NE(text("frames.csv").find("wPanel,"), std::string::npos);
  EXPECT_EQ(text("frames.csv").find("wBelt"), std::string::npos);
  EXPECT_EQ(text("cell.yaml").find("lBelt"), std::string::npos);
  const std::string notes = nlohmann::json::parse(text("j.json"))["notes"].dump();
  for (const char* part : {"wBelt", "a.mod line 2", "[1500.000, ", "b.mod line 2", "[700.000, ",
                           "lBelt", "a.mod line 3"})
    EXPECT_NE(notes.find(part), std::string::npos) << part << ": " << notes;
}

TEST_F(ImportBackup, OfAFanucToolsAndFramesComeFromItsSystemVariables) {
  std::filesystem::remove_all(file("backup"));
  std::filesystem::create_directories(file("backup"));
  folder_.write("backup/SYSFRAME.VA",
                "[*SYSTEM*]$MNUFRAME  Storage: SHADOW\n    [1,1] =   'panel'\n"
                "  X:  1800.000   Y:  -250.000   Z:   800.000\n"
                "  W:      .000   P:      .000   R:      .000\n"
                "[*SYSTEM*]$MNUTOOL  Storage: SHADOW\n    [1,2] = \n"
                "  X:   100.000   Y:      .000   Z:   150.000\n"
                "  W:      .000   P:   -45.000   R:      .000\n");
  ASSERT_EQ(run({"-o", file("cell.yaml"), "--name", "c", "--robot", kRobot, "--frames",
                 file("frames.csv")}),
            0);
  const Cell cell = read_cell(file("cell.yaml")).value();
  ASSERT_TRUE(cell.tools.contains("UTOOL[2]"));
  EXPECT_LT((cell.tools.at("UTOOL[2]")->translation() - Vector3(.1, 0, .15)).norm(), 1e-9);
  EXPECT_NE(text("frames.csv").find("UFRAME[1],1800,-250,800,1,0,0,0"), std::string::npos)
      << text("frames.csv");
  EXPECT_TRUE(differing(file("cell.yaml")).empty());
}

/// As a controller of two groups writes it, with all that lies beside it in a full backup.
TEST_F(ImportBackup, OfAWholeFanucBackupTheFramesComeFromItsSystemVariablesWhateverLiesBeside) {
  clear_backup();
  folder_.write(
      "backup/SYSFRAME.VA",
      "[*SYSTEM*]$MNUFRAME  Storage: SHADOW  Access: RW  : ARRAY[2,20] OF POSITION\r\n"
      "    [1,1] =   'panel'  Group: 1   Config: N D B, 0, 0, 0\r\n"
      "  X:  1800.000   Y:  -250.000   Z:   800.000\r\n"
      "  W:      .000   P:      .000   R:      .000\r\n"
      "    [1,2] =   ''  Uninitialized\r\n    [2,1] = \r\n  Group: 2\r\n"
      "  X:  9999.000   Y:  -250.000   Z:   800.000\r\n"
      "  W:      .000   P:      .000   R:      .000\r\n"
      "[*SYSTEM*]$MNUFRAMENUM  Storage: SHADOW  Access: RW  : ARRAY[2] OF BYTE\r\n    [1] = 1\r\n"
      "[*SYSTEM*]$MNUTOOL  Storage: SHADOW  Access: RW  : ARRAY[2,20] OF POSITION\r\n"
      "    [1,2] = \r\n  Group: 1   Config: N D B, 0, 0, 0\r\n"
      "  X:   100.000   Y:      .000   Z:   150.000\r\n"
      "  W:      .000   P:   -45.000   R:      .000\r\n");
  folder_.write("backup/FRAMEVAR.VA",
                "[TPFDEF]SETUP_DATA  Storage: CMOS  Access: RW  : ARRAY[2,3,20] OF FRMSET_T\n"
                "     Field: SETUP_DATA[1,1,2].$COMMENT Access: RW: STRING[29] = 'SPINDLE'\n");
  for (const char* beside : {"HISTORY.DAT", "VISION.SUB", "ERRALL.LS", "SYSHOST.SV"})
    folder_.write(std::string("backup/") + beside, "x\n");
  const auto [code, said] = told(
      {"-o", file("cell.yaml"), "--name", "c", "--robot", kRobot, "--frames", file("frames.csv")});
  ASSERT_EQ(code, 0) << said;
  const Cell cell = read_cell(file("cell.yaml")).value();
  ASSERT_EQ(cell.tools.size(), 1u);
  EXPECT_LT((cell.tools.at("UTOOL[2]")->translation() - Vector3(.1, 0, .15)).norm(), 1e-9);
  EXPECT_NE(text("frames.csv").find("UFRAME[1],1800,-250,800,1,0,0,0"), std::string::npos)
      << text("frames.csv");
  EXPECT_EQ(text("frames.csv").find("UFRAME[2]"), std::string::npos) << "it was never set";
}

TEST_F(ImportBackup, OfAYaskawaToolsLoadsAndFramesComeFromItsConditionFiles) {
  std::filesystem::remove_all(file("backup"));
  std::filesystem::create_directories(file("backup"));
  folder_.write("backup/TOOL.CND",
                "//TOOL 0\n///NAME \n0.000,0.000,0.000,0.0000,0.0000,0.0000\n0.000,0.000,0.000\n"
                "0.000\n0.000,0.000,0.000\n//TOOL 1\n///NAME SPINDLE\n"
                "100.000,0.000,150.000,0.0000,-45.0000,0.0000\n0.000,0.000,100.000\n100.000\n"
                "0.000,0.000,0.000\n");
  ASSERT_EQ(run({"-o", file("cell.yaml"), "--name", "c", "--robot", kRobot}), 0);
  const Cell cell = read_cell(file("cell.yaml")).value();
  ASSERT_TRUE(cell.tools.contains("TOOL[1]"));
  EXPECT_NEAR(cell.payloads.at("TOOL[1]").mass, 100, 1e-9);
}

TEST_F(ImportBackup, OfManyToolsWithoutALoadOneNoteTellsTheirNumber) {
  clear_backup();
  std::string tools;
  for (int k = 0; k < 31; ++k)
    tools += fmt::format(
        "//TOOL {}\n///NAME \n{}.000,0.000,150.000,0.0000,0.0000,0.0000\n0.000,0.000,0.000\n"
        "0.000\n0.000,0.000,0.000\n",
        k, k + 1);
  folder_.write("backup/TOOL.CND", tools);
  ASSERT_EQ(
      run({"-o", file("cell.yaml"), "--name", "c", "--robot", kRobot, "--json", file("j.json")}),
      0);
  std::vector<std::string> without;
  const auto told_json = nlohmann::json::parse(text("j.json"));
  for (const auto& note : told_json["notes"])
    if (note.get<std::string>().find("no load") != std::string::npos)
      without.push_back(note.get<std::string>());
  ASSERT_EQ(without.size(), 1u);
  EXPECT_EQ(
      without[0].rfind("31 tools have no load there (TOOL[0], TOOL[10], TOOL[11] and 28 more)", 0),
      0u)
      << without[0];
}

TEST_F(ImportBackup, RefusesListsWithoutATool) {
  for (const char* name : {"$machine.dat", "sysframe.va", "TRIM1.JBI"}) {
    std::filesystem::remove_all(file("backup"));
    std::filesystem::create_directories(file("backup"));
    folder_.write(std::string("backup/") + name, "x\n");
    testing::internal::CaptureStderr();
    EXPECT_EQ(run({"-o", file("cell.yaml"), "--name", "c", "--robot", kRobot}), 3);
    const std::string said = testing::internal::GetCapturedStderr();
    EXPECT_NE(said.find("no tool in the controller's own lists"), std::string::npos) << said;
    EXPECT_EQ(said.find("MOC.cfg"), std::string::npos) << said;
  }
}

class ImportKuka : public ImportBackup {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(file("backup/KRC/R1/Mada"));
    std::filesystem::create_directories(file("backup/KRC/R1/System"));
    folder_.write(machine, kMachine);
    folder_.write(config, kConfig);
  }
  int make() {
    return run({"-o", file("cell.yaml"), "--name", "cell-3", "--robot", kKuka, "--frames",
                file("frames.csv"), "--json", file("j.json")});
  }
  std::string notes() const { return nlohmann::json::parse(text("j.json"))["notes"].dump(); }

  static constexpr const char* kMachine =
      "DEFDAT $MACHINE PUBLIC\n$TRAFONAME[]=\"#KR210R2700 EXTRA C4 FLR\"\n$NUM_AX=6\n"
      "$LENGTH_A=350.0\n$LENGTH_B=1150.0\n"
      "FRAME $ROBROOT={X 0.0,Y 0.0,Z 600.0,A 90.0,B 0.0,C 0.0}\n"
      "REAL $SOFTN_END[12]\n$SOFTN_END[1]=-180.0\n$SOFTN_END[2]=-135.0\n"
      "$SOFTN_END[3]=-115.0\n$SOFTN_END[4]=-345.0\n$SOFTN_END[5]=-120.0\n"
      "$SOFTN_END[6]=-345.0\n$SOFTP_END[1]=180.0\n$SOFTP_END[2]=-10.0\n$SOFTP_END[3]=150.0\n"
      "$SOFTP_END[4]=345.0\n$SOFTP_END[5]=120.0\n$SOFTP_END[6]=345.0\nENDDAT\n";
  /// What makes an arm of it, as controllers have it behind the rest.
  static constexpr const char* kArm =
      "DECL KINCLASS $KINCLASS=#STANDARD ;KINEMATIC CLASS\nINT $TRAFO_AXIS=6\n"
      "DECL MAIN_AXIS $MAIN_AXIS=#NR ;SS, CC, NR\nDECL WRIST_AXIS $WRIST_AXIS=#ZEH ;NOH, ZEH\n"
      "BOOL $DEF_A4FIX=FALSE\nBOOL $DEF_A5LINK=FALSE\nINT $AXIS_DIR[12]\n$AXIS_DIR[1]=-1\n"
      "$AXIS_DIR[2]=1\n$AXIS_DIR[3]=1\n$AXIS_DIR[4]=-1\n$AXIS_DIR[5]=-1\n$AXIS_DIR[6]=-1\n"
      "FRAME $TIRORO={X 0.0,Y 0.0,Z 675.000,A 0.0,B 0.0,C 0.0}\n"
      "FRAME $TFLWP={X 0.0,Y 0.0,Z 215.000,A 0.0,B 0.0,C 0.0} ;FLANGE\n"
      "FRAME $TX3P3={X 1200.00,Y 0.0,Z -41.0000,A 0.0,B 90.0000,C 0.0}\n"
      "DECL DHART $DH_4={DHART_A 0.0,DHART_D 0.0,DHART_ALPHA 90.0000}\n"
      "DECL DHART $DH_5={DHART_A 0.0,DHART_D 0.0,DHART_ALPHA -90.0000}\n"
      "DECL FRA $RAT_MOT_AX[12]\n$RAT_MOT_AX[1]={N -1800,D 8}\nREAL $VEL_AXIS_MA[12]\n"
      "$VEL_AXIS_MA[1]=4500.00\nENDDAT\n";
  static std::string with_arm() { return replaced(kMachine, "ENDDAT\n", kArm); }

  static constexpr const char* kConfig =
      "DEFDAT $CONFIG PUBLIC\nDECL FRAME TOOL_DATA[16]\nDECL CHAR TOOL_NAME[16,24]\n"
      "TOOL_DATA[1]={X 100.0,Y 0.0,Z 150.0,A 0.0,B -45.0,C 0.0}\nTOOL_NAME[1,]=\"Drill end\"\n"
      "LOAD_DATA[1]={M 100.0,CM {X 0.0,Y 0.0,Z 100.0,A 0.0,B 0.0,C 0.0},J {X 0.0,Y 0.0,Z 0.0}}\n"
      "TOOL_DATA[2]={X 0.0,Y 0.0,Z 50.0,A 0.0,B 0.0,C 0.0}\n"
      "LOAD_DATA[2]={M -1.0,CM {X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0},J {X 0.0,Y 0.0,Z 0.0}}\n"
      "TOOL_DATA[3]={X 900.0,Y 0.0,Z 50.0,A 0.0,B 0.0,C 0.0}\nTOOL_TYPE[3]=#TCP\n"
      "TOOL_DATA[4]={X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\n"
      "BASE_DATA[1]={X 0.0,Y 2000.0,Z 600.0,A 90.0,B 0.0,C 0.0}\n"
      "BASE_DATA[2]={X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\nENDDAT\n";
  const std::string kKuka = TRAMMEL_SOURCE_DIR "/models/kuka_kr210-r2700-extra.yaml";
  const std::string machine = "backup/KRC/R1/Mada/$machine.dat",
                    config = "backup/KRC/R1/System/$config.dat";
};

TEST_F(ImportKuka, MakesACellOfWhatTheControllerHas) {
  ASSERT_EQ(make(), 0);
  const Cell cell = read_cell(file("cell.yaml")).value();
  ASSERT_TRUE(cell.X_WB);
  EXPECT_LT((cell.X_WB->translation() - Vector3(0, 0, .6)).norm(), 1e-9);
  EXPECT_LT((cell.X_WB->linear().col(0) - Vector3::UnitY()).norm(), 1e-9);
  ASSERT_EQ(cell.tools.size(), 2u);
  EXPECT_LT((cell.tools.at("Drill_end")->translation() - Vector3(.1, 0, .15)).norm(), 1e-9);
  EXPECT_LT((cell.tools.at("tool_2")->translation() - Vector3(0, 0, .05)).norm(), 1e-9);
  EXPECT_NEAR(cell.payloads.at("Drill_end").mass, 100, 1e-9);
  ASSERT_EQ(cell.joint_ranges.size(), 6u);
  EXPECT_NEAR(to_deg(cell.joint_ranges[1].first), -135, 1e-3);
  EXPECT_NEAR(to_deg(cell.joint_ranges[1].second), -10, 1e-3);
}

TEST_F(ImportKuka, GivesBasesAsTheRobotSeesThem) {
  ASSERT_EQ(make(), 0);
  EXPECT_NE(text("frames.csv").find("robot_base,0,0,600,"), std::string::npos);
  EXPECT_NE(text("frames.csv").find("BASE_DATA[1],2000,"), std::string::npos) << text("frames.csv");
  EXPECT_EQ(text("frames.csv").find("BASE_DATA[2]"), std::string::npos) << "it was never set";
}

TEST_F(ImportKuka, SaysWhatTheFilesDoNotTell) {
  ASSERT_EQ(make(), 0);
  EXPECT_FALSE(read_cell(file("cell.yaml"))->payloads.contains("tool_2"));
  for (const char* part :
       {"tool tool_2 has no load", "TOOL_DATA[3]", "controller_compensates by hand"})
    EXPECT_NE(notes().find(part), std::string::npos) << part << ": " << notes();
}

TEST_F(ImportKuka, TellsWhereACellDiffers) {
  ASSERT_EQ(make(), 0);
  EXPECT_TRUE(differing(file("cell.yaml")).empty());
  change(config, "Z 150.0", "Z 153.5");
  const std::vector<std::string> found = differing(file("cell.yaml"));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NE(found[0].find("3.500 mm"), std::string::npos) << found[0];
}

TEST_F(ImportKuka, WritesTheRobotOfItsMachineDataEqualToTheDrawing) {
  folder_.write(machine, with_arm());
  ASSERT_EQ(run({"-o", file("cell-3.yaml")}), 0);
  const Cell cell = read_cell(file("cell-3.yaml")).value();
  EXPECT_EQ(cell.robot.name(), "KUKA KR210R2700 EXTRA C4 FLR");
  EXPECT_LT(farthest_apart(cell.robot, read_robot(kKuka).value()), 1e-9);
  EXPECT_NEAR(to_deg(cell.robot.joint(1).lower), -135, 1e-9) << "the controller's own limits";
  EXPECT_NEAR(cell.robot.joint(0).gear_ratio, 225, 1e-9);
  EXPECT_NEAR(to_deg(cell.robot.joint(0).max_speed.value()), 120, 1e-9);
  EXPECT_FALSE(cell.robot.joint(1).max_speed);
  EXPECT_EQ(run({"--compare", file("cell-3.yaml")}), 0);
}

TEST_F(ImportKuka, AnArmThatDoesNotShipIsWrittenFromItsMachineData) {
  std::string data = replaced(with_arm(), "Z 675.000", "Z 645.000");
  data = replaced(data, "$LENGTH_A=350.0", "$LENGTH_A=330.0");
  data = replaced(data, "X 1200.00,Y 0.0,Z -41.0000", "X 1220.00,Y 0.0,Z 115.0000");
  data = replaced(data, "KR210R2700 EXTRA", "KR120R2700-2");
  folder_.write(machine, data);
  ASSERT_EQ(run({"-o", file("cell.yaml")}), 0);
  const Chain robot = read_cell(file("cell.yaml"))->robot;
  // Stretched out level along x, the flange looks ahead.
  const Pose stretched = robot.flange_pose(JointVector::Zero(6));
  EXPECT_LT((stretched.translation() - Vector3(2.915, 0, .760)).norm(), 1e-9);
  EXPECT_LT((stretched.linear().col(2) - Vector3::UnitX()).norm(), 1e-9);
  JointVector q = JointVector::Zero(6);
  q(1) = from_deg(-90);  // the lower arm upright, the forearm with it
  const Pose upright = robot.flange_pose(q);
  EXPECT_LT((upright.translation() - Vector3(.330 - .115, 0, .645 + 2.585)).norm(), 1e-9);
}

TEST_F(ImportKuka, WithoutLengthsTheShippedRobotOfItsTypeIsTaken) {
  ASSERT_EQ(run({"-o", file("cell.yaml")}), 0);
  EXPECT_EQ(read_cell(file("cell.yaml"))->robot.name(), "KUKA KR 210 R2700 extra");
}

TEST_F(ImportKuka, AnArmOfAnotherKindIsRefusedWithItsTypeAndTheReason) {
  const std::string other = replaced(with_arm(), "KR210R2700 EXTRA", "KR 40 PA");
  for (const auto& [what, by, why] :
       {std::tuple("=#ZEH", "=#SRH", "$WRIST_AXIS is #SRH"),
        std::tuple("=#NR", "=#SS", "$MAIN_AXIS is #SS"),
        std::tuple("$DEF_A5LINK=FALSE", "$DEF_A5LINK=TRUE", "$DEF_A5LINK is TRUE"),
        std::tuple("$AXIS_DIR[4]=-1\n", "", "$AXIS_DIR[4] is not in the files"),
        std::tuple("Z -41.0000,A 0.0", "Z -41.0000,A 10.0", "at a right angle to axis 3")}) {
    folder_.write(machine, replaced(other, what, by));
    const auto [code, said] = told({"-o", file("cell.yaml")});
    EXPECT_EQ(code, 3) << by;
    EXPECT_NE(said.find("KR 40 PA"), std::string::npos) << said;
    EXPECT_NE(said.find(why), std::string::npos) << said;
  }
}

TEST_F(ImportKuka, RefusesAnotherRobotAndABackupWithoutTools) {
  change(machine, "$LENGTH_B=1150.0", "$LENGTH_B=1300.0");
  EXPECT_EQ(make(), 3) << "longer";
  folder_.write(machine, kMachine);
  folder_.write(config, "DEFDAT $CONFIG PUBLIC\nENDDAT\n");
  EXPECT_EQ(make(), 3) << "no tool";
}

TEST_F(ImportBackup, RefusesTheBackupOfAnotherRobotThanTheRobotFileIsOf) {
  ASSERT_EQ(run({"-o", file("cell.yaml"), "--name", "c", "--robot", kRobot}), 0);
  const std::string good = text(moc);
  change(moc, " -use_joint_4 \"rob1_5\" -use_joint_5 \"rob1_6\"", "");
  EXPECT_EQ(run({"-o", file("four.yaml"), "--name", "c", "--robot", kRobot}), 3) << "four axes";
  EXPECT_EQ(run({"--compare", file("cell.yaml")}), 3);
  folder_.write(moc, replaced(good, "ROB1_6640_205_275", "ROB1_4400_60_1.96"));
  EXPECT_EQ(run({"-o", file("type.yaml"), "--name", "c", "--robot", kRobot}), 3) << "another type";
  EXPECT_EQ(run({"--compare", file("cell.yaml")}), 3);
  EXPECT_FALSE(std::filesystem::exists(file("type.yaml")));
}

TEST_F(ImportBackup, TextInUtf16IsRefusedAsSuch) {
  const auto in_utf16 = [](const std::string& text) {
    std::string wide;
    for (const char c : text) wide += {c, '\0'};
    return wide;
  };
  const auto parameters = cam::read_backup(in_utf16(text(moc)), "MOC.cfg", {}, "");
  ASSERT_FALSE(parameters);
  EXPECT_NE(sentence(parameters.error()).find("MOC.cfg: text in UTF-16"), std::string::npos);
  const auto modules =
      cam::read_backup(text(moc), "MOC.cfg", {{"user.sys", in_utf16(text(user))}}, "");
  ASSERT_FALSE(modules);
  EXPECT_NE(sentence(modules.error()).find("user.sys: text in UTF-16"), std::string::npos);
}

TEST_F(ImportBackup, AnythingMayStandInTheParameters) {
  const std::string good = text(moc);
  for (std::size_t cut = 0; cut < good.size(); cut += 7)
    static_cast<void>(cam::read_backup(good.substr(0, cut), "MOC.cfg", {}, ""));
  for (const char* odd : {"", "\\", "ROBOT:", "ROBOT:\n-", "ROBOT:\n-name \"", "ROBOT:\n-name\\",
                          ":\n-a b", "\n\n\\\n"})
    EXPECT_FALSE(cam::read_backup(odd, "MOC.cfg", {}, "ROB_1")) << odd;
}

}  // namespace
}  // namespace trammel::cli
