#include "server/robot/three_numbers.h"

#include <gtest/gtest.h>

#include "server/base/units.h"

namespace trammel {
namespace {

Matrix3 about(int axis, double angle) { return rotation_exp(angle * Vector3::Unit(axis)); }

const ThreeNumbers& way(const std::array<std::string, 3>& columns) {
  const ThreeNumbers* found = way_of_columns(columns);
  EXPECT_NE(found, nullptr) << columns[0];
  return *found;
}

TEST(ThreeNumbers, MeanWhatTheMakersOfTheirColumnsSay) {
  const Vector3 n(0.3, -0.7, 1.1);
  const auto expect = [&](const std::array<std::string, 3>& columns, const Matrix3& R) {
    EXPECT_LT((way(columns).rotation(n).toRotationMatrix() - R).norm(), 1e-12) << columns[0];
  };
  expect({"a", "b", "c"}, about(2, n(0)) * about(1, n(1)) * about(0, n(2)));
  expect({"w", "p", "r"}, about(2, n(2)) * about(1, n(1)) * about(0, n(0)));
  expect({"roll", "pitch", "yaw"}, about(2, n(2)) * about(1, n(1)) * about(0, n(0)));
  expect({"rx", "ry", "rz"}, about(0, n(0)) * about(1, n(1)) * about(2, n(2)));
  expect({"o", "a", "t"}, about(2, n(0)) * about(1, n(1)) * about(2, n(2)));
  expect({"rvx", "rvy", "rvz"}, rotation_exp(n));
  EXPECT_EQ(way_of_columns({"x", "y", "z"}), nullptr);
}

TEST(ThreeNumbers, OfARotationAreTwoTriplesThatBothTellItAndTheSmallerOneComesFirst) {
  const Matrix3 R = about(0, 2.5) * about(2, -0.4) * about(1, 1.2);
  EXPECT_EQ(ways_of_three_numbers().size(), 14U) << "5 with columns, and 9 other orders";
  for (const ThreeNumbers& one : ways_of_three_numbers()) {
    const auto both = one.numbers(R);
    EXPECT_LE(both[0].cwiseAbs().maxCoeff(), both[1].cwiseAbs().maxCoeff()) << one.name;
    for (const Vector3& numbers : both) {
      EXPECT_LE(numbers.cwiseAbs().maxCoeff(), kPi) << one.name;
      EXPECT_LT((one.rotation(numbers).toRotationMatrix() - R).norm(), 1e-9) << one.name;
    }
  }
}

TEST(ThreeNumbers, AreShownAsTheirMakersWriteTheirColumns) {
  EXPECT_EQ(way({"a", "b", "c"}).columns_text(), "A, B, C");
  EXPECT_EQ(way({"rx", "ry", "rz"}).columns_text(), "Rx, Ry, Rz");
  EXPECT_EQ(way({"rvx", "rvy", "rvz"}).columns_text(), "rvx, rvy, rvz");
}

}  // namespace
}  // namespace trammel
