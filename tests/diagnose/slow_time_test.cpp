#include <gtest/gtest.h>

#include <algorithm>

#include "server/diagnose/tell/doubts.h"
#include "tests/support/demand.h"
#include "tests/support/diagnosis_trial.h"
#include "tests/support/quick_diagnosis.h"
#include "tests/support/virtual_robot.h"

// What moves slowly in the course of a batch is no step, however many steps come near it.

namespace trammel {
namespace {

bool begins(const Cause& cause) { return !cause.pose_id.empty() && cause.cause != "outlier"; }

class SlowTime : public testing::TestWithParam<const char*> {};

TEST_P(SlowTime, IsNotNamedAStepAndNothingOfItGoesIntoTheCell) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    for (const double lambda : {150.0, 2000.0}) {
      const hidden::HiddenCase hidden =
          hidden::hide({.kind = GetParam(), .seed = seed, .lambda = lambda, .poses = 200});
      const Diagnosis diagnosis = test::demand(test::diagnose_files(hidden, test::quick()));
      const std::string shown =
          fmt::format("seed {} lambda {}: {}", seed, lambda, diagnosis.sentence);
      for (const Finding& finding : diagnosis.findings)
        EXPECT_FALSE(begins(finding.cause) && finding.could_also_be.empty()) << shown;
      for (const std::string& source : diagnosis.sources_after)
        EXPECT_EQ(source.find('@'), std::string::npos) << source << ' ' << shown;
      const auto& on = diagnosis.unexplained.depends_on;
      const bool slow = std::find(on.begin(), on.end(), "time") != on.end();
      const bool steady =
          std::any_of(diagnosis.findings.begin(), diagnosis.findings.end(),
                      [](const Finding& f) { return f.cause.cause == "tracker_drift"; });
      const bool open = !diagnosis.findings.empty() && !diagnosis.findings[0].could_also_be.empty();
      EXPECT_TRUE(slow || steady || open) << shown;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Effects, SlowTime,
                         testing::Values("slow_zero", "slow_stand", "slow_growth"),
                         [](const auto& kind) { return std::string(kind.param).substr(5); });

TEST(SlowTime, AStepIsStillAStep) {
  for (const char* kind : {"joint_slip", "tracker_moved", "tool_changed"}) {
    for (const std::uint64_t seed : {21, 22, 23}) {
      const hidden::HiddenCase hidden =
          hidden::hide({.kind = kind, .seed = seed, .lambda = 150, .poses = 200});
      const Diagnosis diagnosis = test::demand(test::diagnose_files(hidden, test::quick()));
      EXPECT_TRUE(test::judge(diagnosis, hidden).exact)
          << kind << seed << ' ' << diagnosis.sentence;
    }
  }
}

TEST(SlowTime, NoiseOfLongTailsOrThatLastsIsNoCause) {
  for (const char* noise : {"heavy", "lasting"}) {
    for (const std::uint64_t seed : {1, 2, 3}) {
      hidden::HiddenSpec spec{.kind = "null_white", .seed = seed, .poses = 150};
      spec.noise = noise;
      const Diagnosis diagnosis =
          test::demand(test::diagnose_files(hidden::hide(spec), test::quick()));
      for (const Finding& finding : diagnosis.findings)
        EXPECT_TRUE(finding.cause.cause == "outlier" || !finding.could_also_be.empty())
            << diagnosis.sentence;
    }
  }
}

TEST(TwoStepsOfOneCause, AreDoubtedAndOneIsNot) {
  const Cause first{.cause = "joint_slip", .joint = 2, .pose_id = "p10"};
  const Cause second{.cause = "joint_slip", .joint = 2, .pose_id = "p90"};
  const Cause other{.cause = "joint_slip", .joint = 3, .pose_id = "p90"};
  MeasurementBatch recorded = test::measured(test::chapter_5_robot(test::cell_7()), 20, 1);
  for (Measurement& m : recorded.measurements) {
    m.context.time = m.context.index;
    m.context.temperature = 20;
  }
  const Unexplained nothing;
  const std::vector<Cause> twice = {first, second, other}, once = {first, other};
  const auto judged = [&](const Cause& cause, const std::vector<Cause>& found) {
    return cause_search::judge(cause, {1e-4}, {}, {found, nothing, {}, recorded});
  };
  EXPECT_EQ(judged(first, twice).could_also_be, (std::vector<Cause>{{"unknown", 2}}));
  EXPECT_NE(judged(second, twice).action.find("moves slowly"), std::string::npos);
  EXPECT_TRUE(judged(other, twice).could_also_be.empty());
  EXPECT_TRUE(judged(first, once).could_also_be.empty());
}

}  // namespace
}  // namespace trammel
