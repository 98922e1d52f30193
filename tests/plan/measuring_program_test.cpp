#include "server/plan/measuring_program.h"

#include <gtest/gtest.h>

#include <map>
#include <regex>
#include <sstream>

#include "server/base/units.h"
#include "tests/support/refusal.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

Plan planned(const std::shared_ptr<const Cell>& cell, bool bidirectional = false) {
  PlanOptions options{12, 5};
  options.bidirectional = bidirectional;
  return make_plan(cell, options).value();
}

/// cell-7 on a rail of 3 m.
std::shared_ptr<const Cell> cell_on_rail(bool rail_first = true) {
  Cell cell = *test::cell_7();
  std::vector<Joint> joints;
  for (int j = 0; j < 6; ++j) joints.push_back(cell.robot.joint(j));
  Joint rail;
  rail.type = JointType::kPrismatic;
  rail.lower = 0;
  rail.upper = 3;
  joints.insert(rail_first ? joints.begin() : joints.end(), rail);
  cell.robot = Chain::make("on rail", joints).value();
  cell.joint_ranges.clear();
  return std::make_shared<const Cell>(cell);
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

std::vector<double> numbers_of(const std::string& text) {
  static const std::regex number(R"(-?\d+(\.\d+)?)");
  std::vector<double> numbers;
  for (std::sregex_iterator it(text.begin(), text.end(), number), end; it != end; ++it) {
    numbers.push_back(std::stod(it->str()));
  }
  return numbers;
}

/// A jointtarget as a controller would read it.
struct JointTarget {
  std::vector<double> axes;
  std::string external;
};

/// A RAPID module read by its grammar: declarations, then one routine of moves and waits. Fails the
/// test on anything that is none of these.
struct RapidModule {
  std::string name;
  std::map<std::string, JointTarget> targets;
  std::vector<std::string> moves;  // names of targets, in order
  std::vector<std::string> speeds, tools;
  int waits = 0, stops = 0;
};

RapidModule read_rapid(const std::string& text) {
  RapidModule module;
  std::string code;  // comments off, one instruction a line
  for (const std::string& line : lines_of(text)) {
    EXPECT_LE(line.size(), 80u) << line;
    for (const char c : line) EXPECT_TRUE(c >= ' ' && c <= '~') << line;
    code += line.substr(0, line.find('!'));
  }
  const std::string id = R"(([A-Za-z][A-Za-z0-9_]{0,31}))";
  const std::string six = R"(([-0-9.]+(?:,[-0-9.]+){5}))";
  std::smatch match;
  EXPECT_TRUE(std::regex_match(code, match,
                               std::regex(R"(\s*MODULE\s+)" + id + R"((\s[^]*)PROC\s+)" + id +
                                          R"(\(\)([^]*)ENDPROC\s*ENDMODULE\s*)")))
      << text;
  module.name = match[1];
  const std::string declarations = match[2];
  const std::string routine = match[4];
  const auto statements = [](const std::string& part) {
    std::vector<std::string> found;
    std::istringstream stream(part);
    for (std::string statement; std::getline(stream, statement, ';');) {
      statement = std::regex_replace(statement, std::regex(R"(^\s+|\s+$)"), "");
      if (!statement.empty())
        found.push_back(std::regex_replace(statement, std::regex(R"(\s+)"), " "));
    }
    return found;
  };
  const std::regex target("CONST jointtarget " + id + R"(:= ?\[\[)" + six +
                          R"(\], ?\[([-0-9.E]+),9E9,9E9,9E9,9E9,9E9\]\])");
  const std::regex constant("CONST (num|speeddata) " + id + R"(:=[-0-9.,\[\]]+)");
  for (const std::string& statement : statements(declarations)) {
    if (std::regex_match(statement, match, target)) {
      EXPECT_TRUE(
          module.targets.emplace(match[1], JointTarget{numbers_of(match[2]), match[3]}).second)
          << statement;
    } else {
      EXPECT_TRUE(std::regex_match(statement, constant)) << statement;
    }
  }
  const std::regex move("MoveAbsJ " + id + R"(\\NoEOffs,)" + id + ",fine," + id);
  for (const std::string& statement : statements(routine)) {
    if (std::regex_match(statement, match, move)) {
      module.moves.push_back(match[1]);
      module.speeds.push_back(match[2]);
      module.tools.push_back(match[3]);
    } else if (statement == "Stop") {
      ++module.stops;
    } else {
      EXPECT_TRUE(std::regex_match(statement, std::regex(R"(WaitTime \\InPos,)" + id)))
          << statement;
      ++module.waits;
    }
  }
  return module;
}

void expect_joints(const std::vector<double>& deg, const JointVector& q, Eigen::Index first) {
  ASSERT_EQ(deg.size(), 6u);
  for (Eigen::Index j = 0; j < 6; ++j)
    EXPECT_NEAR(deg[static_cast<std::size_t>(j)], to_deg(q(first + j)), 1e-9);
}

TEST(MeasuringProgram, ARapidModuleReadsBackAsThePlan) {
  const auto cell = test::cell_7();
  const Plan plan = planned(cell, true);
  const RapidModule module =
      read_rapid(to_rapid(cell->robot, plan, {"my plan-2", 5, "tSpindle", 0}).value());
  EXPECT_EQ(module.name, "T_my_plan_2");
  EXPECT_EQ(module.targets.size(), 48u);
  ASSERT_EQ(module.moves.size(), 48u);
  EXPECT_EQ(module.waits, 24);
  EXPECT_EQ(module.stops, 0);
  for (std::size_t i = 0; i < plan.poses.size(); ++i) {
    expect_joints(module.targets.at(module.moves[2 * i]).axes, plan.poses[i].bump, 0);
    expect_joints(module.targets.at(module.moves[2 * i + 1]).axes, plan.poses[i].context.q, 0);
    EXPECT_EQ(module.targets.at(module.moves[2 * i]).external, "9E9");
    EXPECT_NE(module.speeds[2 * i], module.speeds[2 * i + 1])
        << "fast to the bump, slow to the pose";
    EXPECT_EQ(module.tools[2 * i], "tSpindle");
  }
}

TEST(MeasuringProgram, ARailIsAnExternalAxisInMillimetres) {
  for (const bool first : {true, false}) {
    const auto cell = cell_on_rail(first);
    const Plan plan = planned(cell);
    const RapidModule module = read_rapid(to_rapid(cell->robot, plan, {}).value());
    const std::string krl = to_krl(cell->robot, plan, {}).value();
    for (std::size_t i = 0; i < plan.poses.size(); ++i) {
      const JointVector& q = plan.poses[i].context.q;
      const JointTarget& target = module.targets.at(module.moves[2 * i + 1]);
      expect_joints(target.axes, q, first ? 1 : 0);
      EXPECT_NEAR(std::stod(target.external), to_mm(q(first ? 0 : 6)), 1e-9);
      EXPECT_NE(krl.find(",E1 " + target.external + "}"), std::string::npos);
    }
  }
}

TEST(MeasuringProgram, AKrlProgramReadsBackAsThePlan) {
  const auto cell = test::cell_7();
  const Plan plan = planned(cell);
  const std::string text = to_krl(cell->robot, plan, {"plan_1", 2.5, "tool0", 3}).value();
  const std::vector<std::string> lines = lines_of(text);
  const std::string number = R"((-?\d+(?:\.\d+)?))";
  std::string axes = "A1 " + number;
  for (int k = 2; k <= 6; ++k) axes += ",A" + std::to_string(k) + " " + number;
  const std::regex ptp(R"(\s*PTP \{)" + axes + R"(\})");
  const std::regex other(
      R"(&\w+ \w+|\s*;.*|DEF plan_1 \( \)|\s*EXT BAS \(BAS_COMMAND :IN,REAL :IN\)|)"
      R"(\s*DECL REAL \w+|\s*BAS \(#\w+,\d+\)|\s*\w+=[0-9.]+|\s*WAIT SEC \w+|END)");
  std::vector<std::vector<double>> moves;
  std::vector<std::string> statements;
  for (const std::string& line : lines) {
    EXPECT_LE(line.size(), 120u);
    std::smatch match;
    if (std::regex_match(line, match, ptp)) {
      moves.emplace_back();
      for (std::size_t k = 1; k <= 6; ++k) moves.back().push_back(std::stod(match[k]));
    } else {
      EXPECT_TRUE(std::regex_match(line, other)) << line;
    }
  }
  ASSERT_EQ(moves.size(), 24u);
  for (std::size_t i = 0; i < 12; ++i) {
    expect_joints(moves[2 * i], plan.poses[i].bump, 0);
    expect_joints(moves[2 * i + 1], plan.poses[i].context.q, 0);
  }
  // Declarations stand before the first instruction, as KRL wants them.
  EXPECT_LT(text.find("DECL REAL"), text.find("BAS (#INITMOV"));
  EXPECT_LT(text.find("EXT BAS"), text.find("BAS (#INITMOV"));
  EXPECT_NE(text.find("BAS (#TOOL,3)"), std::string::npos);
  EXPECT_EQ(lines.back(), "END");
}

TEST(MeasuringProgram, StopsWhereThePayloadChanges) {
  Cell cell = *test::cell_7();
  cell.payloads["empty"] = Payload{};
  PlanOptions options{6, 1};
  options.payloads = {"spindle", "empty"};
  const Plan plan = make_plan(std::make_shared<const Cell>(cell), options).value();
  EXPECT_EQ(read_rapid(to_rapid(cell.robot, plan, {}).value()).stops, 1);
  EXPECT_NE(
      to_krl(cell.robot, plan, {}).value().find("; now tool spindle, payload spindle\n  HALT\n"),
      std::string::npos);
}

TEST(MeasuringProgram, LongNamesAreCutToWhatAControllerTakes) {
  const auto cell = test::cell_7();
  const RapidModule module =
      read_rapid(to_rapid(cell->robot, planned(cell), {std::string(60, 'x')}).value());
  EXPECT_EQ(module.name.size(), 32u);
}

TEST(MeasuringProgram, RefusesWhatAControllerWouldNotTake) {
  const auto cell = test::cell_7();
  const Plan plan = planned(cell);
  EXPECT_FALSE(to_rapid(cell->robot, plan, {"m", 5, "1st tool"}));
  EXPECT_FALSE(to_rapid(cell->robot, plan, {"m", 5, std::string(33, 't')}));
  EXPECT_FALSE(to_rapid(cell->robot, plan, {"m", -1}));
  EXPECT_FALSE(to_rapid(cell->robot, plan, {"m", std::nan("")}));
  EXPECT_FALSE(to_krl(cell->robot, plan, {"m", 5, "tool0", 17}));
  EXPECT_FALSE(to_krl(cell->robot, plan, {"2nd-plan"}));
  EXPECT_FALSE(to_krl(cell->robot, plan, {std::string(25, 'k')}));
}

TEST(MeasuringProgram, RefusesRobotsThatAreNoSixAxisArms) {
  std::vector<Joint> joints(7);
  Plan plan;
  const Result<std::string> seven = to_rapid(Chain::make("seven", joints).value(), plan, {});
  ASSERT_FALSE(seven);
  EXPECT_EQ(refusal_of(seven), Refusal("", {}, "joints").beyond(7, 6));
  joints[3].type = JointType::kPrismatic;
  EXPECT_FALSE(to_krl(Chain::make("rail in the middle", joints).value(), plan, {}));
  joints.resize(4);
  EXPECT_FALSE(to_krl(Chain::make("four", joints).value(), plan, {}));
}

}  // namespace
}  // namespace trammel
