#include "server/store/store.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <thread>

#include "server/base/hash.h"
#include "server/compensate/model_file.h"
#include "tests/store/store_under_test.h"
#include "tests/support/postgres.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::demand;
using test::Refusal;
using test::refusal_of;

/// A store, and what the tests do with it.
class StoreOfBatches : protected test::StoreUnderTest {
 protected:
  explicit StoreOfBatches(const std::string& place) : StoreUnderTest(place) {}
  static StoredBatch batch(const std::string& id, const std::string& csv = "q1_deg\n1\n",
                           const std::string& request = "client:1") {
    StoredBatch batch = test::batch_of(id, csv, request);
    batch.poses = 12;
    return batch;
  }
  static StoredJob job() {
    StoredJob job;
    job.cell = "cell-7";
    job.created_at = 1700000001;
    return job;
  }
};

/// On each kind of database.
class StoreTest : public testing::TestWithParam<std::string>, protected StoreOfBatches {
 protected:
  StoreTest()
      : StoreOfBatches(GetParam() == "file" ? "" : test::Postgres::of_program().new_store()) {}
  static void SetUpTestSuite() { test::Postgres::of_program(); }
  void SetUp() override { open(); }
};
INSTANTIATE_TEST_SUITE_P(, StoreTest, testing::Values("file", "postgresql"),
                         [](const auto& kind) { return kind.param; });

/// Tests of files alone.
class StoreFileTest : public testing::Test, protected StoreOfBatches {
 protected:
  StoreFileTest() : StoreOfBatches("") {}
  void SetUp() override { open(); }
};

TEST_P(StoreTest, KeepsAnAcceptedBatchAndItsJobAcrossARestart) {
  const auto accepted = store_->add_batch(batch("lt-07"), job());
  ASSERT_TRUE(accepted) << accepted.error().message;
  EXPECT_EQ(accepted->batch_ids, std::vector<std::string>{"lt-07"});
  EXPECT_EQ(accepted->state, JobState::kQueued);
  restart();
  const auto kept = store_->batch("cell-7", "lt-07");
  ASSERT_TRUE(kept) << kept.error().message;
  EXPECT_EQ(kept->csv, batch("lt-07").csv);
  EXPECT_EQ(kept->request_id, "client:1");
  EXPECT_EQ(kept->accepted_at, 1700000000);
  EXPECT_EQ(kept->poses, 12);
  const auto unfinished = store_->unfinished_jobs();
  ASSERT_EQ(unfinished->size(), 1u);
  EXPECT_EQ(unfinished->front().id, accepted->id);
  EXPECT_EQ(unfinished->front().created_at, 1700000001);
}

TEST_P(StoreTest, KeepsEveryByteOfABatch) {
  const std::string bytes("# \xC3\xA4 \xFF\0 end\r\n", 13);
  ASSERT_TRUE(store_->add_batch(batch("odd", bytes), job()));
  restart();
  EXPECT_EQ(store_->batch("cell-7", "odd")->csv, bytes);
}

TEST_P(StoreTest, TheSameRequestAgainReturnsTheJobItMadeThen) {
  const auto first = store_->add_batch(batch("lt-07"), job());
  ASSERT_TRUE(store_->add_batch(batch("lt-08", "x", "client:2"), job()));
  const auto again = store_->add_batch(batch("lt-07"), job());
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->id, first->id);
  EXPECT_EQ(store_->batches("cell-7")->size(), 2u);
  EXPECT_EQ(store_->unfinished_jobs()->size(), 2u);
}

TEST_P(StoreTest, TheSameContentAgainFromAClientThatLostItsReceiptIsTheSameJob) {
  const auto first = store_->add_batch(batch("lt-07"), job());
  const auto again = store_->add_batch(batch("lt-07", batch("lt-07").csv, "client:2"), job());
  ASSERT_TRUE(first && again);
  EXPECT_EQ(again->id, first->id);
  EXPECT_EQ(store_->unfinished_jobs()->size(), 1u);
}

