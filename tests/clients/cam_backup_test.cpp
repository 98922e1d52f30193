#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "clients/cam/backup/backup.h"
#include "clients/cam/stated_robot.h"
#include "clients/cli/files/program_files.h"
#include "tests/support/shifting_model.h"
#include "tests/support/temporary_folder.h"

// The backup of an ABB controller as a program: its modules are corrected for the robot that its
// parameters describe.
namespace trammel::cli {
namespace {

std::string module_of(const std::string& name) {
  return "MODULE " + name +
         "\n  PERS tooldata "
         "tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,"
         "0,0]];\n  CONST robtarget "
         "p10:=[[1800,-250,800],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n"
         "  PROC main()\n    MoveL p10,v100,fine,tSpindle;\n  ENDPROC\nENDMODULE\n";
}

std::string robot(const std::string& number, const std::string& more,
                  const std::string& type = "6640_2.75_205", int axes = 6) {
  std::string text = "      -name \"ROB_" + number + "\" -use_robot_type \"ROB" + number + "_" +
                     type + "\" " + more;
  for (int k = 0; k < axes; ++k)
    text += fmt::format(" -use_joint_{} \"rob{}_{}\"", k, number, k + 1);
  return text + "\n\n";
}

class BackupAsProgram : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* task : {"TASK1", "TASK2"}) std::filesystem::create_directories(path(task));
    std::filesystem::create_directories(folder_.file("backup/SYSPAR"));
    folder_.write("backup/RAPID/TASK1/PROGMOD/a.mod", module_of("A"));
  }
  std::string path(const std::string& task) const {
    return folder_.file("backup/RAPID/" + task + "/PROGMOD");
  }
  void write_parameters(const std::string& robots) {
    folder_.write("backup/SYSPAR/MOC.cfg", "MOC:CFG_1.0:6:0::\n#\nROBOT:\n\n" + robots);
  }
  /// What becomes of it; the sentence where it is refused.
  test::Corrected corrected(const std::string& task = "", const std::string& frames = "") {
    const auto files = read_program_files({folder_.file("backup")}, "", task);
    if (!files) return {{}, sentence(files.error())};
    const auto program = understood_program(*files, {}, frames);
    if (!program) return {{}, sentence(program.error())};
    cam::CorrectProgramOptions options;
    auto done = cam::correct_program(*program, test::small_cell("cam")->robot, test::spindle_only(),
                                     test::shift, options);
    if (!done) return {{}, sentence(done.error())};
    return {std::move(*done), ""};
  }
  static Vector3 wanted(const test::Corrected& made) {
    return test::row_of(made.program, "p10").p_B;
  }

  test::TemporaryFolder folder_;
};

TEST_F(BackupAsProgram, TheRobotStandsWhereTheSystemParametersSay) {
  write_parameters(robot("1", "-base_frame_pos_z 0.3 -base_frame_pos_y 0.1"));
  const test::Corrected made = corrected();
  ASSERT_EQ(made.refusal, "");
  EXPECT_LT((wanted(made) - Vector3(1.8, -.35, .5)).norm(), 1e-12) << wanted(made).transpose();
  ASSERT_FALSE(made.program.notes.empty());
  EXPECT_NE(made.program.notes[0].find("SYSPAR/MOC.cfg line"), std::string::npos)
      << made.program.notes[0];
  write_parameters(robot("1", ""));
  EXPECT_LT((wanted(corrected()) - Vector3(1.8, -.25, .8)).norm(), 1e-12);
}

TEST_F(BackupAsProgram, ARowThatStandsTheRobotElsewhereIsRefusedWithBothPlaces) {
  write_parameters(robot("1", "-base_frame_pos_z 0.3"));
  const std::string head = "name,x_mm,y_mm,z_mm,qw,qx,qy,qz\nrobot_base,0,0,";
  folder_.write("same.csv", head + "300,1,0,0,0\n");
  folder_.write("other.csv", head + "600,1,0,0,0\n");
  EXPECT_EQ(corrected("", folder_.file("same.csv")).refusal, "");
  const std::string refusal = corrected("", folder_.file("other.csv")).refusal;
  for (const char* part :
       {"robot_base of --frames", "SYSPAR/MOC.cfg", "300.000 mm and 0.0000 deg apart"})
    EXPECT_NE(refusal.find(part), std::string::npos) << refusal;
}

TEST_F(BackupAsProgram, OfTwoRobotsATaskSaysWhich) {
  write_parameters(robot("1", "") + robot("2", "-base_frame_pos_y 3.0"));
  std::string other = module_of("B");
  other.replace(other.find("-250"), 4, "2750");
  folder_.write("backup/RAPID/TASK2/PROGMOD/b.mod", other);
  const std::string refusal = corrected().refusal;
  EXPECT_NE(refusal.find("2 robots: ROB_1, ROB_2"), std::string::npos) << refusal;
  EXPECT_NE(refusal.find("--task says which"), std::string::npos) << refusal;
  const test::Corrected first = corrected("TASK1"), second = corrected("task2");
  ASSERT_EQ(first.refusal + second.refusal, "");
  EXPECT_EQ(first.program.moves, 1u);
  EXPECT_LT((wanted(first) - Vector3(1.8, -.25, .8)).norm(), 1e-12);
  EXPECT_EQ(second.program.moves, 1u);
  EXPECT_LT((wanted(second) - Vector3(1.8, -.25, .8)).norm(), 1e-12);
  EXPECT_NE(corrected("TASK7").refusal.find("no programs of a task TASK7"), std::string::npos);
}

