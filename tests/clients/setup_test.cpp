#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <utility>

#include "clients/cli/command_line.h"
#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/measurement/files/joint_list.h"
#include "server/robot/cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel::cli {
namespace {

const std::string kArmOfModules = TRAMMEL_SOURCE_DIR "/models/abb_irb6640-205-275.yaml";

/// From a folder that a controller gives away to a cell.
class Setup : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(file("in/KRC/R1/Mada"));
    std::filesystem::create_directories(file("in/KRC/R1/System"));
    std::filesystem::create_directories(file("in/KRC/R1/Program"));
    folder_.write("in/KRC/R1/Mada/$machine.dat",
                  "DEFDAT $MACHINE PUBLIC\n$TRAFONAME[]=\"#KR210R2700 EXTRA C4 FLR\"\n$NUM_AX=6\n"
                  "$LENGTH_A=350.0\n$LENGTH_B=1150.0\nENDDAT\n");
    folder_.write("in/KRC/R1/System/$config.dat",
                  "DEFDAT $CONFIG PUBLIC\n"
                  "TOOL_DATA[1]={X 0.0,Y 0.0,Z 300.0,A 0.0,B 0.0,C 0.0}\nTOOL_NAME[1,]=\"gun\"\n"
                  "TOOL_DATA[2]={X 100.0,Y 0.0,Z 150.0,A 0.0,B -45.0,C 0.0}\n"
                  "TOOL_NAME[2,]=\"spindle\"\nLOAD_DATA[2]={M 100.0,CM {X 0.0,Y 0.0,Z 100.0,A 0.0,"
                  "B 0.0,C 0.0},J {X 0.0,Y 0.0,Z 0.0}}\n"
                  "BASE_DATA[1]={X 2000.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\nENDDAT\n");
    folder_.write("in/KRC/R1/Program/drill.src",
                  "DEF drill( )\nBAS(#TOOL,2)\nBAS(#BASE,1)\n"
                  "LIN {X 0.0,Y 0.0,Z 1200.0,A 0.0,B 90.0,C 0.0}\n"
                  "LIN {X 0.0,Y 100.0,Z 1200.0,A 0.0,B 90.0,C 0.0}\nEND\n");
  }
  int run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "trammel");
    std::vector<const char*> argv;
    for (const std::string& argument : arguments) argv.push_back(argument.c_str());
    return run_command_line(static_cast<int>(argv.size()), argv.data());
  }
  int setup(const std::vector<std::string>& more = {}) {
    std::vector<std::string> all = {"setup",   file("in"), "-o",     file("cell-3"),
                                    "--count", "24",       "--json", file("j.json")};
    all.insert(all.end(), more.begin(), more.end());
    return run(all);
  }
  /// The exit code, and what was said on standard error.
  std::pair<int, std::string> told(const std::vector<std::string>& arguments) {
    testing::internal::CaptureStderr();
    const int code = run(arguments);
    return {code, testing::internal::GetCapturedStderr()};
  }
  std::string file(const std::string& name) const { return folder_.file(name); }
  nlohmann::json json() const {
    return nlohmann::json::parse(read_text_file(file("j.json")).value());
  }
  bool is_missing(const std::string& words) const {
    return json()["missing"].dump().find(words) != std::string::npos;
  }

  test::TemporaryFolder folder_;
};

TEST_F(Setup, MakesACellOfAKukasBackup) {
  ASSERT_EQ(setup(), 0);
  const Cell cell = read_cell(file("cell-3/cell.yaml")).value();
  EXPECT_EQ(cell.name, "cell-3");
  EXPECT_EQ(cell.robot.name(), "KUKA KR 210 R2700 extra");
  EXPECT_FALSE(cell.X_WB) << "where the instrument will stand is found from the data";
  EXPECT_EQ(cell.tools.size(), 2u);
  EXPECT_NEAR(cell.payloads.at("spindle").mass, 100, 1e-9);
  EXPECT_EQ(json()["controller"], "krl");
  EXPECT_EQ(json()["tool"], "spindle") << "the program's motions use it";
  EXPECT_EQ(json()["targets"], 2);
  EXPECT_TRUE(std::filesystem::exists(file("cell-3/measure.src")));
  EXPECT_NE(read_text_file(file("cell-3/measure.src"))->find("BAS (#TOOL,2)"), std::string::npos);
}

TEST_F(Setup, MeasuresAboveTheMountingPlaneAndFromBothSides) {
  ASSERT_EQ(setup(), 0);
  const Cell cell = read_cell(file("cell-3/cell.yaml")).value();
  const JointList list = read_joint_csv(file("cell-3/plan.csv")).value();
  ASSERT_EQ(list.poses.size(), 24u);
  int from_above = 0, from_below = 0;
  for (const CommandedPose& pose : list.poses) {
    const Vector3 p =
        cell.robot.flange_pose(pose.context.q) * cell.tools.at("spindle")->translation();
    EXPECT_GE(to_mm(p.z()), 99.9) << pose.pose_id;
    EXPECT_EQ(pose.context.tool, "spindle");
    from_above += pose.context.direction[1] < 0 ? 1 : 0;
    from_below += pose.context.direction[1] > 0 ? 1 : 0;
  }
  EXPECT_GE(from_above, 8);
  EXPECT_GE(from_below, 8);
}