TEST_P(StoreTest, RefusesAnIdThatTheCellHasWithOtherContent) {
  ASSERT_TRUE(store_->add_batch(batch("lt-07"), job()));
  const auto other_content = store_->add_batch(batch("lt-07", "other"), job());
  ASSERT_FALSE(other_content);
  EXPECT_EQ(other_content.error().code, ErrorCode::kConflict);
  EXPECT_EQ(store_->unfinished_jobs()->size(), 1u) << "a refused batch must leave no job behind";
  EXPECT_EQ(store_->batch("cell-7", "lt-07")->csv, batch("lt-07").csv);
}

TEST_P(StoreTest, IdsAreUniqueWithinACellOnly) {
  ASSERT_TRUE(store_->add_batch(batch("lt-07"), job()));
  StoredBatch elsewhere = batch("lt-07", "elsewhere");
  StoredJob its_job = job();
  elsewhere.cell = its_job.cell = "cell-8";
  EXPECT_TRUE(store_->add_batch(elsewhere, its_job));
}

TEST_P(StoreTest, ListsBatchesOldestFirstWithoutTheirText) {
  ASSERT_TRUE(store_->add_batch(batch("z", "1", "a"), job()));
  ASSERT_TRUE(store_->add_batch(batch("a", "2", "b"), job()));
  const auto batches = store_->batches("cell-7");
  ASSERT_EQ(batches->size(), 2u);
  EXPECT_EQ(batches->front().id, "z");
  EXPECT_EQ(batches->back().id, "a");
  EXPECT_TRUE(batches->back().csv.empty());
  EXPECT_EQ(batches->back().hash, sha256_hex("2"));
}

TEST_P(StoreTest, QueuesAJobOverSeveralBatchesInTheOrderAskedFor) {
  ASSERT_TRUE(store_->add_batch(batch("a", "1", "r1"), job()));
  ASSERT_TRUE(store_->add_batch(batch("b", "2", "r2"), job()));
  StoredJob both = job();
  both.batch_ids = {"b", "a"};
  both.asked = AskedTraining{"M2", "matern52"};
  const auto queued = store_->add_job(both);
  ASSERT_TRUE(queued) << queued.error().message;
  const auto read = store_->job(queued->id);
  EXPECT_EQ(read->batch_ids, both.batch_ids);
  EXPECT_EQ(std::get<AskedTraining>(read->asked).level, "M2");
  EXPECT_EQ(std::get<AskedTraining>(read->asked).bias, "matern52");
}

TEST_P(StoreTest, KeepsADiagnosisItsBatchAndItsFindingsAcrossARestart) {
  StoredJob asked = job();
  asked.asked = AskedDiagnosis{true};
  const auto queued = store_->add_diagnosis(asked, "q1_deg\n1\n");
  ASSERT_TRUE(queued) << queued.error().message;
  restart();
  EXPECT_TRUE(std::get<AskedDiagnosis>(store_->unfinished_jobs()->at(0).asked).apply);
  EXPECT_EQ(store_->diagnosis(queued->id)->csv, "q1_deg\n1\n");
  ASSERT_TRUE(store_->store_findings(queued->id, "{}", "<html>"));
  ASSERT_TRUE(store_->set_job_done(queued->id, "nothing found"));
  restart();
  EXPECT_EQ(store_->diagnosis(queued->id)->findings, "{}");
  EXPECT_EQ(store_->job(queued->id)->state, JobState::kDone);
  EXPECT_EQ(store_->job(queued->id)->message, "nothing found");
  EXPECT_EQ(store_->diagnosis(queued->id + 1).error().code, ErrorCode::kNotFound);
}

TEST_P(StoreTest, KeepsACheckOfTheRobotsHealthAcrossARestart) {
  StoredJob asked = job();
  for (const std::optional<double>& tolerance : {std::optional<double>(), std::optional(0.1e-3)}) {
    asked.asked = AskedCheck{tolerance};
    const auto queued = store_->add_diagnosis(asked, "q1_deg\n1\n");
    ASSERT_TRUE(queued) << queued.error().message;
    EXPECT_EQ(queued->kind(), JobKind::kCheck);
    restart();
    EXPECT_EQ(std::get<AskedCheck>(store_->unfinished_jobs()->back().asked).tolerance, tolerance)
        << "bit for bit";
    EXPECT_EQ(store_->audit()->rows.back().what, "check asked");
  }
  EXPECT_EQ(store_->audit()->rows.back().after, "of a batch sent with it, tolerance 0.1 mm");
}

