#include "server/measurement/files/point_list.h"

#include <gtest/gtest.h>

#include "server/base/units.h"
#include "server/measurement/files/batch_file.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

Refusal refusal_of_list(const std::string& text, const PointFileOptions& options = {}) {
  const auto points = parse_points(text, "sa.txt", options);
  return refusal_of(points);
}

PointList demand(const std::string& text, const PointFileOptions& options = {}) {
  const auto points = parse_points(text, "sa.txt", options);
  EXPECT_TRUE(points) << points.error().message;
  return points.value_or(PointList{});
}

PointFileOptions behind(BehindCoordinates what) {
  PointFileOptions options;
  options.behind = what;
  return options;
}

TEST(PointList, ReadsTargetsWithAndWithoutGroupAndCollectionBySeparatorsOfAnyKind) {
  for (const char* text :
       {"p1 1000 -2000 3.5e2\n", "Main p1 1000 -2000 350\n", "A Main p1 1000 -2000 350\n",
        "A, Main, p1, 1000, -2000, 350\n", "A;Main;p1;1000;-2000;350\r\n", "p1\t1000\t-2000\t350",
        "\"Col A\" \"Main group\" p1 1000 -2000 +350\n",
        "// SpatialAnalyzer\n# more\n\nMain p1  1000   -2000 350   10/12/2021 08:15:23 AM\n"}) {
    const PointList list = demand(text);
    ASSERT_EQ(list.points.size(), 1u) << text;
    EXPECT_EQ(list.points[0].name, "p1") << text;
    EXPECT_LT((list.points[0].p_W - Vector3(1, -2, 0.35)).norm(), 1e-12) << text;
    EXPECT_FALSE(list.points[0].R_W) << text;
    EXPECT_FALSE(list.points[0].sigma) << text;
  }
}

TEST(PointList, CommasInNumbersBetweenBlanksAreDecimalCommas) {
  const PointList list = demand("p1 3233,9547 -2853,6702 1899,0424\np2 832 4,6682 3226,0384\n");
  ASSERT_EQ(list.points.size(), 2u);
  EXPECT_EQ(list.points[0].name, "p1");
  EXPECT_LT((list.points[0].p_W - Vector3(3.2339547, -2.8536702, 1.8990424)).norm(), 1e-12);
  EXPECT_LT((list.points[1].p_W - Vector3(0.832, 4.6682e-3, 3.2260384)).norm(), 1e-12);
  EXPECT_NEAR(demand("p1 , 1.5 , 2 , 3\n").points[0].p_W.x(), 1.5e-3, 1e-15);
  EXPECT_NEAR(demand("point 7,1.5,2,3\n").points[0].p_W.x(), 1.5e-3, 1e-15);
}

TEST(PointList, OfPointsWithoutNamesItSaysHowTheyMeetTheirJoints) {
  const auto points = parse_points("1.5 2.5 3.5\n", "points.txt");
  EXPECT_EQ(refusal_of(points), Refusal("points.txt", 1).beyond(3, 4));
  for (const char* part : {"paste JOINTS POINTS", "--table", "--columns"})
    EXPECT_NE(points.error().next.find(part), std::string::npos) << points.error().next;
  // As `paste` puts them: a tab between two lists that blanks separate.
  const auto batch = parse_batch_table("10.5 -20.25\t1.5 2.5 3.5\n",
                                       {"q1_deg", "q2_deg", "x_mm", "y_mm", "z_mm"}, "table.txt");
  ASSERT_TRUE(batch) << sentence(batch.error());
  EXPECT_NEAR(batch->measurements[0].context.q(1), from_deg(-20.25), 1e-15);
  EXPECT_NEAR(batch->measurements[0].p_W.z(), 3.5e-3, 1e-15);
}

TEST(PointList, TakesNumbersAsNamesButNoCoordinates) {
  EXPECT_EQ(demand("7 1000 2000 300\n").points[0].name, "7");
  EXPECT_EQ(refusal_of_list("p1 100.0 200.0 300.0 0.5\n"),
            Refusal("sa.txt", 1, "name").text("100.0"));
}

TEST(PointList, ReadsTheUnitFromACommentAndRefusesAnotherOne) {
  EXPECT_NEAR(demand("// Units: Inches\np 1 0 0\n").points[0].p_W.x(), 0.0254, 1e-15);
  EXPECT_NEAR(demand("// Length units = m\np 1 0 0\n").points[0].p_W.x(), 1, 1e-15);
  EXPECT_NEAR(demand("// units in millimeters\np 1 0 0\n").points[0].p_W.x(), 1e-3, 1e-15);
  EXPECT_EQ(refusal_of_list("// a\n// Units: feet\np 1 0 0\n"),
            Refusal("sa.txt", 2, "unit").text("feet"));
  PointFileOptions metres;
  metres.unit = LengthUnit::kMetre;
  EXPECT_NEAR(demand("p 1 0 0\n", metres).points[0].p_W.x(), 1, 1e-15);
  EXPECT_EQ(refusal_of_list("// Units: mm\np 1 0 0\n", metres), Refusal("sa.txt", {}, "unit"));
}

