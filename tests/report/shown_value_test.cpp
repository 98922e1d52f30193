#include "server/report/shown_value.h"

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

}  // namespace
}  // namespace trammel
