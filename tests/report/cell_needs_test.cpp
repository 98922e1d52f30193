#include "server/report/cell_needs.h"

#include <gtest/gtest.h>

#include "server/measurement/checked_batch.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/page_text.h"
#include "tests/support/small_cell.h"

namespace trammel {
namespace {

using Urgency = CellNeed::Urgency;
constexpr std::int64_t kMeasured = 1'763'942'400;  // 2025-11-24
constexpr std::int64_t kDay = 86400;

class CellNeedsTest : public testing::Test {
 protected:
  static CompensatedModel measured_model() {
    const auto cell = test::small_cell("cell-7");
    const auto batch = test::demand(parse_batch_csv(test::small_batch_csv(*cell, {}), "b.csv"));
    TrainOptions options;
    options.bias = "none";
    options.trained_at = kMeasured;
    CompensatedModel::Parts parts =
        test::demand(
            train(cell, test::demand(check_against_cell(batch, *cell, drawn(0.3, 1))), options))
            .parts();
    parts.provenance.measured_at = kMeasured;
    return test::demand(CompensatedModel::make(std::move(parts)));
  }
  [[nodiscard]] NeedFacts facts(const std::string& check = "", int days = 1) const {
    return {
        .cell = "cell-7", .model = &model_, .last_check = check, .now = kMeasured + days * kDay};
  }
  [[nodiscard]] std::string check(const std::string& verdict, const std::string& due = "") const {
    return nlohmann::ordered_json{
        {"model", model_.provenance().id},
        {"verdict", verdict},
        {"why", "joint 3 moved"},
        {"due", due},
        {"budget", {{"lines", {{{"action", "re-master joint 3"}}, {{"action", ""}}}}}}}
        .dump();
  }
  CompensatedModel model_ = measured_model();
};

TEST_F(CellNeedsTest, NothingBeforeItsCheckAndACheckAfterThatDay) {
  const CellNeed before = need_of(facts());
  EXPECT_EQ(before.urgency, Urgency::kFine) << before.sentence;
  EXPECT_EQ(before.sentence, "Nothing to do before its check by 2025-12-24.");
  EXPECT_EQ(before.action, "");
  const CellNeed after = need_of(facts("", 40));
  EXPECT_EQ(after.urgency, Urgency::kSoon);
  EXPECT_EQ(after.sentence, "Its check was due by 2025-12-24.");
  EXPECT_TRUE(test::has(after.action, "trammel plan --check 12")) << after.action;
}

TEST_F(CellNeedsTest, ItsLastCheckDecides) {
  const CellNeed healthy = need_of(facts(check("healthy", "2026-02-01"), 40));
  EXPECT_EQ(healthy.urgency, Urgency::kFine) << healthy.sentence;
  EXPECT_EQ(healthy.sentence, "Checked and healthy, next check by 2026-02-01.");
  const CellNeed changed = need_of(facts(check("changed")));
  EXPECT_EQ(changed.urgency, Urgency::kNow);
  EXPECT_EQ(changed.sentence, "The robot has changed: joint 3 moved.");
  EXPECT_TRUE(test::has(changed.action, "re-master joint 3; measure it anew")) << changed.action;
  const CellNeed unclear = need_of(facts(check("cannot_tell")));
  EXPECT_EQ(unclear.urgency, Urgency::kSoon);
  EXPECT_TRUE(test::has(unclear.action, "trammel plan --check 24")) << unclear.action;
}

TEST_F(CellNeedsTest, ACheckOfAnotherModelSaysNothing) {
  NeedFacts other = facts(R"({"model": "another", "verdict": "changed", "why": "x"})");
  EXPECT_EQ(need_of(other).urgency, Urgency::kFine);
  for (const char* broken : {"[]", "{\"verdict\": 3}", "no json"}) {
    other.last_check = broken;
    EXPECT_EQ(need_of(other).urgency, Urgency::kFine) << broken;
  }
}

TEST_F(CellNeedsTest, ADarkCellComesFirstAndOneInTrainingIsWaitedFor) {
  NeedFacts dark{.cell = "cell-8", .dark_because = "there is no model: submit a batch"};
  EXPECT_EQ(need_of(dark).urgency, Urgency::kNow);
  EXPECT_EQ(need_of(dark).sentence,
            "Nobody gets an answer for it: there is no model: submit a batch.");
  EXPECT_TRUE(test::has(need_of(dark).action, "trammel submit cell-8")) << need_of(dark).action;
  dark.in_training = true;
  EXPECT_EQ(need_of(dark).urgency, Urgency::kSoon);
}

TEST_F(CellNeedsTest, BatchesThatAreKeptOutAreLookedAtWhereNothingElseIs) {
  NeedFacts kept = facts();
  kept.kept_out = 2;
  EXPECT_EQ(need_of(kept).sentence, "2 batches are kept out of training.");
  kept.last_check = check("changed");
  EXPECT_EQ(need_of(kept).urgency, Urgency::kNow);
}

}  // namespace
}  // namespace trammel
