#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <filesystem>

#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/robot/cell.h"
#include "server/robot/cell_papers.h"
#include "server/robot/cell_rules.h"
#include "server/robot/passive_joint.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

std::string shipped(const std::string& file) {
  return std::string(TRAMMEL_SOURCE_DIR) + "/" + file;
}

std::string with(std::string text, const std::string& old_part, const std::string& new_part) {
  const std::size_t place = text.find(old_part);
  EXPECT_NE(place, std::string::npos) << old_part;
  return text.replace(place, old_part.size(), new_part);
}

TEST(CellFile, EveryShippedRobotAndCellLoads) {
  int robots = 0;
  for (const auto& entry : std::filesystem::directory_iterator(shipped("models"))) {
    if (entry.path().extension() != ".yaml") continue;
    const Result<Chain> robot = read_robot(entry.path().string());
    EXPECT_TRUE(robot) << (robot ? "" : robot.error().message);
    ++robots;
  }
  EXPECT_GE(robots, 2);
  for (const char* file : {"config/cell-7.yaml", "config/ur10.yaml"}) {
    const Result<Cell> cell = read_cell(shipped(file));
    EXPECT_TRUE(cell) << (cell ? "" : cell.error().message);
  }
}

TEST(CellFile, AutoLeavesTheErrorSourcesToTheMeasurementsAndKeepsWhatItNames) {
  const std::string robot = *read_text_file(shipped("models/abb_irb6640-205-275.yaml"));
  const std::string text = *read_text_file(shipped("config/cell-7.yaml"));
  const std::string before = text.substr(0, text.find("model:"));
  const auto model_of = [&](const std::string& model) {
    return parse_cell(before + "model: " + model + "\n", robot, "c.yaml").value().model;
  };
  const std::vector<std::string> usual = {"base", "geometry", "compliance"};
  const ModelSpec alone = model_of("{error_sources: auto}");
  EXPECT_EQ(alone.beside_auto, std::vector<std::string>{});
  EXPECT_EQ(alone.error_sources, usual);
  EXPECT_EQ(alone.bias, "auto");
  const ModelSpec listed = model_of("{error_sources: [base, backlash:2, auto], bias: none}");
  EXPECT_EQ(listed.beside_auto, (std::vector<std::string>{"base", "backlash:2"}));
  EXPECT_EQ(listed.error_sources, (std::vector<std::string>{"base", "backlash:2"}));
  EXPECT_EQ(listed.bias, "none");
  EXPECT_FALSE(model_of("{error_sources: [base]}").beside_auto);
  EXPECT_EQ(model_of("{bias: se}").beside_auto, std::vector<std::string>{});
  EXPECT_EQ(model_of("{bias: se}").bias, "se");
  const ModelSpec unsaid = parse_cell(before, robot, "c.yaml").value().model;
  EXPECT_EQ(unsaid.beside_auto, std::vector<std::string>{});
  EXPECT_EQ(unsaid.bias, "auto");
  EXPECT_FALSE(parse_cell(before + "model: {error_sources: all}\n", robot, "c.yaml"));
}

TEST(CellFile, NamesExternalAxesThatCarryNothing) {
  const std::string text = *read_text_file(shipped("config/cell-7.yaml"));
  const std::string robot = *read_text_file(shipped("models/abb_irb6640-205-275.yaml"));
  const Result<Cell> cell = parse_cell(
      text + "axes: {gun: carries nothing, 'group 2, axis 1': carries nothing}\n", robot, "c.yaml");
  ASSERT_TRUE(cell) << cell.error().message;
  EXPECT_EQ(rules_of(*cell)->idle_axes, (std::vector<std::string>{"gun", "group 2, axis 1"}));
  const Result<Cell> carries =
      parse_cell(text + "axes: {rail: carries the robot}\n", robot, "c.yaml");
  ASSERT_FALSE(carries);
  EXPECT_NE(sentence(carries.error()).find("'carries the robot', expected carries nothing"),
            std::string::npos)
      << sentence(carries.error());
}

TEST(CellFile, ABiasMayBeSpelledAsASum) {
  const std::string text = *read_text_file(shipped("config/cell-7.yaml"));
  const std::string robot = *read_text_file(shipped("models/abb_irb6640-205-275.yaml"));
  const Result<Cell> cell = parse_cell(
      with(text, "bias: auto", "bias: matern52 + joint_map + parameters"), robot, "c.yaml");
  ASSERT_TRUE(cell) << cell.error().message;
  EXPECT_EQ(cell->model.bias, "matern52 + joint_map + parameters");
}

