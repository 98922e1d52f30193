#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "server/diagnose/diagnose.h"
#include "server/diagnose/tell/doubts.h"
#include "server/measurement/files/batch_file.h"
#include "tests/support/demand.h"
#include "tests/support/quick_diagnosis.h"
#include "tests/support/virtual_robot.h"

// A name is sure only where noise is all that is left.

namespace trammel {
namespace {

TEST(BestShape, IsSaidSoAndStillCompensated) {
  const Cause coupling{"wrist_coupling"};
  MeasurementBatch recorded = test::measured(test::chapter_5_robot(test::cell_7()), 20, 1);
  for (Measurement& m : recorded.measurements) {
    m.context.time = m.context.index;
    m.context.temperature = 20;
  }
  const Unexplained nothing;
  const std::vector<Cause> found = {coupling};
  const auto judged = [&](bool more_than_noise, bool in_both_halves) {
    return cause_search::judge(coupling, {1e-4, in_both_halves}, {},
                               {found, nothing, {}, recorded, more_than_noise});
  };
  EXPECT_TRUE(judged(false, true).could_also_be.empty());
  EXPECT_TRUE(judged(false, true).whole);
  EXPECT_EQ(judged(true, true).could_also_be, std::vector<Cause>{{"unknown"}});
  EXPECT_FALSE(judged(true, true).whole) << "the best known shape of what is there";
  EXPECT_EQ(judged(true, false).could_also_be, std::vector<Cause>{{"unknown"}});
  EXPECT_TRUE(judged(true, false).whole) << "perhaps nothing at all";
  EXPECT_NE(judged(true, false).action.find("half of these"), std::string::npos);
}

TEST(BestShape, OfARealRobotNothingIsSureThatLeavesMoreThanNoiseNorASmallStep) {
  const std::string file = TRAMMEL_SOURCE_DIR "/../shared/data/ur10_series_c.csv";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << file << " is not there";
  MeasurementBatch batch = test::demand(read_batch(file));
  for (std::size_t i = 0; 9 * i < batch.measurements.size(); ++i)
    batch.measurements[i] = batch.measurements[9 * i];
  batch.measurements.resize((batch.measurements.size() + 8) / 9);
  const auto cell =
      std::make_shared<const Cell>(test::demand(read_cell(TRAMMEL_SOURCE_DIR "/config/ur10.yaml")));
  const Diagnosis real = test::demand(diagnose(cell, batch, test::quick()));
  EXPECT_NE(real.verdict, Verdict::kNamed) << real.sentence;
  bool maps = false;
  for (const Finding& finding : real.findings) {
    EXPECT_FALSE(finding.could_also_be.empty()) << to_string(finding.cause) << ' ' << real.sentence;
    if (finding.cause.cause != "joint_map") continue;
    maps = true;
    EXPECT_FALSE(finding.whole) << "it goes into the model all the same";
  }
  EXPECT_TRUE(maps);
  const auto& after = real.sources_after;
  EXPECT_TRUE(std::any_of(after.begin(), after.end(),
                          [](const auto& one) { return one.starts_with("joint_map:2@"); }));
  EXPECT_TRUE(std::none_of(after.begin(), after.end(),
                           [](const auto& one) { return one.starts_with("tool_changed"); }));
}

}  // namespace
}  // namespace trammel
