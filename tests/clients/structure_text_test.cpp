#include "clients/cli/text/structure_text.h"

#include <gtest/gtest.h>

#include "server/base/units.h"
#include "server/measurement/files/csv_table.h"
#include "server/robot/cell.h"

namespace trammel::cli {
namespace {

CirclePointResult measured_robot() {
  CirclePointResult result;
  result.robot = read_robot(TRAMMEL_SOURCE_DIR "/models/abb_irb6640-205-275.yaml").value();
  CircleFit circle;
  circle.joint = 1;
  circle.reflector = "A";
  circle.points = 7;
  circle.plane_rms = 6.75e-6;
  result.circles = {circle};
  result.axes.resize(2);
  result.parameters = {
      {"a2", true, 1.28, -0.465e-3, 0.02e-3, true, ""},
      {"q2", false, -kPi / 2, from_deg(-0.029), from_deg(0.001), true, ""},
      {"d1", true, 0.78, 0, 0, false, "nothing marks the base's height, \"really\""}};
  return result;
}

TEST(StructureText, TellsCirclePointsInMillimetresMicrometresAndDegrees) {
  const std::string text = circle_point_text(measured_robot());
  EXPECT_NE(text.find("J2 A"), std::string::npos);
  EXPECT_NE(text.find("6.75"), std::string::npos);
  EXPECT_NE(text.find("a2 [mm]          1280.0000     -0.4650    0.0200"), std::string::npos)
      << text;
  EXPECT_NE(text.find("q2 [deg]          -90.0000     -0.0290    0.0010"), std::string::npos)
      << text;
  EXPECT_NE(text.find("d1 not measured"), std::string::npos);
}

TEST(StructureText, WritesATableThatReadsBack) {
  const Result<CsvTable> table = CsvTable::parse(circle_point_csv(measured_robot()), "t.csv");
  ASSERT_TRUE(table) << table.error().message;
  ASSERT_EQ(table->size(), 3u);
  EXPECT_NEAR(*table->number(0, *table->find("deviation")), -0.465, 1e-12);
  EXPECT_EQ(table->field(1, *table->find("unit")), "deg");
  EXPECT_EQ(table->field(2, *table->find("deviation")), "");
  EXPECT_EQ(table->field(2, *table->find("note")), "nothing marks the base's height, \"really\"");
}

TEST(StructureText, GivesProgramsTheSameNumbers) {
  const auto json = circle_point_json(measured_robot());
  EXPECT_NEAR(json["parameters"][0]["deviation"].get<double>(), -0.465, 1e-12);
  EXPECT_FALSE(json["parameters"][2].contains("deviation"));
  EXPECT_EQ(json["circles"][0]["joint"], 2);
}

TEST(StructureText, TellsStiffnessInRadiansPerNewtonMillimetre) {
  DeflectionResult result;
  ElementResult element;
  element.element = 3;
  element.beam.emplace();
  element.beam->compliance = 2.971e-7;
  element.beam->flexibility = 1 / 3.4221e6;
  element.rigid.compliance = 4.044e-7;
  element.verdict = LinkVerdict::kBends;
  result.elements = {element};
  const std::string text = deflection_text(result);
  EXPECT_NE(text.find("3.422e+12"), std::string::npos) << text;
  EXPECT_NE(text.find("2.971e-10"), std::string::npos) << text;
  EXPECT_NE(text.find("4.044e-10"), std::string::npos) << text;
  const auto json = deflection_json(result);
  EXPECT_NEAR(json["elements"][0]["model_2"]["compliance_rad_per_nmm"].get<double>(), 4.044e-10,
              1e-20);
  EXPECT_EQ(json["elements"][0]["link"], "bends");
}

}  // namespace
}  // namespace trammel::cli