TEST(CellFile, ConvertsToSiAtTheBoundary) {
  const Cell cell = *read_cell(shipped("config/cell-7.yaml"));
  EXPECT_DOUBLE_EQ(cell.robot.joint(0).link.d, 0.780);
  EXPECT_DOUBLE_EQ(cell.robot.joint(0).link.alpha, -kPi / 2);
  EXPECT_DOUBLE_EQ(cell.tracker.sigma, 13e-6);
  EXPECT_DOUBLE_EQ(cell.payloads.at("spindle").p_FoCog_F.z(), 0.1);
  // Eq. (5.1): the tool's x axis points to (1, 0, 1) / sqrt(2).
  EXPECT_LT((cell.tools.at("spindle")->linear().col(0) - Vector3(1, 0, 1).normalized()).norm(),
            1e-9);
}

TEST(CellFile, AnUnknownBaseAndToolAreUnknown) {
  const Cell cell = *read_cell(shipped("config/ur10.yaml"));
  EXPECT_FALSE(cell.X_WB);
  EXPECT_FALSE(cell.tools.at("tmac"));
}

TEST(CellFile, ItsPapersAreWhatACertificateNames) {
  const std::string text = *read_text_file(shipped("config/cell-7.yaml"));
  const std::string robot = *read_text_file(shipped("models/abb_irb6640-205-275.yaml"));
  const CellPapers none = *papers_of(*parse_cell(text, robot, "c.yaml"));
  EXPECT_EQ(none.serial_number + none.instrument + none.operator_name, "");
  const std::string keys = "serial_number: 66-70\ninstrument: AT960, 7512\noperator: I. Newton\n";
  const CellPapers papers = *papers_of(*parse_cell(text + keys, robot, "c.yaml"));
  EXPECT_EQ(papers.serial_number, "66-70");
  EXPECT_EQ(papers.instrument, "AT960, 7512");
  EXPECT_EQ(papers.operator_name, "I. Newton");
  EXPECT_FALSE(parse_cell(text + "operator: [a, b]\n", robot, "c.yaml"));
}

TEST(CellFile, RefusesWithFileKeyAndReason) {
  const std::string cell = *read_text_file(shipped("config/cell-7.yaml"));
  const std::string robot = *read_text_file(shipped("models/abb_irb6640-205-275.yaml"));
  const auto refusal = [&](const std::string& cell_text, const std::string& robot_text) {
    const Result<Cell> read = parse_cell(cell_text, robot_text, "cell.yaml");
    EXPECT_FALSE(read);
    return refusal_of(read);
  };
  EXPECT_EQ(refusal(with(cell, "gravity:", "gravtiy:"), robot), Refusal("cell.yaml", 6, "gravtiy"));
  EXPECT_EQ(refusal(with(cell, "mass_kg: 100", "mass_kg: heavy"), robot),
            Refusal("cell.yaml", 10, "payloads: spindle: mass_kg").text("heavy"));
  EXPECT_EQ(refusal(with(cell, "q_wxyz: [1, 0, 0, 0]", "q_wxyz: [1, 1, 0, 0]"), robot),
            Refusal("cell.yaml", 5, "base: q_wxyz").beyond(std::sqrt(2.0), 1));
  EXPECT_EQ(refusal(with(cell, "version: 1", "version: 2"), robot),
            Refusal("cell.yaml", 2, "version").beyond(2, 1));
  EXPECT_EQ(refusal(cell, with(robot, "limits_deg: [-65, 85]", "limits_deg: [85, -65]")),
            Refusal("cell.yaml (robot)", 8, "joints 2: limits_deg").beyond(85, -65));
  EXPECT_EQ(refusal(cell + "cell: twice\n", robot), Refusal("cell.yaml", 3, "cell"));
  EXPECT_EQ(refusal("", robot), Refusal("cell.yaml"));
  EXPECT_FALSE(read_cell("/no/such/cell.yaml"));
}

