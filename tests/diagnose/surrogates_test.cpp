#include "server/diagnose/search/surrogates.h"

#include <gtest/gtest.h>

#include "tests/support/demand.h"
#include "tests/support/diagnosis_trial.h"
#include "tests/support/quick_diagnosis.h"

namespace trammel::cause_search {
namespace {

struct Unrecorded {
  const char* kind;
  const char* column;
};

// How often what was not recorded is found: diagnose_benchmark --rows unrecorded,null_unrecorded.
TEST(Unrecorded, CauseIsNeverNamedForCertainButAmongWhatItMayBe) {
  for (const Unrecorded& one : {Unrecorded{"backlash", "dir"},
                                {"thermal_growth", "temperature_c"},
                                {"tracker_drift", "time_s"},
                                {"time_lag", "time_s"}}) {
    const hidden::HiddenCase hidden = hidden::hide(
        {.kind = one.kind, .seed = 1, .lambda = 300, .poses = 160, .withheld = {one.column}});
    const Diagnosis diagnosis = test::demand(test::diagnose_files(hidden, test::quick()));
    for (const Finding& finding : diagnosis.findings) {
      EXPECT_FALSE(finding.could_also_be.empty()) << test::told(diagnosis);
    }
    EXPECT_EQ(diagnosis.sources_after, diagnosis.sources_before) << test::told(diagnosis);
    for (const Measurement& m : diagnosis.batch.measurements) {
      EXPECT_EQ(m.context.direction.empty(), std::string(one.column) == "dir");
      EXPECT_EQ(m.context.temperature.has_value(), std::string(one.column) != "temperature_c");
      EXPECT_EQ(m.context.time.has_value(), std::string(one.column) != "time_s");
    }
    EXPECT_TRUE(test::judge(diagnosis, hidden).unrecorded_rightly) << one.kind << "\n"
                                                                   << test::told(diagnosis);
  }
}

TEST(Unrecorded, LagAlongAPathWithoutTimesIsNoStepForCertain) {
  const hidden::HiddenCase hidden = hidden::hide(
      {.kind = "time_lag", .seed = 313, .lambda = 120, .poses = 300, .withheld = {"time_s"}});
  const Diagnosis diagnosis = test::demand(test::diagnose_files(hidden, test::quick()));
  for (const Finding& finding : diagnosis.findings) {
    EXPECT_FALSE(finding.could_also_be.empty()) << test::told(diagnosis);
  }
  EXPECT_TRUE(test::judge(diagnosis, hidden).set_holds_truth) << test::told(diagnosis);
}

TEST(Unrecorded, SidesDrawnAtRandomAreNoCause) {
  const hidden::HiddenCase hidden = hidden::hide(
      {.kind = "backlash", .seed = 4, .lambda = 300, .poses = 160, .withheld = {"dir"}});
  ASSERT_TRUE(hidden.truth.untraceable);
  const Diagnosis diagnosis = test::demand(test::diagnose_files(hidden, test::quick()));
  EXPECT_TRUE(diagnosis.findings.empty()) << test::told(diagnosis);
}

TEST(Unrecorded, DirectionIsThatOfTheWayFromThePoseBefore) {
  MeasurementBatch batch;
  for (const double angle : {0.1, 0.4, 0.4, -0.2}) {
    Measurement m;
    m.context.q = JointVector::Constant(1, angle);
    batch.measurements.push_back(m);
  }
  const Surrogates put = put_in_surrogates(batch);
  EXPECT_TRUE(put.time && put.temperature && put.direction);
  std::vector<int> directions;
  for (const Measurement& m : batch.measurements) directions.push_back(m.context.direction.at(0));
  EXPECT_EQ(directions, (std::vector<int>{0, 1, 1, -1}));  // a joint that stays stands as it came
  take_out_surrogates(put, batch);
  EXPECT_TRUE(batch.measurements[1].context.direction.empty());
  EXPECT_FALSE(batch.measurements[1].context.time || batch.measurements[1].context.temperature);
}

TEST(Unrecorded, DirectionOfAPoseIsKnownWhereTheOneBeforeWasSetAside) {
  MeasurementBatch whole;
  for (const double angle : {0.1, 0.4, 0.2}) {
    Measurement m;
    m.context.q = JointVector::Constant(1, angle);
    m.context.index = static_cast<int>(whole.measurements.size());
    whole.measurements.push_back(m);
  }
  MeasurementBatch part = whole;
  part.measurements.erase(part.measurements.begin() + 1);
  const Surrogates put = put_in_surrogates(whole);
  take_over_surrogates(put, whole, part);
  EXPECT_EQ(part.measurements.at(1).context.direction, std::vector<int>{-1})
      << "0.2 is above 0.1, but came from 0.4";
}

}  // namespace
}  // namespace trammel::cause_search
