// How often a batch is parsed, checked and split on its way. The linker leads these calls here
// first (`--wrap` in tests/CMakeLists.txt), so that the library that runs is the one that ships.
#include <gtest/gtest.h>

#include <atomic>
#include <map>
#include <mutex>

#include "server/measurement/checked_batch.h"
#include "server/measurement/split.h"
#include "tests/support/demand.h"
#include "tests/support/learning_cell.h"
#include "tests/support/small_cell.h"

namespace trammel {
namespace {

struct Calls {
  int parsed = 0, checked = 0, split = 0;
  friend bool operator==(const Calls&, const Calls&) = default;
  friend void PrintTo(const Calls& calls, std::ostream* out) {
    *out << "parsed " << calls.parsed << ", checked " << calls.checked << ", split " << calls.split;
  }
};

std::mutex mutex;
std::map<std::string, Calls> calls;  // guarded by mutex; by batch id

void count(const std::string& batch, int Calls::*what) {
  const std::lock_guard lock(mutex);
  ++(calls[batch].*what);
}

/// Since the last look.
std::map<std::string, Calls> seen() {
  const std::lock_guard lock(mutex);
  return std::exchange(calls, {});
}

}  // namespace

Result<MeasurementBatch> real_parse(const std::string& text, const std::string& where) asm(
    "__real__ZN7trammel15parse_batch_csvERKNSt7__cxx1112basic_stringIcSt11char_"
    "traitsIcESaIcEEES7_");
Result<MeasurementBatch> wrap_parse(const std::string& text, const std::string& where) asm(
    "__wrap__ZN7trammel15parse_batch_csvERKNSt7__cxx1112basic_stringIcSt11char_"
    "traitsIcESaIcEEES7_");
Result<MeasurementBatch> wrap_parse(const std::string& text, const std::string& where) {
  count(where.starts_with("batch ") ? where.substr(6) : where, &Calls::parsed);
  return real_parse(text, where);
}

Result<CheckedBatch>
real_check(MeasurementBatch batch, const Cell& cell, const HoldOut& hold_out) asm(
    "__real__ZN7trammel18check_against_cellENS_16MeasurementBatchERKNS_"
    "4CellERKSt8functionIFSt6vectorIbSaIbEERKS0_EE");
Result<CheckedBatch>
wrap_check(MeasurementBatch batch, const Cell& cell, const HoldOut& hold_out) asm(
    "__wrap__ZN7trammel18check_against_cellENS_16MeasurementBatchERKNS_"
    "4CellERKSt8functionIFSt6vectorIbSaIbEERKS0_EE");
Result<CheckedBatch> wrap_check(MeasurementBatch batch, const Cell& cell, const HoldOut& hold_out) {
  count(batch.id, &Calls::checked);
  return real_check(std::move(batch), cell, hold_out);
}

BatchSplit real_split(const MeasurementBatch& batch, const std::vector<bool>& held_out) asm(
    "__real__ZN7trammel10split_rowsERKNS_16MeasurementBatchERKSt6vectorIbSaIbEE");
BatchSplit wrap_split(const MeasurementBatch& batch, const std::vector<bool>& held_out) asm(
    "__wrap__ZN7trammel10split_rowsERKNS_16MeasurementBatchERKSt6vectorIbSaIbEE");
BatchSplit wrap_split(const MeasurementBatch& batch, const std::vector<bool>& held_out) {
  count(batch.id, &Calls::split);
  return real_split(batch, held_out);
}

namespace {

constexpr Calls kOnce{1, 1, 1};
constexpr Calls kOnceEach{
    2, 2, 2};  // when it is accepted, and when its turn comes: meanwhile the store alone has it

class OneWay : public testing::Test {
 protected:
  OneWay() : cell_(test::small_cell("cell-7")), learning_(cell_) {}
  JobProgress submit(const test::SmallBatch& batch, const std::string& name) {
    MeasurementBatch measured =
        test::demand(parse_batch_csv(test::small_batch_csv(*cell_, batch), name));
    static_cast<void>(seen());
    return learning_.submit(std::move(measured));
  }
  static Calls of(const std::map<std::string, Calls>& all, const std::string& batch) {
    return all.contains(batch) ? all.at(batch) : Calls{};
  }

  std::shared_ptr<const Cell> cell_;
  test::LearningCell learning_;
};

TEST_F(OneWay, ABatchIsParsedCheckedAndSplitOnceAsItIsAcceptedAndOnceOnItsWayToTheModelInForce) {
  const JobProgress first = submit({.poses = 120}, "a");
  ASSERT_TRUE(first.in_force) << first.what;
  EXPECT_EQ(of(seen(), "day-1"), kOnceEach);
}

TEST_F(OneWay, ABatchThatMeetsAModelInForceIsTooAndEachBatchThatJudgesIsOnce) {
  submit({.poses = 120}, "a");
  const JobProgress second = submit({.poses = 120, .noise = 10e-6, .seed = 2}, "b");
  ASSERT_EQ(second.stage, JobStage::kDone) << second.what;
  ASSERT_EQ(second.model_version, 2);
  const auto all = seen();
  EXPECT_EQ(of(all, "day-2"), kOnceEach);
  EXPECT_EQ(of(all, "day-1"), kOnce) << "it judges";
}

TEST_F(OneWay, BatchesThatAreTrainedAgainTogetherAreEachReadOnce) {
  submit({.poses = 120}, "a");
  submit({.poses = 120, .noise = 10e-6, .seed = 2}, "b");
  static_cast<void>(seen());
  const JobProgress again = learning_.finished(
      test::demand(learning_.trainer().retrain("cell-7", {"day-1", "day-2"}, "", "")));
  ASSERT_EQ(again.stage, JobStage::kDone) << again.what;
  const auto all = seen();
  EXPECT_EQ(of(all, "day-1"), kOnce);
  EXPECT_EQ(of(all, "day-2"), kOnce);
}

TEST_F(OneWay, ADiagnosisThatIsAppliedReadsItsBatchOnce) {
  submit({.poses = 120}, "a");
  static_cast<void>(seen());
  const JobProgress done =
      learning_.finished(test::demand(learning_.trainer().diagnose("cell-7", "day-1", "", true)));
  ASSERT_EQ(done.stage, JobStage::kDone) << done.what;
  EXPECT_EQ(of(seen(), "day-1"), kOnce);
}

TEST_F(OneWay, ABatchThatIsSentToBeDiagnosedIsReadAsItIsAcceptedAndOnItsTurn) {
  const std::string csv = test::small_batch_csv(*cell_, {.poses = 60});
  static_cast<void>(seen());
  const JobProgress done =
      learning_.finished(test::demand(learning_.trainer().diagnose("cell-7", "", csv, false)));
  ASSERT_EQ(done.stage, JobStage::kDone) << done.what;
  const auto all = seen();
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all.begin()->second, kOnceEach);
}

}  // namespace
}  // namespace trammel