TEST_F(Setup, KeepsToAWorkspaceThatIsTold) {
  ASSERT_EQ(setup({"--workspace", "500,-1500,400,2500,1500,2500"}), 0);
  const Cell cell = read_cell(file("cell-3/cell.yaml")).value();
  ASSERT_TRUE(cell.workspace);
  EXPECT_LT((cell.workspace->lower - Vector3(.5, -1.5, .4)).norm(), 1e-9);
  EXPECT_FALSE(is_missing("fences"));
  EXPECT_EQ(run({"setup", file("in"), "-o", file("other"), "--workspace", "1,2,3"}), 2);
  EXPECT_EQ(run({"setup", file("in"), "-o", file("other"), "--workspace", "5,2,3,1,2,4"}), 2);
}

TEST_F(Setup, SaysWhatIsMissingAndWhatIsTypedNext) {
  ASSERT_EQ(setup({"--tool", "gun"}), 0);
  for (const char* words :
       {"confirm-robot --cell", "tracker: {sigma_mm", "fences and tables", "tool gun has no load"})
    EXPECT_TRUE(is_missing(words)) << words << ": " << json()["missing"].dump();
  const std::vector<std::string> next = json()["next"];
  ASSERT_EQ(next.size(), 4u) << "with setup itself five commands to a corrected program";
  EXPECT_TRUE(next.front().starts_with("trammel convert "));
  EXPECT_TRUE(next.back().starts_with("trammel correct "));
}

TEST_F(Setup, OfAProgramAloneTheRobotIsAskedForAndTheToolTaken) {
  std::filesystem::create_directories(file("modules"));
  folder_.write(
      "modules/m.mod",
      "MODULE M\n  PERS tooldata tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,"
      "0]],[100,[0,0,100],[1,0,0,0],0,0,0]];\n  CONST robtarget p10:=[[1800,0,1000],"
      "[0.669131,0,0.743145,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n"
      "  PROC main()\n    MoveL p10,v100,fine,tSpindle;\n  ENDPROC\nENDMODULE\n");
  const auto [code, said] = told({"setup", file("modules"), "-o", file("cell-7")});
  EXPECT_EQ(code, 3);
  EXPECT_NE(said.find("do not say which robot it is"), std::string::npos) << said;
  EXPECT_FALSE(std::filesystem::exists(file("cell-7")));
  ASSERT_EQ(run({"setup", file("modules"), "-o", file("cell-7"), "--robot", kArmOfModules,
                 "--count", "12"}),
            0);
  const Cell cell = read_cell(file("cell-7/cell.yaml")).value();
  ASSERT_TRUE(cell.tools.contains("tSpindle"));
  EXPECT_NEAR(cell.payloads.at("tSpindle").mass, 100, 1e-9);
  EXPECT_FALSE(std::filesystem::exists(file("cell-7/robot.yaml"))) << "the cell names --robot";
  EXPECT_NE(read_text_file(file("cell-7/measure.mod"))->find("tSpindle"), std::string::npos);
}

TEST_F(Setup, WritesOverNoCellAndIntoNoBackup) {
  ASSERT_EQ(setup(), 0);
  const auto [code, said] = told({"setup", file("in"), "-o", file("cell-3")});
  EXPECT_EQ(code, 3);
  EXPECT_NE(said.find("there is a cell.yaml already"), std::string::npos) << said;
  EXPECT_EQ(run({"setup", file("in"), "-o", file("in/cell")}), 2);
  EXPECT_EQ(run({"setup", file("in"), "-o", file("in")}), 2);
  EXPECT_EQ(run({"setup", file("nowhere"), "-o", file("cell-4")}), 3);
  EXPECT_EQ(run({"setup", file("in"), "-o", file("cell-4"), "--tool", "laser"}), 2);
  EXPECT_FALSE(std::filesystem::exists(file("cell-4")));
}

TEST_F(Setup, FromABackupToACorrectedProgramInFiveCommands) {
  ASSERT_EQ(setup(), 0);
  // A virtual robot stands in for the measuring.
  const std::string truth =
      folder_.write("truth.yaml",
                    "version: 1\nerror_sources:\n  base: {x0_mm: 0.5}\nnoise: {sigma_mm: 0.01}\n"
                    "base: {xyz_mm: [0, 0, 0], q_wxyz: [1, 0, 0, 0]}\n");
  const std::string cell = file("cell-3/cell.yaml"), model = file("cell-3/cell.model");
  ASSERT_EQ(run({"simulate", "--cell", cell, "--truth", truth, "--plan", file("cell-3/plan.csv"),
                 "-o", file("cell-3/batch.csv")}),
            0);
  ASSERT_EQ(run({"train", "--cell", cell, "--batch", file("cell-3/batch.csv"), "--level", "M2",
                 "--bias", "none", "-o", model}),
            0);
  const int corrected = run({"correct", "--model", model, file("in"), "-o", file("out"), "--json",
                             file("r.json"), "--allow-failed"});
  ASSERT_EQ(corrected, 0);
  const auto receipt = nlohmann::json::parse(read_text_file(file("r.json")).value());
  EXPECT_EQ(receipt["moves_corrected"], 2);
}

}  // namespace
}  // namespace trammel::cli
