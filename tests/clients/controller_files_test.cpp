// Files that a controller keeps beside its programs are taken, or said not to be read.
#include <gtest/gtest.h>

#include <filesystem>

#include "clients/cli/command_line.h"
#include "server/base/text_file.h"
#include "server/compensate/model_file.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel::cli {
namespace {

namespace fs = std::filesystem;

constexpr int kNotAll = 1, kWrongUsage = 2, kRefusedData = 3;
const std::string kPrograms = TRAMMEL_SOURCE_DIR "/config/programs/";

const std::string kTools =
    "//TOOL 0\r\n///NAME "
    "\r\n0.000,0.000,0.000,0.0000,0.0000,0.0000\r\n0.000,0.000,0.000\r\n0.000\r\n0.000,0.000,0."
    "000\r\n"
    "//TOOL 1\r\n///NAME SPINDLE "
    "2\r\n100.000,0.000,150.000,0.0000,-45.0000,0.0000\r\n0.000,0.000,100.000\r\n100.000\r\n"
    "0.000,0.000,0.000\r\n";
const std::string kUserFrames =
    "//UFRAME 1\r\n///NAME PANEL\r\n///TOOL 1\r\n///GROUP 1,0,0,0\r\n///PULSE\r\n////RORG "
    "C000=1,2,3,4,5,6\r\n"
    "////BUSER 1800.000,-250.000,800.000,0.0000,0.0000,0.0000\r\n//UFRAME 2\r\n///NAME OTHER\r\n"
    "////BUSER 1.000,2.000,3.000,0.0000,0.0000,0.0000\r\n";
const std::string kSystemVariables =
    "[*SYSTEM*]$MNUFRAME  Storage: SHADOW  Access: RW  : ARRAY[1,9] OF POSITION\n    [1,1] =   "
    "'panel'\n"
    "  Group: 1   Config: N D B, 0, 0, 0\n  X:  1800.000   Y:  -250.000   Z:   800.000\n"
    "  W:      .000   P:      .000   R:      .000\n    [1,2] = Uninitialized\n"
    "[*SYSTEM*]$MNUTOOL  Storage: SHADOW  Access: RW  : ARRAY[1,9] OF POSITION\n    [1,1] = \n"
    "  Group: 1   Config: N D B, 0, 0, 0\n  X:   100.000   Y:      .000   Z:   150.000\n"
    "  W:      .000   P:   -45.000   R:      .000\n";

/// The model knows of no errors: what is corrected is written as it was.
class ControllerFiles : public testing::Test {
 protected:
  ControllerFiles() {
    const Result<Cell> cell = read_cell(TRAMMEL_SOURCE_DIR "/config/cell-7.yaml");
    folder_.write("cell.model",
                  serialize(test::nominal_model(std::make_shared<const Cell>(cell.value()), 10)));
    fs::create_directories(folder_.file("in"));
  }
  void copy(const std::string& program) const {
    fs::copy(kPrograms + program, folder_.file("in/" + program));
  }
  /// The exit code; the output is in `said_`.
  int correct(const std::string& input, const std::string& frames = "") {
    fs::remove_all(folder_.file("out"));
    const std::string model = folder_.file("cell.model"), output = folder_.file("out");
    std::vector<const char*> words = {"trammel",     "correct", "--model",     model.c_str(),
                                      input.c_str(), "-o",      output.c_str()};
    if (!frames.empty()) words.insert(words.end(), {"--frames", frames.c_str()});
    testing::internal::CaptureStderr();
    const int code = run_command_line(static_cast<int>(words.size()), words.data());
    said_ = testing::internal::GetCapturedStderr();
    return code;
  }
  int correct_folder(const std::string& frames = "") { return correct(folder_.file("in"), frames); }
  [[nodiscard]] bool has_said(const std::string& words) const {
    return said_.find(words) != std::string::npos;
  }

