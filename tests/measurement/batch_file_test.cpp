#include "server/measurement/files/batch_file.h"

#include <gtest/gtest.h>

#include "server/base/units.h"
#include "server/measurement/files/point_list.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

Refusal refusal_file(const std::string& text) {
  const auto batch = parse_robodk_csv(text, "rdk.csv");
  return refusal_of(batch);
}

Matrix3 turned(double x, double y, double z, const char* order) {
  Matrix3 R = Matrix3::Identity();
  for (const char* axis = order; *axis != '\0'; ++axis) {
    const double angle = *axis == 'x' ? x : *axis == 'y' ? y : z;
    R = R * Eigen::AngleAxisd(angle, Vector3::Unit(*axis - 'x')).toRotationMatrix();
  }
  return R;
}

TEST(RoboDkCsv, FindsNamedColumnsWithEverySeparatorAndDecimalCommas) {
  for (const char* text :
       {"J1,J2,X,Y,Z\n90,-45.5,1,2,3\n", "J1;J2;X;Y;Z\n90;-45,5;1;2;3\n",
        "J1\tJ2\tX\tY\tZ\r\n90\t-45.5\t1\t2\t3\r\n",
        "# measured\nZ (mm), X (mm), Y (mm), Joint 2 (deg), Joint 1 (deg)\n3, 1, 2, -45.5, 90\n"}) {
    const auto batch = parse_robodk_csv(text, "data/rdk.csv");
    ASSERT_TRUE(batch) << text << batch.error().message;
    EXPECT_EQ(batch->id, "rdk");
    ASSERT_EQ(batch->measurements.size(), 1u);
    const Measurement& m = batch->measurements[0];
    ASSERT_EQ(m.context.q.size(), 2) << text;
    EXPECT_NEAR(m.context.q(0), kPi / 2, 1e-15);
    EXPECT_NEAR(m.context.q(1), from_deg(-45.5), 1e-15);
    EXPECT_LT((m.p_W - Vector3(1e-3, 2e-3, 3e-3)).norm(), 1e-15);
    EXPECT_FALSE(m.R_WT);
    EXPECT_EQ(m.pose_id, "1");
  }
}

TEST(RoboDkCsv, KnowsJointsInOtherLanguagesAndCountsThemFromOne) {
  for (const char* text : {"Achse1 [Grad];Achse2 [Grad];X [mm];Y [mm];Z [mm]\n90;-45,5;1;2;3\n",
                           "axe1 (\u00b0);axe2 (\u00b0);X;Y;Z\n90;-45,5;1;2;3\n",
                           "theta_1,theta_2,X,Y,Z\n90,-45.5,1,2,3\n"}) {
    const auto batch = parse_batch(text, "cell.csv");
    ASSERT_TRUE(batch) << text << sentence(batch.error());
    EXPECT_NEAR(batch->measurements[0].context.q(1), from_deg(-45.5), 1e-15) << text;
  }
  EXPECT_EQ(refusal_of(parse_batch("J0,J1,X,Y,Z\n90,-45.5,1,2,3\n", "cell.csv")),
            Refusal("cell.csv", {}, "J0"));
  EXPECT_EQ(refusal_of(parse_batch("q0_deg,q1_deg,x_mm,y_mm,z_mm\n90,-45.5,1,2,3\n", "cell.csv")),
            Refusal("cell.csv", {}, "q0_deg"));
  const auto twice = parse_batch("J1,X,Y,Z,q1,q2,q3,q4\n9,1,2,3,1,0,0,0\n", "cell.csv");
  ASSERT_FALSE(twice);
  EXPECT_NE(twice.error().next.find("qw, qx, qy, qz"), std::string::npos) << twice.error().next;
}

