#include <gtest/gtest.h>

#include <algorithm>

#include "server/base/units.h"
#include "server/calibrate/calibrate.h"
#include "tests/support/calibrated.h"
#include "tests/support/demand.h"
#include "tests/support/heavy_arm.h"
#include "tests/support/virtual_robot.h"

// Arms of the second simulation whose links weigh, and nobody says how much.
namespace trammel {
namespace {

using test::draw_heavy_arm;
using test::HeavyArm;

const std::vector<std::string> kM3 = {"base", "geometry", "compliance"};
const double kSelfWeightNoise_mm = 0.013 * std::sqrt(3.0);

double held_out_mm(const CalibrationResult& result, const MeasurementBatch& batch) {
  double sum = 0;
  for (const Measurement& m : batch.measurements)
    sum += (m.p_W - result.model.pose_W(m.context).translation()).squaredNorm();
  return to_mm(std::sqrt(sum / static_cast<double>(batch.measurements.size())));
}

CalibrationResult calibrated(const HeavyArm& arm, const std::vector<std::string>& sources,
                             int poses, bool weigh_links = true) {
  return test::demand(calibrate(arm.cell, sources, test::measured(arm, poses, 1),
                                {.held = {}, .weigh_links = weigh_links}));
}

bool has(const CalibrationResult& result, const std::string& source) {
  return std::any_of(result.model.sources.begin(), result.model.sources.end(),
                     [&](const ErrorSourcePtr& one) { return one->name() == source; });
}

TEST(LinkWeights, ComplianceFindsTheWeightsThatNoDataSheetTold) {
  for (const int payloads : {0, 1, 2}) {
    const HeavyArm arm = draw_heavy_arm({.seed = 3, .payloads = payloads});
    const MeasurementBatch fresh = test::measured(arm, 500, 2);
    const CalibrationResult found = calibrated(arm, kM3, 600);
    EXPECT_TRUE(has(found, "self_weight")) << payloads << " payloads";
    EXPECT_LE(held_out_mm(found, fresh), 1.05 * kSelfWeightNoise_mm) << payloads << " payloads";
    EXPECT_GE(held_out_mm(calibrated(arm, kM3, 600, false), fresh), 2 * kSelfWeightNoise_mm)
        << payloads << " payloads";
  }
}

TEST(LinkWeights, AreNotAddedWhereTheControllerCompensatesThem) {
  const auto cell = test::cell_7();
  const CalibrationResult found =
      test::demand(calibrate(cell, kM3, test::measured(test::chapter_5_robot(cell), 200, 1),
                             {.held = {}, .weigh_links = true}));
  EXPECT_FALSE(has(found, "self_weight"));
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    const HeavyArm light = draw_heavy_arm({.seed = seed, .links_weigh = false});
    EXPECT_FALSE(has(calibrated(light, kM3, 200), "self_weight")) << "seed " << seed;
  }
}

TEST(LinkWeights, BesideUnknownCompliancesAreFoundInFewStepsThoughOnlyTheirProductIsSeen) {
  // The controller compensates the links' weights and the cell does not say so: only the priors
  // tell the weights from the compliances, and the way to what they like best is bent.
  const auto cell = test::cell_7();
  const MeasurementBatch batch = test::measured(test::chapter_5_robot(cell), 1500, 1, false);
  const CalibrationResult found = test::demand(
      calibrate(cell, {"base", "geometry", "self_weight", "compliance_linear"}, batch, {}));
  EXPECT_TRUE(found.converged);
  EXPECT_LE(found.iterations, 30);
}

TEST(LinkWeights, EveryArmIsPredictedToTheNoiseWhateverItWeighs) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const HeavyArm arm = draw_heavy_arm({.seed = seed});
    const CalibrationResult found = calibrated(arm, kM3, 300);
    EXPECT_LE(held_out_mm(found, test::measured(arm, 500, 2)), 1.09 * kSelfWeightNoise_mm)
        << "seed " << seed;
  }
}

TEST(LinkWeights, WithTwoKnownPayloadsTheSagOfAThirdIsKnown) {
  HeavyArm arm = draw_heavy_arm({.seed = 5, .payloads = 2});
  const CalibrationResult found = calibrated(arm, kM3, 600);
  // A third payload, as a cell file would tell it.
  auto cell = std::make_shared<Cell>(*arm.cell);
  cell->payloads["load-2"] = Payload{160, {0.02, 0.03, 0.2}};
  arm.world.loads[1] = {160, {20, 30, 200}};
  CalibrationResult changed = found;
  changed.model.cell = cell;
  EXPECT_LE(held_out_mm(changed, test::measured(arm, 500, 2, 1)), 1.1 * kSelfWeightNoise_mm);
}

TEST(LinkWeights, ABalancerAndASoftFootAreTakenForWhatTheyAre) {
  const HeavyArm arm = draw_heavy_arm({.seed = 7, .balancer = true, .soft_foot = true});
  const MeasurementBatch fresh = test::measured(arm, 500, 2);
  const std::vector<std::string> all = {"base",        "geometry",   "compliance",
                                        "self_weight", "balancer:2", "base_compliance"};
  EXPECT_LE(held_out_mm(calibrated(arm, all, 600), fresh), 1.05 * kSelfWeightNoise_mm);
  for (const char* without : {"balancer:2", "base_compliance"}) {
    std::vector<std::string> fewer = all;
    std::erase(fewer, without);
    EXPECT_GE(held_out_mm(calibrated(arm, fewer, 600), fresh), 1.1 * kSelfWeightNoise_mm)
        << without;
  }
}

TEST(LinkWeights, TradeAFactorWithTheCompliancesUntilAKnownPayloadChanges) {
  const HeavyArm bare = draw_heavy_arm({.seed = 3, .payloads = 0});
  const HeavyArm changing = draw_heavy_arm({.seed = 3, .payloads = 2});
  const CalibrationResult open = calibrated(bare, kM3, 600);
  const CalibrationResult told = calibrated(changing, kM3, 600);
  for (const int joint : {2, 3, 5}) {
    const IdentifiedParameter& one = test::parameter(open, fmt::format("C{}", joint));
    const IdentifiedParameter& other = test::parameter(told, fmt::format("C{}", joint));
    const double truth = from_rad_per_nmm(changing.world.arm.give(joint - 1));
    EXPECT_GT(one.stddev, 0.3 * one.value) << joint;
    EXPECT_LT(other.stddev, 0.05 * other.value) << joint;
    EXPECT_NEAR(other.value, truth, 3 * other.stddev) << joint;
  }
  // Together they are known: the more weight, the less compliance.
  const auto index = [&](const std::string& name) {
    return &test::parameter(open, name) - open.parameters.data();
  };
  EXPECT_LT(open.correlation()(index("C2"), index("wx2")), -0.9);
}

}  // namespace
}  // namespace trammel