TEST_F(BackupAsProgram, WhatAnotherTaskSetsOfASharedPersistentCountsThoughItIsNotTaken) {
  write_parameters(robot("1", "") + robot("2", ""));
  const std::string other = module_of("B");
  folder_.write("backup/RAPID/TASK2/PROGMOD/b.mod", other);
  EXPECT_TRUE(test::row_of(corrected("TASK1").program, "p10").corrected());
  std::string sets = other;
  sets.insert(sets.find("    MoveL"), "    tSpindle.tframe.trans.z:=nWear;\n");
  folder_.write("backup/RAPID/TASK2/PROGMOD/b.mod", sets);
  const std::string why = test::row_of(corrected("TASK1").program, "p10").message;
  EXPECT_NE(why.find("tSpindle is set at run time (RAPID/TASK2/PROGMOD/b.mod line 5)"),
            std::string::npos)
      << why;
}

TEST_F(BackupAsProgram, AnotherRobotThanTheCellsIsRefusedByTypeAndByAxes) {
  write_parameters(robot("1", "", "910SC_0.65_6", 4));
  const std::string scara = corrected().refusal;
  EXPECT_NE(scara.find("ROB1_910SC_0.65_6"), std::string::npos) << scara;
  EXPECT_NE(scara.find("4 turning axes"), std::string::npos) << scara;
  write_parameters(robot("1", "", "360_1_1130", 4));
  EXPECT_NE(corrected().refusal.find("ROB1_360_1_1130"), std::string::npos);
  write_parameters(robot("1", "", "4400_60_1.96"));
  EXPECT_NE(corrected().refusal.find("ROB1_4400_60_1.96"), std::string::npos)
      << "six axes, a parallel arm";
}

TEST_F(BackupAsProgram, CoupledAxesAndAnotherReachThanTheRobotFilesAreRefusedWithBothValues) {
  write_parameters(robot("1", "", "6640_2.55_180"));
  const std::string reach = corrected().refusal;
  EXPECT_NE(reach.find("says ROB1_6640_2.55_180, the robot file is of ABB IRB 6640-205/2.75"),
            std::string::npos)
      << reach;
  const std::string arm = "#\nARM:\n\n      -name \"rob1_3\" -coupled_upper_joint_bound ";
  write_parameters(robot("1", "") + arm + "1.2\n");
  const std::string coupled = corrected().refusal;
  for (const char* part :
       {"coupled_upper_joint_bound 1.2 says that axis 3 follows another one",
        "SYSPAR/MOC.cfg row 10", "the robot file of ABB IRB 6640-205/2.75 has no coupling of it"})
    EXPECT_NE(coupled.find(part), std::string::npos) << coupled;
  write_parameters(robot("1", "") + arm + "0\n");
  EXPECT_EQ(corrected().refusal, "");
}

TEST(StatedRobot, AnArmWhoseAxis3IsHeldByBarsNeedsThatCouplingInItsRobotFile) {
  cam::Program program;
  program.types.push_back({"ROB1_2400_1.55_16", "use_robot_type", "MOC.cfg", 5});
  const Chain six = test::small_cell("cam")->robot;
  std::vector<Joint> joints;
  for (int j = 0; j < six.size(); ++j) joints.push_back(six.joint(j));
  const auto arm = [&](std::vector<Coupling> couplings) {
    return Chain::make("ABB IRB 2400-16/1.55", joints, std::move(couplings)).value();
  };
  const Status none = cam::check_stated_robot(program, arm({}));
  ASSERT_FALSE(none);
  EXPECT_NE(sentence(none.error()).find("an arm whose axis 3 is held by bars"), std::string::npos);
  EXPECT_FALSE(cam::check_stated_robot(program, arm({{2, 1, -1, CouplingKind::kController}})));
  EXPECT_TRUE(cam::check_stated_robot(program, arm({{2, 1, -1, CouplingKind::kParallelogram}})));
}

TEST_F(BackupAsProgram, WhereAnotherUnitCarriesTheRobotItsBaseIsNotTakenAndANoteSaysSo) {
  write_parameters(robot("1", "-base_frame_coordinated \"TRACK\" -base_frame_pos_z 0.3"));
  const test::Corrected made = corrected();
  EXPECT_LT((wanted(made) - Vector3(1.8, -.25, .8)).norm(), 1e-12);
  ASSERT_FALSE(made.program.notes.empty());
  EXPECT_NE(made.program.notes[0].find("TRACK carries ROB_1"), std::string::npos)
      << made.program.notes[0];
}

}  // namespace
}  // namespace trammel::cli
