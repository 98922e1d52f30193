#include "server/measurement/gauges.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/base/units.h"
#include "server/compensate/model_file.h"
#include "server/compensate/model_notes.h"
#include "server/compensate/world.h"
#include "server/diagnose/diagnose.h"
#include "server/health/health_check.h"
#include "server/tasks/train/train.h"
#include "server/trainer/compute/job_batches.h"
#include "tests/support/demand.h"
#include "tests/support/gauged_arm.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::demand;
using test::GaugedArm;

constexpr double kSigma = 0.05;  // mm

CheckedBatch checked(const GaugedArm& arm, const std::vector<test::GaugeRow>& rows,
                     std::uint64_t seed, double held_out = 0) {
  return demand(
      check_against_cell(demand(parse_batch_csv(test::gauge_text(rows, kSigma, seed), "wires.csv")),
                         *arm.cell, drawn(held_out, 1)));
}

TrainOptions without_bias() {
  TrainOptions options;
  options.bias = "none";
  return options;
}

TEST(TrainedFromTouches, APlaneThatIsToldAskewWaitsForAPerson) {
  const auto stops = [](double askew_deg) {
    const double askew = from_deg(askew_deg);
    const GaugedArm arm = test::gauged_arm(
        23, {},
        fmt::format("{{table: {{xyz_mm: [1200, 0, 300], plane_normal: [{:.9f}, 0, {:.9f}]}}}}",
                    std::sin(askew), std::cos(askew)));
    std::vector<test::GaugeRow> rows = test::position_rows(arm, 160, 23);
    for (std::size_t i = 0; i < rows.size(); i += 2) {
      rows[i].column = "touch_mm";
      rows[i].anchor = "table";
      rows[i].value_mm = rows[i].p_mm.z() - 300;
    }
    const std::vector<Note> notes =
        notes_of(demand(train(arm.cell, checked(arm, rows, 23), without_bias())));
    return std::count_if(notes.begin(), notes.end(), [](const Note& note) {
      return note.severity == Note::Severity::kStop &&
             (note.code == "left_over_sigma" || note.code == "rows_do_not_fit");
    });
  };
  EXPECT_EQ(stops(0), 0);
  EXPECT_EQ(stops(2), 1);
}

class TrainedFromWires : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    arm_ = test::gauged_arm(21, test::three_corners(), test::unknown_places(test::three_corners()));
    batch_ = checked(arm_, test::wire_rows(arm_, 240, 21), 21, 0.2);
    model_ = demand(train(arm_.cell, *batch_, without_bias()));
  }
  static void TearDownTestSuite() {
    model_.reset();
    batch_.reset();
    arm_ = {};
  }
  static inline GaugedArm arm_;
  static inline std::optional<CheckedBatch> batch_;
  static inline std::optional<CompensatedModel> model_;
};

TEST_F(TrainedFromWires, FiguresAreThoseOfDistancesAndNeverOfPositions) {
  const auto& validation = model_->parts().validation;
  ASSERT_TRUE(validation);
  EXPECT_EQ(validation->poses, 0);
  EXPECT_TRUE(std::isnan(validation->compensated.rms)) << "no position was measured";
  ASSERT_TRUE(validation->gauges);
  EXPECT_EQ(validation->gauges->rows, 48);
  EXPECT_GT(validation->gauges->nominal, 5e-4);
  EXPECT_LT(validation->gauges->compensated, 1.6 * kSigma * 1e-3);
  EXPECT_GE(validation->gauges->coverage_95, 0.85);
  EXPECT_TRUE(model_->provenance().level.starts_with("base,anchors,geometry,compliance"))
      << model_->provenance().level;
}

TEST_F(TrainedFromWires, IsReadFromItsFileAsItWas) {
  const CompensatedModel again = demand(deserialize(serialize(*model_), "m.model"));
  EXPECT_EQ(again.provenance().hash, model_->provenance().hash);
  EXPECT_EQ(again.parts().validation->poses, 0);
  EXPECT_TRUE(std::isnan(again.parts().validation->compensated.rms));
  const auto fresh = checked(arm_, test::wire_rows(arm_, 60, 22), 22).rows();
  const Evaluation evaluation = again.evaluate(demand(in_world_of(again, fresh)).batch);
  ASSERT_TRUE(evaluation.gauges);
  EXPECT_EQ(evaluation.gauges->rows, 60);
  EXPECT_LT(evaluation.gauges->compensated, 1.6 * kSigma * 1e-3);
  EXPECT_GE(evaluation.gauges->coverage_95, 0.85);
}