TEST_P(StoreTest, KeepsThePagesOfTheLastDiagnosesOnlyButAllTheirFindings) {
  std::vector<std::int64_t> jobs;
  for (int i = 0; i < 22; ++i) {
    StoredJob asked = job();
    asked.asked = AskedDiagnosis{};
    jobs.push_back(store_->add_diagnosis(asked, "csv")->id);
    ASSERT_TRUE(store_->store_findings(jobs.back(), "{}", "<html>"));
  }
  EXPECT_EQ(store_->diagnosis(jobs[1])->page, "");
  EXPECT_EQ(store_->diagnosis(jobs[1])->findings, "{}");
  EXPECT_EQ(store_->diagnosis(jobs[2])->page, "<html>");
}

TEST_P(StoreTest, KeepsWhyABatchIsInQuarantineUntilItIsReleased) {
  ASSERT_TRUE(store_->add_batch(batch("lt-07"), job()));
  ASSERT_TRUE(store_->set_quarantine("cell-7", "lt-07", "another tool"));
  restart();
  EXPECT_EQ(store_->batch("cell-7", "lt-07")->quarantine, "another tool");
  EXPECT_EQ(store_->batches("cell-7")->at(0).quarantine, "another tool");
  ASSERT_TRUE(store_->set_quarantine("cell-7", "lt-07", ""));
  EXPECT_EQ(store_->batch("cell-7", "lt-07")->quarantine, "");
  EXPECT_EQ(store_->set_quarantine("cell-7", "lt-07", "").error().code, ErrorCode::kConflict)
      << "nothing to release";
  EXPECT_EQ(store_->set_quarantine("cell-7", "lt-08", "x").error().code, ErrorCode::kNotFound);
}

TEST_P(StoreTest, ABatchWhoseModelIsDoubtfulIsLearnedFromOnceAPersonPutsTheModelInForce) {
  const auto made_of = [&](const std::string& id, int poses, JobVerdict verdict, HeldBack reason) {
    JobOutcome outcome;
    outcome.verdict = verdict;
    outcome.held_back = reason;
    const std::int64_t made = submit(test::batch_of(id));
    return demand(store_->add_model("cell-7", test::nominal_model(cell_, poses), made, false,
                                    "waits", false, {}, outcome));
  };
  made_of("plain", 40, JobVerdict::kNotBetter, HeldBack::kNo);
  made_of("few", 41, JobVerdict::kUndecided, HeldBack::kFewJudges);
  const int doubted = made_of("doubted", 42, JobVerdict::kUndecided, HeldBack::kStopNote);
  made_of("worse", 43, JobVerdict::kNotBetter, HeldBack::kStopNote);
  made_of("far", 44, JobVerdict::kUndecided, HeldBack::kStepLimit);
  restart();
  using Ids = std::set<std::string>;
  EXPECT_EQ(demand(store_->batches_learned_from("cell-7")), (Ids{"few", "plain"}));
  EXPECT_FALSE(demand(store_->batch_record("cell-7", "doubted")).learned);
  EXPECT_EQ(demand(store_->recent_jobs("cell-7", 5))[2].outcome.held_back, HeldBack::kStopNote);
  ASSERT_TRUE(store_->activate("cell-7", doubted));
  EXPECT_EQ(demand(store_->batches_learned_from("cell-7")), (Ids{"doubted", "few", "plain"}));
  add_model(45, true);
  EXPECT_TRUE(demand(store_->batch_record("cell-7", "doubted")).learned) << "it was in force";
  EXPECT_EQ(demand(store_->batches_of_version("cell-7", doubted)), Ids{"doubted"});
}

TEST_P(StoreTest, ABatchSaysWhatTheTrainingThatCameWithItCameTo) {
  const auto added = store_->add_batch(batch("lt-07"), job());
  ASSERT_TRUE(added);
  EXPECT_EQ(store_->batch_record("cell-7", "lt-07")->outcome, "");
  ASSERT_TRUE(store_->set_job_failed(added->id, "it does not fit"));
  EXPECT_EQ(store_->batch_record("cell-7", "lt-07")->outcome, "it does not fit");
}

