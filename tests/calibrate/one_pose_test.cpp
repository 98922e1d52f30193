#include <gtest/gtest.h>

#include "server/base/units.h"
#include "server/calibrate/calibrate.h"
#include "tests/support/demand.h"
#include "tests/support/three_reflectors.h"

// The error that reflectors of one pose share is one witness of the arm, however many they are.

namespace trammel {
namespace {

const std::vector<std::string> kSources = {"base", "geometry", "compliance"};

CalibrationResult identified(const MeasurementBatch& batch) {
  return test::demand(calibrate(test::cell_of_three_reflectors(), kSources, batch, {}));
}

/// Mean standard deviation of what was identified, in units of that of another calibration.
double less_sure(const CalibrationResult& one, const CalibrationResult& other) {
  double sum = 0, count = 0;
  for (std::size_t k = 0; k < one.parameters.size(); ++k) {
    if (!other.parameters[k].identified) continue;
    sum += one.parameters[k].stddev / other.parameters[k].stddev;
    ++count;
  }
  return sum / count;
}

TEST(ReflectorsOfOnePose, AreOnePoseWhereTheyShareWhatTheModelLeaves) {
  const MeasurementBatch three = test::seen_by_three(60, 60e-6, 0, 3);
  const CalibrationResult together = identified(three),
                          alone = identified(test::seen_by_one(three));
  EXPECT_NEAR(to_mm(together.discrepancy_of_pose), 0.06, 0.012);
  EXPECT_NEAR(together.discrepancy, together.discrepancy_of_pose, 0.25 * together.discrepancy);
  // They tell how the flange is turned, too, and each has noise of its own; as three poses they
  // were at 0.55.
  EXPECT_GT(less_sure(together, alone), 0.75);
  EXPECT_LT(less_sure(together, alone), 1.1);
}

TEST(ReflectorsOfOnePose, AreThreePosesWhereEachErrsByItself) {
  const MeasurementBatch three = test::seen_by_three(60, 0, 60e-6, 4);
  const CalibrationResult together = identified(three),
                          alone = identified(test::seen_by_one(three));
  EXPECT_NEAR(to_mm(together.discrepancy), 0.06, 0.012);
  EXPECT_LT(to_mm(together.discrepancy_of_pose), 0.045) << "a mean of three is off by that";
  EXPECT_LT(less_sure(together, alone), 0.68);
}

TEST(ReflectorsOfOnePose, ThatAreAsGoodAsStatedLeaveNoDiscrepancy) {
  const CalibrationResult together = identified(test::seen_by_three(60, 0, 0, 5));
  EXPECT_LT(to_mm(together.discrepancy), 0.004);
  EXPECT_LT(to_mm(together.discrepancy_of_pose), 0.006);
}

}  // namespace
}  // namespace trammel