TEST_F(TrainedFromWires, WhatWorksWithPositionsRefusesTheBatchAndSaysWhatToDo) {
  const auto says = [](const auto& result) {
    return result ? std::string("took it") : result.error().message;
  };
  EXPECT_NE(says(diagnose(arm_.cell, *batch_, {})).find("diagnose works with positions alone"),
            std::string::npos);
  EXPECT_NE(says(check_health(*model_, *batch_, {})).find("a check works with positions alone"),
            std::string::npos);
  TrainOptions with_bias = without_bias();
  with_bias.bias = "se";
  const auto with_kernel = train(arm_.cell, *batch_, with_bias);
  EXPECT_NE(says(with_kernel).find("is learned from positions"), std::string::npos);
  EXPECT_NE(with_kernel.error().next.find("--bias none"), std::string::npos);
  EXPECT_NE(says(learn_bias(*model_, *batch_, with_bias)).find("positions alone"),
            std::string::npos);
  TrainOptions refit = without_bias();
  refit.from = *model_;
  EXPECT_NE(says(train(arm_.cell, *batch_, refit)).find("positions alone"), std::string::npos);
  const BatchText sent{"wires", batch_->rows().source_text, 0};
  EXPECT_NE(says(received_batch(sent, *arm_.cell, drawn(0, 1)))
                .find("the service works with positions alone"),
            std::string::npos);
  const CheckedBatch positions = checked(arm_, test::position_rows(arm_, 30, 23), 23);
  EXPECT_NE(says(train(arm_.cell, joined({*batch_, positions}), without_bias()))
                .find("set-ups of the instrument"),
            std::string::npos);
}

TEST_F(TrainedFromWires, WhoLeavesTheBiasToTheDataGetsNoneAndReadsWhy) {
  TrainOptions automatic;
  automatic.bias = "auto";
  const CompensatedModel model = demand(train(arm_.cell, *batch_, automatic));
  EXPECT_FALSE(model.bias());
  ASSERT_TRUE(model.parts().bias_choice);
  EXPECT_NE(model.parts().bias_choice->sentence.find("distances or touches"), std::string::npos);
}

TEST(TrainedFromPositions, IsHeldAgainstDistancesToKnownAnchors) {
  const GaugedArm arm = test::gauged_arm(24, test::three_corners());
  const CompensatedModel model =
      demand(train(arm.cell, checked(arm, test::position_rows(arm, 150, 24), 24), without_bias()));
  const auto wires = checked(arm, test::wire_rows(arm, 90, 25), 25).rows();
  const Evaluation evaluation = model.evaluate(demand(in_world_of(model, wires)).batch);
  ASSERT_TRUE(evaluation.gauges);
  EXPECT_EQ(evaluation.poses, 0);
  EXPECT_LT(evaluation.gauges->compensated, 1.5 * kSigma * 1e-3);
  EXPECT_GE(evaluation.gauges->coverage_95, 0.85);

  const GaugedArm unknown =
      test::gauged_arm(24, test::three_corners(), test::unknown_places(test::three_corners()));
  const CompensatedModel knows_none = demand(train(
      unknown.cell, checked(unknown, test::position_rows(unknown, 150, 24), 24), without_bias()));
  const auto refused_batch = in_world_of(knows_none, wires);
  ASSERT_FALSE(refused_batch);
  EXPECT_NE(refused_batch.error().message.find("does not know where anchor"), std::string::npos);
}

TEST(TrainedFromBoth, TellsTheFiguresOfEachKindByItself) {
  const GaugedArm arm = test::gauged_arm(26, test::three_corners());
  std::vector<test::GaugeRow> rows = test::position_rows(arm, 60, 26);
  for (test::GaugeRow& row : test::wire_rows(arm, 90, 27)) rows.push_back(std::move(row));
  const CompensatedModel model =
      demand(train(arm.cell, checked(arm, rows, 26, 0.2), without_bias()));
  const Evaluation& validation = model.parts().validation.value();
  ASSERT_TRUE(validation.gauges);
  EXPECT_EQ(validation.poses + validation.gauges->rows, 30);
  EXPECT_GT(validation.poses, 0);
  EXPECT_LT(validation.compensated.rms, 2.5 * std::sqrt(3.0) * kSigma * 1e-3);
  EXPECT_LT(validation.gauges->compensated, 2 * kSigma * 1e-3);
}

}  // namespace
}  // namespace trammel