TEST_F(StoreFileTest, WhereNoNumberIsLeftAModelIsRefusedAndNoneGetsAnotherOnesNumber) {
  EXPECT_EQ(add_model(1), 1);
  store_.reset();
  SQLite::Database(path_, SQLite::OPEN_READWRITE).exec("UPDATE models SET version = 2147483647");
  open();
  const auto one_more =
      store_->add_model("cell-7", test::nominal_model(cell_, 2), 0, false, "made");
  ASSERT_FALSE(one_more);
  EXPECT_EQ(one_more.error().code, ErrorCode::kRefused);
}

TEST_F(StoreFileTest, TakesAFileOfTheFirstSchemaOn) {
  ASSERT_TRUE(store_->add_batch(batch("lt-07"), job()));
  store_.reset();
  {
    SQLite::Database file(path_, SQLite::OPEN_READWRITE);
    file.exec("DROP TABLE diagnoses");
    file.exec("ALTER TABLE jobs DROP COLUMN kind");
    file.exec("ALTER TABLE batches DROP COLUMN quarantine");
    file.exec("PRAGMA user_version = 1");
  }
  open();
  EXPECT_EQ(store_->batch("cell-7", "lt-07")->quarantine, "");
  EXPECT_EQ(store_->unfinished_jobs()->at(0).kind(), JobKind::kTrain);
  EXPECT_TRUE(store_->add_diagnosis(job(), "csv"));
}

