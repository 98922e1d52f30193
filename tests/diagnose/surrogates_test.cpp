#include "server/diagnose/surrogates.h"

#include <gtest/gtest.h>

#include "tests/support/demand.h"
#include "tests/support/diagnosis_trial.h"
#include "tests/support/hidden_columns.h"

namespace trammel {
namespace {

DiagnoseOptions quick() {
  DiagnoseOptions options;
  options.draws = 200;
  options.next_poses = 0;
  options.recovery = false;
  return options;
}

struct Unrecorded {
  const char* kind;
  std::vector<std::string> columns;
};

TEST(Unrecorded, CauseIsNeverNamedForCertainAndMostlyAmongWhatItMayBe) {
  int cases = 0, holds = 0;
  for (const Unrecorded& one :
       {Unrecorded{"backlash", {"dir"}}, {"thermal_growth", {"temperature_c"}}, {"tracker_drift", {"time_s"}}}) {
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
      hidden::HiddenCase hidden = hidden::hide({.kind = one.kind, .seed = seed, .lambda = 300, .poses = 160});
      hidden.batch_csv = hidden::without_columns(hidden.batch_csv, one.columns);
      const Diagnosis diagnosis = test::demand(test::diagnose_files(hidden, quick()));
      ++cases;
      for (const Finding& finding : diagnosis.findings) {
        EXPECT_FALSE(finding.cause.cause == one.kind && finding.could_also_be.empty()) << test::told(diagnosis);
      }
      EXPECT_EQ(diagnosis.sources_after, diagnosis.sources_before) << test::told(diagnosis);
      for (const Measurement& m : diagnosis.batch.measurements) {
        EXPECT_EQ(m.context.direction.empty(), std::string(one.kind) == "backlash");
        EXPECT_EQ(m.context.temperature.has_value(), std::string(one.kind) != "thermal_growth");
        EXPECT_EQ(m.context.time.has_value(), std::string(one.kind) != "tracker_drift");
      }
      holds += test::judge(diagnosis, hidden).set_holds_truth || diagnosis.verdict == Verdict::kUnknown ? 1 : 0;
    }
  }
  EXPECT_GE(holds, 3 * cases / 4) << "of " << cases;
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
  EXPECT_EQ(directions, (std::vector<int>{0, 1, 0, -1}));
  take_out_surrogates(put, batch);
  EXPECT_TRUE(batch.measurements[1].context.direction.empty());
  EXPECT_FALSE(batch.measurements[1].context.time || batch.measurements[1].context.temperature);
}

}  // namespace
}  // namespace trammel