TEST(CellFile, ACouplingIsTheControllersOrOneOfBars) {
  const std::string cell = *read_text_file(shipped("config/cell-7.yaml"));
  const std::string robot = *read_text_file(shipped("models/abb_irb6640-205-275.yaml"));
  const auto coupled = [&](const std::string& kind) {
    return parse_cell(
        cell,
        with(robot, "coupling: []", "coupling: [{joint: 3, follows: 2, ratio: -1" + kind + "}]"),
        "cell.yaml");
  };
  EXPECT_EQ(coupled("")->robot.couplings().front().kind, CouplingKind::kController);
  EXPECT_EQ(coupled(", kind: controller")->robot.couplings().front().kind,
            CouplingKind::kController);
  EXPECT_EQ(coupled(", kind: parallelogram")->robot.couplings().front().kind,
            CouplingKind::kParallelogram);
  EXPECT_EQ(refusal_of(coupled(", kind: belt")),
            Refusal("cell.yaml (robot)", 13, "coupling 1: kind").text("belt"));
  EXPECT_EQ(read_robot(shipped("models/fanuc_m-20ia.yaml"))->couplings().front().kind,
            CouplingKind::kController);
}

TEST(CellFile, AUrdfIsNamedAsOne) {
  const std::string cell = *read_text_file(shipped("config/cell-7.yaml"));
  const auto urdf =
      parse_cell(cell, "<?xml version=\"1.0\"?>\n<robot name=\"arm\"><link name=\"l\"/></robot>\n",
                 "cell.yaml");
  ASSERT_FALSE(urdf);
  EXPECT_NE(sentence(urdf.error()).find("a URDF"), std::string::npos) << sentence(urdf.error());
  EXPECT_NE(urdf.error().next.find("models/README.md"), std::string::npos) << urdf.error().next;
}

TEST(CellFile, APassiveJointIsNeverCommandedAndHasNoLimits) {
  const auto with_wrist = [](const std::string& keys) {
    return parse_cell(
        "version: 1\ncell: pal\nrobot: pal.yaml\nbase: null\ntools: {t1: null}\n"
        "model: {error_sources: [base, tool], bias: none}\n",
        "version: 1\nname: level\njoints:\n  - {d_mm: 740, limits_deg: [-180, 180]}\n"
        "  - {a_mm: 200, " +
            keys + "}\ncoupling: [{joint: 2, follows: 1, ratio: -1, kind: parallelogram}]\n",
        "cell.yaml");
  };
  const auto level = with_wrist("passive: true");
  ASSERT_TRUE(level) << sentence(level.error());
  EXPECT_FALSE(is_passive(level->robot.joint(0)));
  EXPECT_TRUE(is_passive(level->robot.joint(1)));
  EXPECT_FALSE(level->robot.joint_outside_limits(JointVector::Zero(2)));
  EXPECT_FALSE(with_wrist("passive: true, limits_deg: [-1, 1]"));
  const auto empty = with_wrist("limits_deg: [0, 0]");
  ASSERT_FALSE(empty);
  EXPECT_NE(empty.error().next.find("passive: true"), std::string::npos) << empty.error().next;
}

TEST(CellFile, ARobotFileThatIsAPipeIsRefusedAndNotWaitedFor) {
  const test::TemporaryFolder folder;
  ASSERT_EQ(::mkfifo(folder.file("robot.yaml").c_str(), 0600), 0);
  const std::string cell = *read_text_file(shipped("config/cell-7.yaml"));
  const std::string text = with(cell, "../models/abb_irb6640-205-275.yaml", "robot.yaml");
  EXPECT_EQ(refusal_of(read_cell(folder.write("cell.yaml", text))),
            Refusal(folder.file("robot.yaml"), {}, "robot"));
}

TEST(CellFile, TheOnlyToolNeedsNoName) {
  const Cell cell = *read_cell(shipped("config/cell-7.yaml"));
  EXPECT_EQ(*resolve_tool(cell, ""), "spindle");
  EXPECT_EQ(*resolve_payload(cell, "spindle"), "spindle");
  EXPECT_FALSE(resolve_tool(cell, "gripper"));
  Cell two = cell;
  two.tools["gripper"] = Pose::Identity();
  const Result<std::string> ambiguous = resolve_tool(two, "");
  ASSERT_FALSE(ambiguous);
  EXPECT_EQ(refusal_of(ambiguous), Refusal("", {}, "tool_id"));
}

}  // namespace
}  // namespace trammel