TEST_F(StoreFileTest, TakesOnAFileOfBeforeTimesWereKeptAndKnowsWhenItsModelsWereTrained) {
  const auto id = store_->add_batch(batch("lt-07"), job())->id;
  CompensatedModel::Parts parts = test::nominal_model(cell_, 40).parts();
  parts.provenance.trained_at = 1'650'000'000;
  ASSERT_TRUE(store_->add_model("cell-7", CompensatedModel::make(parts).value(), id, true, "made"));
  ASSERT_EQ(add_model(41), 2);
  store_.reset();
  {
    SQLite::Database file(path_, SQLite::OPEN_READWRITE);
    file.exec("DROP TABLE job_times");
    file.exec("DROP TABLE model_times");
    file.exec("UPDATE models SET content = 'damaged' WHERE version = 2");
  }
  open();
  const auto models = store_->models("cell-7");
  ASSERT_TRUE(models) << models.error().message;
  EXPECT_EQ(models->at(0).trained_at, 1'650'000'000);
  EXPECT_FALSE(models->at(0).measured_at);
  EXPECT_EQ(models->at(1).trained_at, models->at(1).created_at);
  EXPECT_FALSE(store_->job(id)->finished_at);
  EXPECT_EQ(store_->job(id)->state, JobState::kDone);
  EXPECT_EQ(in_force(), 1);
}

TEST_P(StoreTest, KeepsWhenAModelWasTrainedAndTheNewestOfItsMeasurementsTaken) {
  CompensatedModel::Parts parts = test::nominal_model(cell_, 40).parts();
  parts.provenance.trained_at = 1'650'000'000;
  parts.provenance.measured_at = 1'600'000'000;
  ASSERT_TRUE(store_->add_model("cell-7", CompensatedModel::make(parts).value(), 0, true, ""));
  restart();
  EXPECT_EQ(store_->models("cell-7")->front().trained_at, 1'650'000'000);
  EXPECT_EQ(store_->models("cell-7")->front().measured_at, 1'600'000'000);
  EXPECT_GT(store_->models("cell-7")->front().created_at, 1'700'000'000);
}

TEST_P(StoreTest, KeepsWhenJobsBeganAndEndedAndListsThoseThatEndedLast) {
  const auto first = store_->add_batch(batch("a"), job())->id;
  EXPECT_FALSE(store_->job(first)->started_at);
  ASSERT_TRUE(store_->set_job_running(first));
  EXPECT_GT(store_->job(first)->started_at.value_or(0), 1'700'000'000);
  EXPECT_FALSE(store_->job(first)->finished_at);
  ASSERT_TRUE(store_->set_job_failed(first, "too few rows"));
  EXPECT_GE(store_->job(first)->finished_at.value_or(0), *store_->job(first)->started_at);
  const auto second = store_->add_batch(batch("b", "2", "client:2"), job())->id;
  ASSERT_TRUE(store_->set_job_running(second));
  ASSERT_EQ(add_model(40, true, second), 1);
  EXPECT_TRUE(store_->job(second)->finished_at);
  const auto third = store_->add_batch(batch("c", "3", "client:3"), job())->id;
  ASSERT_TRUE(store_->set_job_done(third, "nothing"));
  const auto fourth = store_->add_batch(batch("d", "4", "client:4"), job())->id;
  const auto numbers = [&](const std::string& cell, int finished) {
    std::vector<std::int64_t> ids;
    const std::vector<StoredJob> jobs = store_->recent_jobs(cell, finished).value();
    for (const StoredJob& one : jobs) ids.push_back(one.id);
    return ids;
  };
  EXPECT_EQ(numbers("", 20), (std::vector{first, second, third, fourth}));
  EXPECT_EQ(numbers("cell-7", 1), (std::vector{first, third, fourth}))
      << "the last done, the last failed";
  EXPECT_TRUE(numbers("cell-8", 20).empty());
}

TEST_P(StoreTest, ReleasesBatchesWithTheModelThatGoesInForceOrNotAtAll) {
  ASSERT_TRUE(store_->add_batch(batch("a"), job()));
  ASSERT_TRUE(store_->set_quarantine("cell-7", "a", "another tool"));
  StoredJob wanted = job();
  wanted.batch_ids = {"a", "never-seen"};
  EXPECT_EQ(store_->add_job(wanted, true).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(store_->batch("cell-7", "a")->quarantine, "another tool");
  wanted.batch_ids = {"a"};
  const auto refused = store_->add_job(wanted, true), accepted = store_->add_job(wanted, true);
  ASSERT_TRUE(refused && accepted);
  EXPECT_TRUE(*store_->may_release(accepted->id));
  EXPECT_FALSE(*store_->may_release(1));
  ASSERT_TRUE(store_->add_model("cell-7", test::nominal_model(cell_, 11), refused->id, false, ""));
  EXPECT_EQ(store_->batch("cell-7", "a")->quarantine, "another tool");
  ASSERT_TRUE(store_->add_model("cell-7", test::nominal_model(cell_, 12), accepted->id, true, ""));
  EXPECT_EQ(store_->batch("cell-7", "a")->quarantine, "");
}

TEST_P(StoreTest, RefusesAJobOverAnUnknownBatch) {
  StoredJob lost = job();
  lost.batch_ids = {"never-seen"};
  const auto refused_job = store_->add_job(lost);
  ASSERT_FALSE(refused_job);
  EXPECT_EQ(refused_job.error().code, ErrorCode::kNotFound);
  EXPECT_TRUE(store_->unfinished_jobs()->empty());
}

TEST_P(StoreTest, CountsAttemptsThatWereNotPutBack) {
  const auto id = store_->add_batch(batch("a"), job())->id;
  ASSERT_TRUE(store_->set_job_running(id));
  ASSERT_TRUE(store_->set_job_running(id));
  EXPECT_EQ(store_->job(id)->attempts, 2);
  ASSERT_TRUE(store_->set_job_queued(id));
  EXPECT_EQ(store_->job(id)->attempts, 1);
  EXPECT_EQ(store_->job(id)->state, JobState::kQueued);
}

TEST_P(StoreTest, AFinishedJobStaysFinished) {
  const auto id = store_->add_batch(batch("a"), job())->id;
  ASSERT_TRUE(store_->set_job_failed(id, "too few rows"));
  EXPECT_EQ(store_->job(id)->message, "too few rows");
  EXPECT_TRUE(store_->unfinished_jobs()->empty());
  EXPECT_EQ(store_->set_job_running(id).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(store_->set_job_queued(id).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(store_->set_job_failed(id, "again").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(store_->set_job_running(id + 1).error().code, ErrorCode::kNotFound);
}

TEST_P(StoreTest, StoresModelsAsVersionsOfTheirCell) {
  const auto id = store_->add_batch(batch("a"), job())->id;
  EXPECT_EQ(add_model(10), 1);
  EXPECT_EQ(add_model(20, true, id), 2);
  restart();
  const auto models = store_->models("cell-7");
  ASSERT_EQ(models->size(), 2u);
  EXPECT_FALSE(models->front().in_force);
  EXPECT_TRUE(models->back().in_force);
  EXPECT_EQ(models->back().training_poses, 20);
  EXPECT_EQ(models->back().hash, test::nominal_model(cell_, 20).provenance().hash);
  EXPECT_EQ(in_force(), 2);
  const auto done = store_->job(id);
  EXPECT_EQ(done->state, JobState::kDone);
  EXPECT_EQ(done->model_version, 2);
  EXPECT_EQ(done->message, "made");
  const auto model = store_->model("cell-7", 2);
  ASSERT_TRUE(model) << model.error().message;
  EXPECT_EQ(serialize(*model), serialize(test::nominal_model(cell_, 20)));
}

TEST_P(StoreTest, AModelOfAFinishedJobIsNotStored) {
  const auto id = store_->add_batch(batch("a"), job())->id;
  ASSERT_TRUE(store_->set_job_failed(id, "interrupted"));
  const auto stored = store_->add_model("cell-7", test::nominal_model(cell_, 1), id, true, "made");
  ASSERT_FALSE(stored);
  EXPECT_TRUE(store_->models("cell-7")->empty()) << "one transaction: all of it or nothing";
  EXPECT_EQ(in_force(), 0);
}

TEST_P(StoreTest, RollsBackFurtherEachTimeAndNeverForth) {
  for (int version = 1; version <= 3; ++version) add_model(version, true);
  EXPECT_EQ(store_->previous_in_force("cell-7").value(), (std::vector{2, 1}));
  EXPECT_EQ(store_->rollback("cell-7").value(), 2);
  restart();
  EXPECT_EQ(in_force(), 2);
  EXPECT_EQ(store_->rollback("cell-7").value(), 1);
  EXPECT_EQ(in_force(), 1);
  const auto no_further = store_->rollback("cell-7");
  ASSERT_FALSE(no_further);
  EXPECT_EQ(no_further.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(in_force(), 1);
}

TEST_P(StoreTest, SaysOfEveryCellAtOnceWhatIsInForce) {
  EXPECT_TRUE(store_->versions_in_force()->empty());
  for (int version = 1; version <= 3; ++version) add_model(version, true);
  ASSERT_TRUE(store_->add_model("cell-8", test::nominal_model(test::small_cell("cell-8"), 1), 0,
                                true, "made"));
  ASSERT_TRUE(store_->add_model("cell-9", test::nominal_model(test::small_cell("cell-9"), 1), 0,
                                false, "made"));
  ASSERT_EQ(store_->rollback("cell-7").value(), 2);
  EXPECT_EQ(store_->versions_in_force().value(),
            (std::map<std::string, int>{{"cell-7", 2}, {"cell-8", 1}}));
}

TEST_P(StoreTest, RollsBackSeveralStepsAtOnceAndNoFurtherThanThereAre) {
  for (int version = 1; version <= 3; ++version) add_model(version, true);
  EXPECT_EQ(store_->rollback("cell-7", 3).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(in_force(), 3);
  EXPECT_EQ(store_->rollback("cell-7", 2).value(), 1);
  EXPECT_EQ(in_force(), 1);
  EXPECT_EQ(store_->rollback("cell-7").error().code, ErrorCode::kNotFound);
}

TEST_P(StoreTest, AnActivationAfterARollbackRemembersWhatItReplaced) {
  for (int version = 1; version <= 3; ++version) add_model(version, true);
  ASSERT_EQ(store_->rollback("cell-7").value(), 2);
  ASSERT_TRUE(store_->activate("cell-7", 3));
  EXPECT_EQ(store_->rollback("cell-7").value(), 2);
  EXPECT_EQ(store_->rollback("cell-7").value(), 1);
}

TEST_P(StoreTest, ActivatingWhatIsInForceChangesNothing) {
  add_model(1, true);
  add_model(2, true);
  ASSERT_TRUE(store_->activate("cell-7", 2));
  EXPECT_EQ(store_->rollback("cell-7").value(), 1);
}

TEST_P(StoreTest, RefusesToActivateAnUnknownVersion) {
  add_model(1, true);
  EXPECT_EQ(store_->activate("cell-7", 2).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(store_->activate("cell-8", 1).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(in_force(), 1);
  EXPECT_EQ(store_->model("cell-7", 2).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(store_->rollback("cell-8").error().code, ErrorCode::kNotFound);
}

TEST_P(StoreTest, WorksForSeveralThreadsAtOnce) {
  {
    std::vector<std::jthread> threads;
    for (int t = 0; t < 4; ++t) {
      threads.emplace_back([this, t] {
        for (int i = 0; i < 10; ++i) {
          const std::string id = fmt::format("{}-{}", t, i);
          EXPECT_TRUE(store_->add_batch(batch(id, id, id), job()));
          EXPECT_TRUE(store_->batch("cell-7", id));
        }
      });
    }
  }
  EXPECT_EQ(store_->unfinished_jobs()->size(), 40u);
}

TEST_F(StoreFileTest, RefusesASecondWriterAndNamesTheFirst) {
  const auto second = Store::open(path_);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kConflict);
  EXPECT_EQ(refusal_of(second), Refusal(path_).of(ErrorCode::kConflict));
}

TEST_F(StoreFileTest, RefusesASecondWriterThatComesByALink) {
  const std::string link = folder_.file("link.db");
  std::filesystem::create_symlink(path_, link);
  const auto second = Store::open(link);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kConflict);
}

TEST_F(StoreFileTest, RefusesTheDatabaseOfAnotherProgramAndLeavesItAlone) {
  const std::string other = folder_.file("other.db");
  {
    SQLite::Database(other, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE)
        .exec("CREATE TABLE t (a)");
  }
  const std::string before = test::read_file(other);
  const auto opened = Store::open(other);
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, ErrorCode::kRefused);
  EXPECT_EQ(test::read_file(other), before);
}

TEST_F(StoreFileTest, RefusesANewerSchema) {
  store_.reset();
  { SQLite::Database(path_, SQLite::OPEN_READWRITE).exec("PRAGMA user_version = 3"); }
  const auto opened = Store::open(path_);
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, ErrorCode::kRefused);
  EXPECT_EQ(refusal_of(opened), Refusal(path_, {}, "schema").beyond(3, 2));
}

TEST_F(StoreFileTest, AFileThatIsNoDatabaseIsAnErrorThatNamesIt) {
  const std::string text = folder_.write("notes.db", std::string(5000, 'x'));
  const auto opened = Store::open(text);
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, ErrorCode::kInternal);
  EXPECT_EQ(refusal_of(opened), Refusal(text).of(ErrorCode::kInternal));
}

TEST_F(StoreFileTest, AFolderThatDoesNotExistIsAnError) {
  const auto opened = Store::open(folder_.file("nowhere/trammel.db"));
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, ErrorCode::kInternal);
}

TEST_F(StoreFileTest, ADamagedFileIsAnErrorThatNamesIt) {
  for (int i = 0; i < 20; ++i) {
    const std::string id = std::to_string(i);
    ASSERT_TRUE(store_->add_batch(batch(id, std::string(3000, 'x'), id), job()));
  }
  store_.reset();
  const auto size = static_cast<std::streamoff>(std::filesystem::file_size(path_));
  {
    std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
    for (std::streamoff page = 4096; page < size; page += 4096) {
      file.seekp(page);
      file << std::string(512, '\x5A');
    }
  }
  open();
  const auto batches = store_->batches("cell-7");
  ASSERT_FALSE(batches);
  EXPECT_EQ(batches.error().code, ErrorCode::kInternal);
  EXPECT_EQ(refusal_of(batches), Refusal(path_).of(ErrorCode::kInternal));
}

TEST_F(StoreFileTest, ABatchThatIsNotWhatWasAcceptedIsNotHandedOut) {
  ASSERT_TRUE(store_->add_batch(batch("a"), job()));
  store_.reset();
  {
    SQLite::Database(path_, SQLite::OPEN_READWRITE)
        .exec("UPDATE batches SET csv = 'q1_deg' || char(10) || '2'");
  }
  open();
  const auto changed = store_->batch("cell-7", "a");
  ASSERT_FALSE(changed);
  EXPECT_EQ(changed.error().code, ErrorCode::kInternal);
}

TEST_F(StoreFileTest, AModelWhoseContentWasChangedIsNotHandedOut) {
  add_model(10);
  store_.reset();
  {
    SQLite::Database(path_, SQLite::OPEN_READWRITE)
        .exec("UPDATE models SET content = replace(content, '10', '11')");
  }
  open();
  EXPECT_FALSE(store_->model("cell-7", 1));
}

TEST_F(StoreFileTest, LetsAnotherProcessReadWhileItIsOpen) {
  ASSERT_TRUE(store_->add_batch(batch("a"), job()));
  EXPECT_TRUE(std::filesystem::exists(path_ + "-wal"));
  SQLite::Database reader(path_, SQLite::OPEN_READONLY);
  EXPECT_EQ(reader.execAndGet("PRAGMA journal_mode").getString(), "wal");
  EXPECT_EQ(reader.execAndGet("SELECT COUNT(*) FROM batches").getInt(), 1)
      << "another process may read";
}

/// Adds batches and models, saying each on `pipe` once it is acknowledged, until it is killed.
[[noreturn]] void write_until_killed(const std::string& path, const StoredBatch& first,
                                     const CompensatedModel& model, int pipe) {
  auto store = Store::open(path);
  if (!store) ::_exit(1);
  for (int i = 0;; ++i) {
    StoredBatch batch = first;
    batch.id = batch.request_id = std::to_string(i);
    StoredJob job;
    job.cell = batch.cell;
    const auto accepted = (*store)->add_batch(batch, job);
    if (!accepted || !(*store)->add_model(batch.cell, model, accepted->id, true, "made"))
      ::_exit(1);
    if (::write(pipe, &i, sizeof i) != sizeof i) ::_exit(1);
  }
}

TEST_F(StoreFileTest, KeepsAllThatWasAcknowledgedBeforeAKill) {
  store_.reset();
  const CompensatedModel model = test::nominal_model(cell_, 1);
  const StoredBatch first = batch("0", std::string(20000, 'x'));
  for (int round = 1; round <= 8; ++round) {
    std::filesystem::remove(path_);
    std::filesystem::remove(path_ + "-wal");
    std::filesystem::remove_all(path_ + ".models");  // else it is no new beginning
    int pipe[2];
    ASSERT_EQ(::pipe(pipe), 0);
    const pid_t writer = ::fork();
    ASSERT_GE(writer, 0);
    if (writer == 0) write_until_killed(path_, first, model, pipe[1]);
    ::close(pipe[1]);
    int acknowledged = -1;
    while (acknowledged < 5 * round &&
           ::read(pipe[0], &acknowledged, sizeof acknowledged) == sizeof acknowledged) {
    }
    ::kill(writer, SIGKILL);
    while (::read(pipe[0], &acknowledged, sizeof acknowledged) == sizeof acknowledged) {
    }
    ::close(pipe[0]);
    int status = 0;
    ASSERT_EQ(::waitpid(writer, &status, 0), writer);
    ASSERT_TRUE(WIFSIGNALED(status)) << "the writer ended by itself";

    open();
    const auto batches = store_->batches("cell-7");
    const auto models = store_->models("cell-7");
    EXPECT_GE(static_cast<int>(models->size()), acknowledged + 1);
    EXPECT_GE(batches->size(), models->size());
    EXPECT_LE(batches->size(), models->size() + 1);
    EXPECT_EQ(store_->unfinished_jobs()->size(), batches->size() - models->size());
    EXPECT_EQ(in_force(), static_cast<int>(models->size()))
        << "a model and its being in force are one transaction";
    EXPECT_EQ(store_->batch("cell-7", std::to_string(acknowledged))->csv, first.csv);
    store_.reset();
  }
}

}  // namespace
}  // namespace trammel