TEST(RoboDkCsv, TurnsEachKindOfAnglesAsItsControllerDoes) {
  const double x = 0.1, y = -0.2, z = 2.5;
  const auto rotation = [](const std::string& names, const std::string& values) {
    const auto batch =
        parse_robodk_csv("J1,X,Y,Z," + names + "\n0,1,2,3," + values + "\n", "rdk.csv");
    EXPECT_TRUE(batch) << batch.error().message;
    return batch ? batch->measurements[0].R_WT.value_or(Matrix3::Zero()) : Matrix3::Zero();
  };
  const auto values = [](double a, double b, double c) {
    return fmt::format("{:.15g},{:.15g},{:.15g}", a, b, c);
  };
  EXPECT_LT(
      (rotation("A,B,C", values(to_deg(z), to_deg(y), to_deg(x))) - turned(x, y, z, "zyx")).norm(),
      1e-12);
  EXPECT_LT(
      (rotation("W,P,R", values(to_deg(x), to_deg(y), to_deg(z))) - turned(x, y, z, "zyx")).norm(),
      1e-12);
  EXPECT_LT((rotation("Rx,Ry,Rz", values(to_deg(x), to_deg(y), to_deg(z))) - turned(x, y, z, "xyz"))
                .norm(),
            1e-12);
  EXPECT_LT((rotation("O,A,T", values(to_deg(z), to_deg(y), 0)) - turned(0, y, z, "zyx")).norm(),
            1e-12);
  EXPECT_LT((rotation("O,A,T", values(0, 0, to_deg(z))) - turned(0, 0, z, "z")).norm(), 1e-12);
  EXPECT_LT((rotation("A (rad),B (rad),C (rad)", values(z, y, x)) - turned(x, y, z, "zyx")).norm(),
            1e-12);
  EXPECT_LT((rotation("qw,qx,qy,qz", "0.6,0,0,0.8") - turned(0, 0, 2 * std::acos(0.6), "z")).norm(),
            1e-12);
}

TEST(RoboDkCsv, ReadsTheExportsByPosition) {
  const auto points = parse_robodk_csv(
      "Axis-1,Axis-2,Axis-3,Axis-4,Axis-5,Axis-6,mx,my,mz,tx,ty,tz\n10,20,30,40,50,60,1,2,3,7,8,9\n"
      "11,20,30,40,50,60,4,5,6,7,8,9\n",
      "rdk.csv");
  ASSERT_TRUE(points) << points.error().message;
  ASSERT_EQ(points->measurements.size(), 2u);
  EXPECT_NEAR(points->measurements[1].context.q(0), from_deg(11), 1e-15);
  EXPECT_LT((points->measurements[1].p_W - Vector3(4e-3, 5e-3, 6e-3)).norm(), 1e-15);
  EXPECT_EQ(points->measurements[1].context.tool, "");
  EXPECT_EQ(points->extra_columns, (std::vector<std::string>{"tcp_x_mm", "tcp_y_mm", "tcp_z_mm"}));
  EXPECT_EQ(points->measurements[0].extra, (std::vector<std::string>{"7", "8", "9"}));

  const auto poses =
      parse_robodk_csv("1,2,3,4,5,6,100,200,300,0.1,-0.2,2.5,7,8,9,0,0,0\n", "rdk.csv");
  ASSERT_TRUE(poses) << poses.error().message;
  EXPECT_LT((poses->measurements[0].R_WT.value_or(Matrix3::Zero()) - turned(0.1, -0.2, 2.5, "xyz"))
                .norm(),
            1e-12);
  EXPECT_EQ(refusal_file("1,2,3,4,5,6,100,200.5,300,10,-20,170,7,8,9,0,0,0\n"),
            Refusal("rdk.csv", 1, "rx_rad").beyond(10, 6.28319));
}

TEST(RoboDkCsv, MakesAToolOfEachTcp) {
  const auto batch = parse_robodk_csv(
      "1,2,3,4,5,6,1,2,3.5,7,8,9\n1,2,3,4,5,7,1,2,3,-7,8,9\n1,2,3,4,5,8,1,2,3,7,8,9\n", "rdk.csv");
  ASSERT_TRUE(batch) << batch.error().message;
  EXPECT_EQ(batch->measurements[0].context.tool, "tcp-1");
  EXPECT_EQ(batch->measurements[1].context.tool, "tcp-2");
  EXPECT_EQ(batch->measurements[2].context.tool, "tcp-1");
}

