#include "server/measurement/files/csv_dialect.h"

#include <gtest/gtest.h>

#include "server/measurement/files/batch_file.h"
#include "server/measurement/files/joint_list.h"
#include "server/measurement/files/point_list.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

constexpr const char* kBatch =
    "pose_id,q1_deg,q2_mm,x_mm,y_mm,z_mm,sigma_mm,operator\n"
    "p1,-10.5,1.25,870.586,-1081.625,2417.5,0.013,Ada\n"
    "p2,20,2.5,1000,2e3,1.5e-1,,\n";

std::string with(std::string text, const std::string& what, const std::string& by) {
  for (auto at = text.find(what); at != std::string::npos; at = text.find(what, at + by.size()))
    text.replace(at, what.size(), by);
  return text;
}

/// The batch with `separator` between values, decimal commas where told, and its header in
/// capitals.
std::string dialect(const std::string& separator, bool decimal_comma) {
  std::string text = with(kBatch, ",", separator);
  if (decimal_comma) text = with(text, ".", ",");
  for (std::size_t k = 0; text[k] != '\n'; ++k) text[k] = static_cast<char>(std::toupper(text[k]));
  return "\xEF\xBB\xBF" + with(text, "\n", "\r\n");
}

Refusal refusal_dialect(const std::string& text) { return refusal_of(parse_batch(text, "b.csv")); }

TEST(CsvDialect, ABatchFromASpreadsheetOfAnyLanguageIsTheSameBatch) {
  const MeasurementBatch plain = parse_batch(kBatch, "b.csv").value();
  const std::string written = with(to_csv(plain), "operator", "OPERATOR");
  for (const auto& [separator, comma] :
       {std::pair(",", false), {";", false}, {";", true}, {"\t", false}, {"\t", true}}) {
    const auto read = parse_batch(dialect(separator, comma), "b.csv");
    ASSERT_TRUE(read) << separator << comma << ": " << sentence(read.error());
    EXPECT_EQ(to_csv(*read), written) << separator << comma;
  }
}

TEST(CsvDialect, JointListsAndPointsAreReadByTheSameRule) {
  const auto joints = parse_joint_csv("POSE_ID;Q1_DEG\na;1,5\nb;-2\n", "plan.csv");
  ASSERT_TRUE(joints) << sentence(joints.error());
  EXPECT_NEAR(joints->poses[0].context.q(0), 1.5 / 180 * 3.14159265358979, 1e-12);
  const auto points = parse_points(
      "Name;X [mm];Y [mm];Z [mm]\nA::Main::a;1,5;2;3\nA::Main::b;4;5;6,25\n", "sa.csv");
  ASSERT_TRUE(points) << sentence(points.error());
  EXPECT_EQ(points->points[0].name, "a");
  EXPECT_NEAR(points->points[1].p_W.z(), 6.25e-3, 1e-15);
  const auto batch = join_points(*points, *joints);
  ASSERT_TRUE(batch) << sentence(batch.error());
  EXPECT_EQ(batch->measurements[1].pose_id, "b");
}

TEST(CsvDialect, NamesOfSpatialAnalyzerCountByTheirLastComponent) {
  const auto points =
      parse_points("Robot::Day 1::p1\t1,5\t2,5\t3,5\nRobot::Day 1::p2\t1\t2\t3\n", "sa.txt");
  ASSERT_TRUE(points) << sentence(points.error());
  EXPECT_EQ(points->points[0].name, "p1");
  EXPECT_NEAR(points->points[0].p_W.x(), 1.5e-3, 1e-15);
  const auto twice = parse_points("A::Day 1::p1;1.5;2;3\nA::Day 2::p1;1;2;3\n", "sa.txt");
  EXPECT_EQ(refusal_of(twice), Refusal("sa.txt", 2, "name").text("p1"));
}