TEST(PointList, TurnsCylindricalAndSphericalCoordinatesIntoCartesianOnes) {
  const Vector3 p(0.3, -0.4, 1.2);
  const double theta = to_deg(std::atan2(p.y(), p.x()));
  const double phi = to_deg(std::acos(p.z() / p.norm()));
  const std::string cylindrical = fmt::format("p 500 {:.15g} 1200\n", theta);
  const std::string spherical =
      fmt::format("p {:.15g} {:.15g} {:.15g}\n", to_mm(p.norm()), theta, phi);
  EXPECT_LT((demand("// Cylindrical coordinates\n" + cylindrical).points[0].p_W - p).norm(), 1e-12);
  EXPECT_LT((demand("// Spherical: R Theta Phi\n" + spherical).points[0].p_W - p).norm(), 1e-12);
  PointFileOptions polar;
  polar.coordinates = Coordinates::kSpherical;
  EXPECT_LT((demand(spherical, polar).points[0].p_W - p).norm(), 1e-12);
  EXPECT_LT((demand("Point Name, R (mm), Theta (deg), Z (mm)\np, 500, " + std::to_string(theta) +
                    ", 1200\n")
                 .points[0]
                 .p_W -
             p)
                .norm(),
            1e-8);
  EXPECT_LT((demand(fmt::format("name;R;theta [rad];phi [rad]\np;1300;{:.15g};{:.15g}\n",
                                from_deg(theta), from_deg(phi)))
                 .points[0]
                 .p_W -
             p)
                .norm(),
            1e-12);
  EXPECT_EQ(refusal_of_list("// cylindrical\np -5 0 0\n"), Refusal("sa.txt", 2, "r").beyond(-5, 0));
}

TEST(PointList, ReadsBothKindsOfFrameAnglesAsTheSameRotation) {
  const Matrix3 R = (Eigen::AngleAxisd(from_deg(30), Vector3::UnitZ()) *
                     Eigen::AngleAxisd(from_deg(-20), Vector3::UnitY()) *
                     Eigen::AngleAxisd(from_deg(10), Vector3::UnitX()))
                        .toRotationMatrix();
  const auto rotation = [](const PointList& list) {
    return list.points.at(0).R_W.value_or(Matrix3::Zero());
  };
  EXPECT_LT(
      (rotation(demand("f, 1.0, 2, 3, 10, -20, 30\n", behind(BehindCoordinates::kFixedXyz))) - R)
          .norm(),
      1e-12);
  EXPECT_LT(
      (rotation(demand("f, 1.0, 2, 3, 30, -20, 10\n", behind(BehindCoordinates::kEulerZyx))) - R)
          .norm(),
      1e-12);
  EXPECT_LT((rotation(demand("// XYZ Fixed Angles\nf,1.0,2,3,10,-20,30,2021-10-12 08:15:23\n")) - R)
                .norm(),
            1e-12);
  EXPECT_LT((rotation(demand("// ZYX Euler Angles\nf,1.0,2,3,30,-20,10\n")) - R).norm(), 1e-12);
  EXPECT_LT((rotation(demand("Frame Name,X,Y,Z,Rz,Ry,Rx\nf,1,2,3,30,-20,10\n")) - R).norm(), 1e-12);
  EXPECT_EQ(refusal_of_list("// ZYZ Euler Angles\nf,1,2,3,30,-20,10\n"),
            Refusal("sa.txt", 1, "angles"));
}

TEST(PointList, DoesNotGuessWhatThreeMoreValuesAre) {
  EXPECT_EQ(refusal_of_list("p 1 2 3 0.01 0.01 0.01\n"),
            Refusal("sa.txt", 1, "columns behind the coordinates"));
  EXPECT_EQ(refusal_of_list("// fixed XYZ\np 1 2 3 0.01 0.01 0.01\n",
                            behind(BehindCoordinates::kUncertainties)),
            Refusal("sa.txt", {}, "columns behind the coordinates"));
}

TEST(PointList, MakesOneSigmaOfUncertainties) {
  PointFileOptions two_sigma = behind(BehindCoordinates::kUncertainties);
  two_sigma.coverage = 2;
  const PointList list = demand("p 1 2 3 0.02 0.04 0.04\nq 1 2 3 0 0 0\n", two_sigma);
  EXPECT_NEAR(list.points[0].sigma.value_or(0), 0.06e-3 / std::sqrt(3.0) / 2, 1e-15);
  EXPECT_FALSE(list.points[1].sigma);
  // 1 mrad at 2 m, the other two exact.
  const PointList far =
      demand(fmt::format("// uncertainties, cylindrical\np 2000 30 0 0 {:.15g} 0\n", to_deg(1e-3)));
  EXPECT_NEAR(far.points[0].sigma.value_or(0), 2e-3 / std::sqrt(3.0), 1e-12);
  EXPECT_EQ(refusal_of_list("p 1 2 3 0.02 -0.04 0.04\n", two_sigma),
            Refusal("sa.txt", 1, "uy").text("-0.04"));
}