TEST(RoboDkCsv, ReadsARotationVectorByItsOwnNames) {
  const Vector3 vector(1.9, 0.5, -2.2);
  for (const char* text :
       {"Axis 1,X,Y,Z,rvx_rad,rvy_rad,rvz_rad\n5,1,2,3,1.9,0.5,-2.2\n",
        "J1;X;Y;Z;Rvx;Rvy;Rvz\n5;1;2;3;1,9;0,5;-2,2\n",
        "q1_deg,x_mm,y_mm,z_mm,rvx_rad,rvy_rad,rvz_rad\n5,1,2,3,1.9,0.5,-2.2\n"}) {
    const auto batch = parse_batch(text, "ur.csv");
    ASSERT_TRUE(batch) << text << sentence(batch.error());
    const Measurement& m = batch->measurements.front();
    EXPECT_NEAR(m.context.q(0), from_deg(5), 1e-15) << text;
    EXPECT_LT((m.R_WT.value_or(Matrix3::Zero()) - rotation_exp(vector)).norm(), 1e-12) << text;
  }
  const auto table = parse_batch_table(
      "5 1 2 3 1.9 0.5 -2.2\n", {"q1_deg", "x_mm", "y_mm", "z_mm", "rvx_rad", "rvy_rad", "rvz_rad"},
      "ur.txt");
  ASSERT_TRUE(table) << sentence(table.error());
  EXPECT_LT((*table->measurements.front().R_WT - rotation_exp(vector)).norm(), 1e-12);
  EXPECT_EQ(refusal_of(parse_batch("q1_deg,x_mm,y_mm,z_mm,qw,qx,qy,qz,rvx_rad,rvy_rad,rvz_rad\n"
                                   "5,1,2,3,1,0,0,0,0,0,0\n",
                                   "ur.csv")),
            Refusal("ur.csv", {}, "rvx_rad"));
}

TEST(BatchTable, AFirstLineOfNamesCountsForNothingBesideColumnsThatAreTold) {
  const std::vector<std::string> columns = {"q1_deg",   "x_mm",      "y_mm",   "z_mm",
                                            "roll_deg", "pitch_deg", "yaw_deg"};
  const auto batch = parse_batch_table("J1;X;Y;Z;roll;pitch;yaw\n5;1,5;2;3;30;0;0\n6;1;2;3;0;0;0\n",
                                       columns, "own.csv");
  ASSERT_TRUE(batch) << sentence(batch.error());
  ASSERT_EQ(batch->measurements.size(), 2U);
  EXPECT_NEAR(batch->measurements[0].p_W.x(), 1.5e-3, 1e-12);
  EXPECT_LT((*batch->measurements[0].R_WT - rotation_exp(Vector3(from_deg(30), 0, 0))).norm(),
            1e-12);
}

TEST(RoboDkCsv, WhatWasTakenByItsPlaceIsToldAndATcpOfEachRowIsNone) {
  const auto next_of = [](const std::string& text) {
    const auto batch = parse_robodk_csv(text, "own.csv");
    return batch ? "read" : batch.error().next;
  };
  // Six axes, a position and three angles, under names that nobody else has.
  std::string angles = "r1,r2,r3,r4,r5,r6,east,north,up,yaw,pitch,roll\n";
  for (int row = 0; row < 8; ++row)
    angles += fmt::format("1,2,3,4,5,{},100.5,200,300,{}.5,-20,1{}\n", row, row, row);
  EXPECT_EQ(refusal_file(angles), Refusal("rdk.csv", {}, "tcp_x_mm").beyond(8, 2));
  EXPECT_NE(next_of(angles).find("taken by their places"), std::string::npos) << next_of(angles);
  EXPECT_NE(next_of(angles).find("J1 ... J6, X, Y, Z"), std::string::npos) << next_of(angles);
  const std::string pose_first =
      "east,north,up,yaw,pitch,roll,r1,r2,r3,r4,r5,r6\n4522.31,200,300,1,2,3,4,5,6,7,8,9.5\n";
  EXPECT_NE(next_of(pose_first).find("no column is named J1"), std::string::npos)
      << next_of(pose_first);
  const std::string axes =
      "Axis1,Axis_2,AXIS 3,PosX,PosY,PosZ,RotA,RotB,RotC,a,b,c\n1,2,3,4,5,6,7,8,9,1,2,3\n";
  EXPECT_EQ(recognise_batch(axes), BatchKind::kRoboDk);
  EXPECT_EQ(refusal_file(axes), Refusal("rdk.csv", {}, "X"));
  EXPECT_NE(next_of(axes).find("J1 ... J6, X, Y, Z"), std::string::npos) << next_of(axes);
}