TEST(CsvDialect, WhatMayBeReadInTwoWaysIsRefused) {
  // Commas between values and in them.
  EXPECT_EQ(refusal_dialect(with(kBatch, ".", ",")), Refusal("b.csv", 2).beyond(14, 8));
  EXPECT_EQ(refusal_dialect(with(kBatch, "870.586", "\"870,586\"")),
            Refusal("b.csv", 2, "x_mm").text("870,586"));
  EXPECT_EQ(refusal_of(parse_points("p1,870,5,12,3,4,5\n", "sa.txt",
                                    {{}, {}, BehindCoordinates::kUncertainties, 1})),
            Refusal("sa.txt", 1));
  EXPECT_EQ(refusal_of(parse_points("870,5,12,3,4,5\n", "sa.txt")), Refusal("sa.txt", 1));
  EXPECT_EQ(refusal_of(parse_robodk_csv("1,2,3,4,5,6,100,5,200,5,300,5\n", "rdk.csv")),
            Refusal("rdk.csv", 1));
  // Points and commas before decimals: one of them would be thousands.
  const std::string mixed =
      with(with(with(kBatch, ",", ";"), "-1081.625", "-1081,625"), "-10.5", "-10");
  EXPECT_EQ(refusal_dialect(mixed), Refusal("b.csv", 2, "y_mm").text("-1081,625"));
  EXPECT_EQ(refusal_dialect(with(with(kBatch, ",", ";"), "870.586", "1.870,586")),
            Refusal("b.csv", 2, "x_mm").text("1.870,586"));
  // Two separators between the names.
  EXPECT_EQ(refusal_dialect("q1_deg;x_mm,y_mm;z_mm\n1;2;3;4\n"), Refusal("b.csv", 1));
  EXPECT_EQ(refusal_dialect("q1_deg,x_mm,y_mm,z_mm,note;more\n1,2,3,4,5\n"), Refusal::none())
      << "the rows decide";
  EXPECT_EQ(refusal_dialect("sep=;\nq1_deg;x_mm;y_mm;z_mm;a,b,c,d,e\n1;2;3;4;x,x,x,x\n"),
            Refusal::none());
}

TEST(CsvDialect, ASpreadsheetIsRefusedWithHowToExportIt) {
  using namespace std::string_literals;
  for (const std::string& text : {"PK\x03\x04\0\0"s, "\xD0\xCF\x11\xE0\xA1\xB1"s, "\xFF\xFEq\0"s}) {
    for (const auto& read :
         {refusal_dialect(text), refusal_of(parse_joint_csv(text, "b.csv").map([](auto&&) {})),
          refusal_of(parse_points(text, "b.csv").map([](auto&&) {})),
          refusal_of(parse_robodk_csv(text, "b.csv").map([](auto&&) {}))}) {
      EXPECT_EQ(read, Refusal("b.csv"));
    }
    EXPECT_NE(parse_batch(text, "b.csv").error().next.find("CSV UTF-8"), std::string::npos);
  }
}

TEST(CsvDialect, RowsWithoutAnyValueSayNothing) {
  const auto read = parse_batch("q1_deg;x_mm;y_mm;z_mm\n1;2;3;4\n;;;\n;;;\n", "b.csv");
  ASSERT_TRUE(read) << sentence(read.error());
  EXPECT_EQ(read->measurements.size(), 1u);
}

TEST(CsvDialect, TellsNumbersWithDecimalsFromOtherTexts) {
  EXPECT_EQ(decimal_sign("1,5"), ',');
  EXPECT_EQ(decimal_sign("-,5e-3"), ',');
  EXPECT_EQ(decimal_sign("+12.5E6"), '.');
  for (const char* text :
       {"", "12", "1,2,3", "1.234,5", ",", "-", "1,5mm", "p1,2", "1,5e", "2021-10-12"})
    EXPECT_EQ(decimal_sign(text), std::nullopt) << text;
}

}  // namespace
}  // namespace trammel
