#include "server/base/shown_value.h"

#include <gtest/gtest.h>

namespace trammel {
namespace {

TEST(ShownValue, IsRoundedToTwoDigitsOfItsUncertainty) {
  const auto shown = [](double value, double expanded) {
    const ShownValue text = show_with_uncertainty(value, expanded);
    return text.value + " +- " + text.expanded;
  };
  EXPECT_EQ(shown(0.498731, 0.00213), "0.4987 +- 0.0021");
  EXPECT_EQ(shown(812.4, 183.2), "810 +- 180");
  EXPECT_EQ(shown(-12.34567, 0.51), "-12.35 +- 0.51");
  EXPECT_EQ(shown(1.698e-3, 1.23e-5), "1.698e-03 +- 1.2e-05");
  EXPECT_EQ(shown(2.8e-10, 3.1e-12), "2.800e-10 +- 3.1e-12");
  EXPECT_EQ(shown(0, 1e-9), "0.0e+00 +- 1.0e-09");
  EXPECT_EQ(shown(1e-12, 1e-9), "1e-12 +- 1.0e-09");
  EXPECT_EQ(shown(1234, 56), "1234 +- 56");
  EXPECT_EQ(shown(1.25, 0), "1.25 +- 0");
}

TEST(ShownValue, AnglesAreReadInDegreesWithoutPowersOfTen) {
  const auto shown = [](double value, double expanded, const std::string& unit) {
    const Reading reading = reading_of(unit);
    const ShownValue text = show_read(value, expanded, reading);
    return text.value + " +- " + text.expanded + " " + reading.unit;
  };
  EXPECT_EQ(shown(1.698e-3, 1.23e-5, "rad"), "0.09729 +- 0.00070 deg");
  EXPECT_EQ(shown(2.8e-10, 3.1e-12, "rad/Nmm"), "0.01604 +- 0.00018 deg/kNm");
  EXPECT_EQ(shown(0.498731, 0.0000213, "mm"), "0.498731 +- 0.000021 mm");
  EXPECT_EQ(shown(812.4, 183.2, "mm"), "810 +- 180 mm");
  EXPECT_EQ(shown(3.25, 0.4, "um/m/K"), "3.25 +- 0.40 um/m/K");
  EXPECT_EQ(shown(1, 0, "rad"), "57.3 +- 0 deg");
}

}  // namespace
}  // namespace trammel