  test::TemporaryFolder folder_;
  std::string said_;
};

TEST_F(ControllerFiles, OfAYaskawaToolsUserFramesAndLoadsAreTakenFromItsConditionFiles) {
  copy("drill.jbi");
  EXPECT_EQ(correct_folder(), kNotAll) << "nobody says where USER[1] is";
  EXPECT_TRUE(has_said("USER[1] is not in the files handed over")) << said_;
  folder_.write("in/TOOL.CND", kTools);
  folder_.write("in/UFRAME.CND", kUserFrames);
  EXPECT_EQ(correct_folder(), 0) << said_;
  EXPECT_TRUE(has_said("TOOL[1]: taken from TOOL.CND")) << said_;
  EXPECT_TRUE(has_said("USER[1]: taken from UFRAME.CND")) << said_;
  std::string heavy = kTools;
  heavy.replace(heavy.find("100.000\r\n0.000"), 7, "180.000");
  folder_.write("in/TOOL.CND", heavy);
  EXPECT_EQ(correct_folder(), kRefusedData);
  EXPECT_TRUE(has_said("TOOL.CND") && has_said("180.000 kg")) << said_;
  std::string other = kTools;
  other.replace(other.find("150.000"), 7, "153.000");
  folder_.write("in/TOOL.CND", other);
  EXPECT_EQ(correct_folder(), kRefusedData) << "another tool than the cell's";
}

TEST_F(ControllerFiles, OfAYaskawaARowBesideAnotherValueLeavesTheTargetsWithBothValues) {
  copy("drill.jbi");
  folder_.write("in/TOOL.CND", kTools);
  std::string moved = kUserFrames;
  moved.replace(moved.find("1800.000"), 8, "1802.000");
  folder_.write("in/UFRAME.CND", moved);
  EXPECT_EQ(correct_folder(), 0) << said_;
  const std::string row = "name,x_mm,y_mm,z_mm,qw,qx,qy,qz\nUSER[1],1800,-250,800,1,0,0,0\n";
  EXPECT_EQ(correct_folder(folder_.write("frames.csv", row)), kNotAll);
  EXPECT_TRUE(has_said("UFRAME.CND line 7: 2.000 mm")) << said_;
}

TEST_F(ControllerFiles, OfAYaskawaParametersAreSaidNotToBeRead) {
  copy("drill.jbi");
  folder_.write("in/TOOL.CND", kTools);
  folder_.write("in/UFRAME.CND", kUserFrames);
  for (const char* name : {"ALL.PRM", "RC.PRM", "HOME2.DAT"})
    folder_.write(std::string("in/") + name, "//RC YAS\r\n");
  EXPECT_EQ(correct_folder(), 0) << said_;
  EXPECT_TRUE(has_said("ALL.PRM, RC.PRM: parameters of the controller are not read")) << said_;
  EXPECT_TRUE(has_said("HOME2.DAT: data of the controller")) << said_;
}

TEST_F(ControllerFiles, AJobInPulsesIsCorrectedWhereTheRobotFileTellsThePulsesOfADegree) {
  folder_.write("in/TOOL.CND", kTools);
  folder_.write("in/RC.PRM", "//RC YAS\r\n");
  folder_.write("in/TRIM.JBI",
                "/JOB\r\n//NAME TRIM\r\n//POS\r\n///NPOS 1,0,0,0,0,0\r\n///TOOL 1\r\n"
                "///POSTYPE PULSE\r\n///PULSE\r\nC00000=0,-20000,20000,0,30000,0\r\n//INST\r\n"
                "///ATTR SC,RW\r\n///GROUP1 RB1\r\nNOP\r\nMOVJ C00000 VJ=20.00\r\nEND\r\n");
  EXPECT_EQ(correct_folder(), kNotAll);
  EXPECT_TRUE(has_said("pulses_per_deg of each joint in the robot file")) << said_;
  const Cell plain = read_cell(TRAMMEL_SOURCE_DIR "/config/cell-7.yaml").value();
  Cell told = plain;
  const std::string joint = "- {", pulses = "pulses_per_deg: 1000, ";
  for (std::size_t at = told.robot_yaml.find(joint, told.robot_yaml.find("joints:"));
       at != std::string::npos; at = told.robot_yaml.find(joint, at + joint.size()))
    told.robot_yaml.insert(at + joint.size(), pulses);
  ASSERT_TRUE(parse_robot(told.robot_yaml, "robot").has_value());
  folder_.write("cell.model",
                serialize(test::nominal_model(std::make_shared<const Cell>(told), 10)));
  EXPECT_EQ(correct_folder(), 0) << said_;
  // One joint alone tells nothing of the others.
  std::string one = plain.robot_yaml;
  one.insert(one.find(joint, one.find("joints:")) + joint.size(), pulses);
  EXPECT_NE(sentence(parse_robot(one, "robot").error()).find("pulses_per_deg"), std::string::npos);
}

TEST_F(ControllerFiles, AControllersOwnListIsTakenAsFrames) {
  const std::string variables = folder_.write("SYSFRAME.VA", kSystemVariables);
  EXPECT_EQ(correct(kPrograms + "drill.ls", variables), 0) << said_;
  EXPECT_TRUE(has_said("UFRAME[1], UTOOL[1]: taken from SYSFRAME.VA")) << said_;
  EXPECT_EQ(correct(kPrograms + "drill.jbi", folder_.write("LIST.CND", kTools + kUserFrames)), 0)
      << said_;
  EXPECT_EQ(correct(kPrograms + "drill.jbi", variables), kWrongUsage) << "of another controller";
  EXPECT_EQ(correct(kPrograms + "drill.ls", folder_.write("sysframe.sv", "binary")), kRefusedData);
  EXPECT_TRUE(has_said("SYSFRAME.VA")) << said_;
  EXPECT_EQ(correct(kPrograms + "drill.ls", folder_.write("framevar.vr", "binary")), kRefusedData);
  EXPECT_TRUE(has_said("save them as text")) << said_;
  EXPECT_EQ(correct(kPrograms + "drill.ls", folder_.write("numreg.va", "[*NUMREG*]$NUMREG\n")),
            kRefusedData);
  EXPECT_TRUE(has_said("$MNUFRAME")) << said_;
}

TEST_F(ControllerFiles, APolyScopeProgramBesideItsScriptIsSaidToStayAsItIs) {
  copy("drill.script");
  EXPECT_EQ(correct_folder(), 0) << said_;
  EXPECT_FALSE(has_said("PolyScope"));
  folder_.write("in/drill.urp", "zipped");
  folder_.write("in/default.installation", "zipped");
  EXPECT_EQ(correct_folder(), 0) << said_;
  EXPECT_TRUE(has_said("drill.urp: PolyScope's own programs are not read")) << said_;
  EXPECT_TRUE(has_said("default.installation: the installation is not read")) << said_;
  EXPECT_EQ(correct(folder_.file("in/drill.urp")), kRefusedData);
  EXPECT_TRUE(has_said("hand over the .script")) << said_;
}

}  // namespace
}  // namespace trammel::cli