TEST(PointList, FindsColumnsByTheNamesOfAHeaderOrOfAComment) {
  const PointList list = demand("name,x_mm,y_mm,z_mm,sigma_mm\nR1,1,2,3,0.01\nR2,4,5,6,\n");
  ASSERT_EQ(list.points.size(), 2u);
  EXPECT_LT((list.points[1].p_W - Vector3(4e-3, 5e-3, 6e-3)).norm(), 1e-15);
  EXPECT_NEAR(list.points[0].sigma.value_or(0), 1e-5, 1e-18);
  EXPECT_EQ(list.points[1].row, 3);
  const PointList other =
      demand("// Group, Point Name, Z (in), Y (in), X (in), Offset\nG, p, 3, 2, 1, 0.5\n");
  EXPECT_LT((other.points[0].p_W - 0.0254 * Vector3(1, 2, 3)).norm(), 1e-15);
  EXPECT_EQ(refusal_of_list("name,x_mm,y_m,z_mm\nR1,1,2,3\n"), Refusal("sa.txt", {}, "unit"));
}

TEST(PointList, RefusalsNameFileRowColumnValueAndLimit) {
  EXPECT_EQ(refusal_of_list(""), Refusal("sa.txt").beyond(0, 1));
  EXPECT_EQ(refusal_of_list("name,x,y,z\n"), Refusal("sa.txt").beyond(0, 1));
  EXPECT_EQ(refusal_of_list("p 1 2\n"), Refusal("sa.txt", 1).beyond(3, 4));
  EXPECT_EQ(refusal_of_list("p 1 2 3\n\nq 1 2 3 4\n"), Refusal("sa.txt", 3).beyond(5, 4));
  EXPECT_EQ(refusal_of_list("p 1 2 3\nq 1 b 3\n"), Refusal("sa.txt", 2, "y").text("b"));
  EXPECT_EQ(refusal_of_list("p 1 2 3e6\n"), Refusal("sa.txt", 1, "z").beyond(3e+06, 1e+06));
  EXPECT_EQ(refusal_of_list("p 1 2 3\np 1 2 3\n"), Refusal("sa.txt", 2, "name").text("p"));
  EXPECT_EQ(refusal_of_list("p\xff 1 2 3\n"), Refusal("sa.txt", 1));
}

JointList plan(const std::string& text) {
  return parse_joint_csv(text, "plan.csv").value_or(JointList{});
}

TEST(PointList, JoinsWithAPlanByPoseIdInTheOrderOfMeasuring) {
  PointFileOptions options = behind(BehindCoordinates::kFixedXyz);
  const auto batch = join_points(demand("b 1 2 3 0 0 90\na 4 5 6 0 0 0\n", options),
                                 plan("pose_id,q1_deg,q2_mm,tool_id,temperature_c\na,10,1,probe,"
                                      "20\nb,20,2,probe,21\nc,3,4,,\n"));
  ASSERT_TRUE(batch) << batch.error().message;
  ASSERT_EQ(batch->measurements.size(), 2u);
  const Measurement& first = batch->measurements[0];
  EXPECT_EQ(first.pose_id, "b");
  EXPECT_EQ(first.context.index, 0);
  EXPECT_EQ(first.context.tool, "probe");
  EXPECT_NEAR(first.context.q(0), from_deg(20), 1e-15);
  EXPECT_NEAR(first.context.q(1), 2e-3, 1e-15);
  EXPECT_LT((first.p_W - Vector3(1e-3, 2e-3, 3e-3)).norm(), 1e-15);
  EXPECT_LT((first.R_WT.value_or(Matrix3::Zero()) * Vector3::UnitX() - Vector3::UnitY()).norm(),
            1e-12);
  EXPECT_EQ(batch->id, "sa");
  const auto again = parse_batch_csv(batch->source_text, "again.csv");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->measurements[1].context.temperature, 20);
  EXPECT_EQ(again->joint_types, batch->joint_types);
}

TEST(PointList, RefusesAPointWithoutAPoseAndAPlanThatNamesAPoseTwice) {
  const auto unknown = join_points(demand("a 1 2 3\nx 1 2 3\n"), plan("pose_id,q1_deg\na,1\n"));
  ASSERT_FALSE(unknown);
  EXPECT_EQ(refusal_of(unknown), Refusal("sa.txt", 2, "name").text("x"));
  const auto twice = join_points(demand("a 1 2 3\n"), plan("pose_id,q1_deg\na,1\na,2\n"));
  ASSERT_FALSE(twice);
  EXPECT_EQ(refusal_of(twice), Refusal("plan.csv", 3, "pose_id").text("a"));
}

}  // namespace
}  // namespace trammel