TEST(RoboDkCsv, RefusalsNameFileRowColumnValueAndLimit) {
  EXPECT_EQ(refusal_file(""), Refusal("rdk.csv"));
  EXPECT_EQ(refusal_file("J1,X,Y,Z\n"), Refusal("rdk.csv").beyond(0, 1));
  EXPECT_EQ(refusal_file("1,2,3,4\n"), Refusal("rdk.csv", 1, "J1").value(4));
  EXPECT_EQ(refusal_file("J1,J3,X,Y,Z\n1,2,3,4,5\n"), Refusal("rdk.csv", {}, "J2"));
  EXPECT_EQ(refusal_file("J1,X,Y\n1,2,3\n"), Refusal("rdk.csv", {}, "x").beyond(2, 3));
  EXPECT_EQ(refusal_file("J1,X,Y,Z,A,B,C,W,P,R\n1,2,3,4,5,6,7,8,9,10\n"),
            Refusal("rdk.csv", {}, "orientation"));
  EXPECT_EQ(refusal_file("J1,X,Y,Z\n1,2,3,4\n1,2,c,4\n"), Refusal("rdk.csv", 3, "Y").text("c"));
  EXPECT_EQ(refusal_file("J1,X,Y,Z\n1,2e7,3,4\n"), Refusal("rdk.csv", 2, "X").beyond(2e+07, 1e+06));
  EXPECT_EQ(refusal_file("J1,X,Y,Z\n1,2,3\n"), Refusal("rdk.csv", 2).beyond(3, 4));
  EXPECT_EQ(refusal_file("J1 (mm),J2 (turns),X,Y,Z\n1,2,3,4,5\n"),
            Refusal("rdk.csv", {}, "J2 (turns)").text("turns"));
  EXPECT_EQ(refusal_file("id,J1,X,Y,Z\na,1,2,3,4\na,1,2,3,4\n"),
            Refusal("rdk.csv", 3, "pose_id").text("a"));
}

std::string repeated(const std::string& part, std::size_t times) {
  std::string text;
  text.reserve(part.size() * times);
  for (std::size_t i = 0; i < times; ++i) text += part;
  return text;
}

ErrorCode code_of(const std::string& text) {
  const auto batch = parse_batch(text, "b.csv");
  return batch ? ErrorCode::kBusy : batch.error().code;
}

