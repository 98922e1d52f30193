#include "clients/cam/backup/backup.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

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
  EXPECT_EQ(run({"-o", file("cell.yaml"), "--name", "c"}), 2) << "no robot file";
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
