#include "server/measurement/unread_columns.h"

#include <gtest/gtest.h>

#include "server/base/units.h"
#include "server/measurement/files/batch_file.h"
#include "tests/support/demand.h"

namespace trammel {
namespace {

/// The sentence on a file with these further columns, whose numbers change from row to row.
std::string said_of(const std::string& columns, const std::string& first = "1,2,3",
                    const std::string& second = "4,5,6") {
  return unread_columns(test::demand(parse_batch(
      "q1_deg,x_mm,y_mm,z_mm," + columns + "\n10,1,2,3," + first + "\n20,4,5,6," + second + "\n",
      "b.csv")));
}

bool says(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(UnreadColumns, AnOrientationWithoutItsUnitIsNamedWithTheColumnsThatWouldBeRead) {
  const std::string yaw = said_of("roll,pitch,yaw");
  EXPECT_TRUE(says(yaw, "columns roll, pitch, yaw hold numbers and are not used")) << yaw;
  EXPECT_TRUE(says(yaw, "name them roll_deg, pitch_deg, yaw_deg")) << yaw;
  EXPECT_TRUE(says(yaw, "--columns")) << yaw;
  const std::string rx = said_of("Rx,Ry,Rz");
  EXPECT_TRUE(says(rx, "rx_deg, ry_deg, rz_deg")) << rx;
  EXPECT_TRUE(says(rx, "rvx_rad, rvy_rad, rvz_rad")) << "Universal Robots' are a vector: " << rx;
}

TEST(UnreadColumns, ADirectionIsSaidToTellNoOrientation) {
  const std::string ijk = said_of("I,J,K");
  EXPECT_TRUE(says(ijk, "columns I, J, K hold numbers")) << ijk;
  EXPECT_TRUE(says(ijk, "I, J, K look like a direction")) << ijk;
}

TEST(UnreadColumns, EveryColumnOfNumbersIsNamedOnceAndTextsAndConstantsAreNot) {
  const std::string said = said_of("pressure,operator,serial", "1013.2,Ada,7", "1013.4,Bob,7");
  EXPECT_TRUE(says(said, "column pressure holds numbers and is not used")) << said;
  EXPECT_FALSE(says(said, "operator") || says(said, "serial")) << said;
  EXPECT_EQ(said_of("operator,note,serial", "Ada,x,7", "Bob,y,7"), "");
}

TEST(UnreadColumns, OfAFileInOtherNamesAreToldToo) {
  const auto batch = test::demand(
      parse_batch("J1,X,Y,Z,i,j,k\n10,1,2,3,0.1,0.2,0.9\n20,4,5,6,0.2,0.1,0.9\n", "rdk.csv"));
  EXPECT_TRUE(says(unread_columns(batch), "i, j")) << unread_columns(batch);
}

TEST(UnreadColumns, AnOrientationThatSaysItsUnitIsReadInEveryWayOfMakers) {
  const auto read = [](const std::string& columns) {
    const auto batch = test::demand(
        parse_batch("q1_deg,x_mm,y_mm,z_mm," + columns + "\n5,1,2,3,30,-20,10\n", "b.csv"));
    EXPECT_TRUE(batch.extra_columns.empty()) << columns;
    return batch.measurements.front().R_WT.value_or(Matrix3::Identity());
  };
  const auto about = [](int axis, double deg) {
    return Matrix3(rotation_exp(from_deg(deg) * Vector3::Unit(axis)));
  };
  const Matrix3 kuka = about(2, 30) * about(1, -20) * about(0, 10);
  EXPECT_LT((read("A_deg,B_deg,C_deg") - kuka).norm(), 1e-12);
  const Matrix3 fixed = about(2, 10) * about(1, -20) * about(0, 30);
  EXPECT_LT((read("w_deg,p_deg,r_deg") - fixed).norm(), 1e-12);
  EXPECT_LT((read("roll_deg,pitch_deg,yaw_deg") - fixed).norm(), 1e-12);
  EXPECT_LT((read("rx_deg,ry_deg,rz_deg") - about(0, 30) * about(1, -20) * about(2, 10)).norm(),
            1e-12);
  EXPECT_LT(
      (read("rvx_deg,rvy_deg,rvz_deg") - rotation_exp(from_deg(1) * Vector3(30, -20, 10))).norm(),
      1e-12);
}

}  // namespace
}  // namespace trammel
