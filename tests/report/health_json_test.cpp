#include "server/report/health_json.h"

#include <gtest/gtest.h>

#include "server/error_sources/catalogue.h"
#include "server/report/budget_json.h"

namespace trammel {
namespace {

constexpr double kDegree = 0.017453292519943295;

HealthCheck made_up_check() {
  HealthCheck check;
  check.verdict = HealthVerdict::kChanged;
  check.poses = 12;
  check.rms = 0.9e-3;
  check.expected_rms = 0.03e-3;
  SeenChange length;
  length.cause = {&cause_spelled("geometry"), -1, "d6"};
  length.effect_rms = 0.2e-3;
  length.could_also_be = {{&cause_spelled("compliance"), 2, "C3"},
                          {&cause_spelled("gear_transmission"), 0}};
  SeenChange zero;
  zero.cause = {&cause_spelled("joint_slip"), 3};
  zero.effect_rms = 0.8e-3;
  zero.zeros = {{3, 0.1 * kDegree, 0.002 * kDegree, 0.8e-3, 0.02e-3}};
  check.changed = {length, zero};
  return check;
}

TEST(HealthJson, TellsWhatChangedInTheLinesOfABudgetTheLargestFirst) {
  const auto budget = health_json(made_up_check(), {}).at("budget");
  EXPECT_DOUBLE_EQ(budget.at("nominal_rms_mm"), 0.9);
  const auto& lines = budget.at("lines");
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(lines[0].at("line"), "zero:4");
  EXPECT_EQ(lines[0].at("kind"), "joint_zero");
  EXPECT_EQ(lines[0].at("joint"), 4);
  EXPECT_NEAR(lines[0].at("value"), 0.1, 1e-12);
  EXPECT_EQ(lines[0].at("unit"), "deg");
  EXPECT_DOUBLE_EQ(lines[0].at("alone_rms_mm"), 0.8);
  EXPECT_EQ(lines[1].at("line"), "length:6");
  EXPECT_EQ(lines[1].at("kind"), "length");
  EXPECT_EQ(lines[1].at("joint"), 6);
  EXPECT_EQ(lines[1].at("with").get<std::vector<std::string>>(),
            (std::vector<std::string>{"compliance:3", "gear_transmission:1"}));
  EXPECT_EQ(lines[2].at("line"), "rest");
  EXPECT_EQ(budget.at("beyond_frames").at("lines"), lines);
  for (const auto& line : lines) {
    for (const char* key :
         {"line", "kind", "joint", "value", "u95", "unit", "alone_rms_mm", "alone_max_mm", "share",
          "left_if_right_mm", "times_usual", "with", "action"}) {
      EXPECT_TRUE(line.contains(key)) << key;
    }
  }
}

TEST(HealthJson, ALineHasTheShapeThatEveryBudgetHasAndNullForWhatACheckDoesNotKnow) {
  HealthCheck check = made_up_check();
  check.changed = {check.changed.back()};
  check.changed.front().zeros = {{3, 0.1 * kDegree, 0.002 * kDegree},
                                 {4, -0.2 * kDegree, 0.003 * kDegree}};
  const auto budget = health_json(check, {}).at("budget");
  const auto& line = budget.at("lines").at(0);
  const auto shape = budget_line_json({});
  for (const auto& [key, value] : shape.items()) EXPECT_TRUE(line.contains(key)) << key;
  EXPECT_TRUE(line.at("alone_rms_mm").is_null()) << "what one of two does needs a model";
  EXPECT_TRUE(line.at("share").is_null());
  EXPECT_EQ(budget.at("sentences").size(), 2u);
  EXPECT_NE(budget.at("sentences").at(0).get<std::string>().find("re-master joint 4"),
            std::string::npos)
      << budget.at("sentences");
}

TEST(HealthJson, TellsWhatEachOfSeveralZerosDoesAlone) {
  HealthCheck check = made_up_check();
  SeenChange& several = check.changed.back();
  several.cause.joint = -1;
  several.zeros.push_back({4, 0.3 * kDegree, 0.004 * kDegree, 1.1e-3, 0.03e-3});
  const auto json = health_json(check, {});
  const auto& zeros = json.at("changed").back().at("zeros");
  ASSERT_EQ(zeros.size(), 2u);
  EXPECT_DOUBLE_EQ(zeros[1].at("effect_rms_mm"), 1.1);
  EXPECT_DOUBLE_EQ(zeros[1].at("effect_u95_mm"), 0.03);
}

}  // namespace
}  // namespace trammel