// Each of these used up the stack, the memory or the time of the daemon.
TEST(BatchFile, OfMillionsOfBytesEndsSoonWhateverItsKind) {
  EXPECT_EQ(code_of("# " + std::string(2'000'000, 'x') + "\np1 1 2 3\n"), ErrorCode::kRefused);
  EXPECT_EQ(code_of("p1 1 2 3 " + std::string(2'000'000, '4') + "\n"), ErrorCode::kTooLarge);
  EXPECT_EQ(code_of("p1 1 2 3 " + repeated("a:", 1'000'000) + "\n"), ErrorCode::kTooLarge);
  EXPECT_EQ(
      code_of("p1;1;2;3\n" + repeated("# units                                   \n", 500'000)),
      ErrorCode::kRefused);
  EXPECT_EQ(code_of(repeated("1\n", 4'000'000)), ErrorCode::kTooLarge);
  EXPECT_EQ(code_of(repeated("1 ", 4'000'000)), ErrorCode::kTooLarge);
  EXPECT_EQ(code_of(repeated(",", 4'000'000)), ErrorCode::kTooLarge);
  EXPECT_EQ(code_of("q1_deg,x_mm,y_mm,z_mm\n" + repeated("1,2,3,4\n", 200'000)),
            ErrorCode::kTooLarge);
  EXPECT_EQ(code_of("J1,X,Y,Z\n" + repeated("1,2,3,4\n", 200'000)), ErrorCode::kTooLarge);
  EXPECT_EQ(code_of("J1;X;Y;Z\n" + repeated("1;", 2'000'000)), ErrorCode::kTooLarge);
  EXPECT_EQ(code_of("q1_deg,x_mm,y_mm,z_mm,note\n1,2,3,4," + std::string(100'000, 'x') + "\n"),
            ErrorCode::kTooLarge);
}

TEST(BatchFile, WhoseIdsAreNoNamesIsRefusedByEveryReader) {
  const std::string escape = "\x1b[2J";
  const std::string columns = "q1_deg,x_mm,y_mm,z_mm";
  for (const char* name : {"pose_id", "tool_id", "payload_id", "note"}) {
    const auto batch = parse_batch(columns + "," + name + "\n1,2,3,4," + escape + "\n", "b.csv");
    ASSERT_FALSE(batch) << name;
    EXPECT_EQ(batch.error().row, 2) << name;
    EXPECT_EQ(sentence(batch.error()).find('\x1b'), std::string::npos) << name;
  }
  EXPECT_FALSE(parse_batch("J1,X,Y,Z,Name\n1,2,3,4,a" + escape + "\n", "b.csv"));
  EXPECT_FALSE(parse_points("a" + escape + " 1 2 3\n", "p.txt"));
  EXPECT_FALSE(parse_batch(columns + ",\"a\tb\"\n1,2,3,4,5\n", "b.csv"));
  EXPECT_FALSE(parse_batch(columns + ",pose_id\n1,2,3,4,\"a\nb\"\n", "b.csv"));
  EXPECT_TRUE(parse_batch(columns + ",note\n1,2,3,4,\"a\nb\"\n", "b.csv"));
  EXPECT_FALSE(parse_batch(columns + ",pose_id\n1,2,3,4,\xff\n", "b.csv"));
  EXPECT_FALSE(parse_batch(columns + ",pose_id\n1,2,3,4," + std::string(300, 'x') + "\n", "b.csv"));
}

TEST(BatchFile, RecognisesKindsByTheirContent) {
  EXPECT_EQ(recognise_batch("q1_deg,x_mm,y_mm,z_mm\n1,2,3,4\n"), BatchKind::kTrammel);
  EXPECT_EQ(recognise_batch("# a\nJ1;J2;X;Y;Z\n1;2;3;4;5\n"), BatchKind::kRoboDk);
  EXPECT_EQ(recognise_batch("a,b,c,d,e,f,g,h,i,j,k,l\n1,2,3,4,5,6,7,8,9,10,11,12\n"),
            BatchKind::kRoboDk);
  EXPECT_EQ(recognise_batch("// SA\nMain p1 1 2 3\n"), BatchKind::kPoints);
  EXPECT_EQ(recognise_batch("name,x_mm,y_mm,z_mm\nR1,1,2,3\n"), BatchKind::kPoints);
  EXPECT_EQ(recognise_batch("x_mm,y_mm,z_mm\n1,2,3\n"), BatchKind::kTrammel);
  EXPECT_EQ(recognise_batch(""), BatchKind::kTrammel);
}

TEST(BatchFile, ReadsBatchesOfEitherKindAndSaysHowPointsBecomeOne) {
  const auto ours = parse_batch("q1_deg,x_mm,y_mm,z_mm\n90,1,2,3\n", "b.csv");
  const auto other = parse_batch("J1;X;Y;Z\n90;1;2;3\n", "b.csv");
  ASSERT_TRUE(ours) << ours.error().message;
  ASSERT_TRUE(other) << other.error().message;
  EXPECT_EQ(to_csv(*ours), to_csv(*other));
  const auto points = parse_batch("Main p1 1 2 3\n", "sa.txt");
  ASSERT_FALSE(points);
  EXPECT_EQ(refusal_of(points), Refusal("sa.txt", {}, "q1_deg"));
  EXPECT_FALSE(points.error().next.empty());
  const auto neither = parse_batch("q1,q2\n1,2\n", "b.csv");
  EXPECT_FALSE(neither);
}

}  // namespace
}  // namespace trammel
