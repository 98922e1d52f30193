#include "server/store/backup.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <thread>

#include "server/compensate/model_file.h"
#include "tests/store/store_under_test.h"

namespace trammel {
namespace {

using test::demand;
namespace fs = std::filesystem;

/// Every row of every table, as SQLite prints it.
std::string content_of(const std::string& path) {
  SQLite::Database file(path, SQLite::OPEN_READONLY);
  std::vector<std::string> tables;
  SQLite::Statement names(file,
                          "SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name");
  while (names.executeStep()) tables.push_back(names.getColumn(0).getString());
  std::string content;
  for (const std::string& table : tables) {
    content += table + "\n";
    SQLite::Statement rows(file, "SELECT * FROM " + table);
    while (rows.executeStep()) {
      for (int i = 0; i < rows.getColumnCount(); ++i)
        content += rows.getColumn(i).getString() + "|";
      content += "\n";
    }
  }
  return content;
}

class BackupTest : public testing::Test, protected test::StoreUnderTest {
 protected:
  void SetUp() override { open(); }
  std::int64_t submit(const std::string& id) {
    return StoreUnderTest::submit(
        test::batch_of(id, "q1_deg\n" + id + "\n" + std::string(20000, '#'), "client:" + id));
  }
  void train(const std::string& id) {
    ASSERT_TRUE(store_->add_model("cell-7", test::nominal_model(cell_, ++trained_), submit(id),
                                  true, "judged"));
  }
  Result<StoreCopy> back_up() { return back_up_store(path_, copy_); }

  const std::string copy_ = folder_.file("copy.db");
  int trained_ = 0;
};

TEST_F(BackupTest, ACopyOfAStoreThatIsServedHoldsEveryRowOfIt) {
  train("lt-07");
  train("lt-08");
  const auto copy = back_up();
  ASSERT_TRUE(copy) << copy.error().message;
  EXPECT_EQ(copy->models, 2);
  EXPECT_EQ(copy->batches, 2);
  EXPECT_EQ(copy->audit_rows, demand(store_->audit()).verified);
  EXPECT_EQ(copy->audit_hash, demand(store_->audit()).rows.back().hash);
  EXPECT_EQ(content_of(copy_), content_of(path_));
}

TEST_F(BackupTest, ACopyOfAStoreInWhichABatchWasReleasedIsWhole) {
  train("lt-07");
  ASSERT_TRUE(store_->add_job(test::job_of("lt-07"), true));
  const auto copy = back_up();
  EXPECT_TRUE(copy) << copy.error().message;
}

TEST_F(BackupTest, AReleaseInAStoreOfBeforeIsKeptAndItsCopyIsWhole) {
  const std::int64_t job = submit("lt-07");
  store_.reset();
  {
    SQLite::Database file(path_, SQLite::OPEN_READWRITE);
    file.exec("DROP TABLE job_releases");
    file.exec(
        "CREATE TABLE job_releases (job INTEGER NOT NULL REFERENCES jobs (id), cell TEXT NOT NULL, "
        "batch TEXT NOT NULL, PRIMARY KEY (job, batch), FOREIGN KEY (cell, batch) REFERENCES "
        "batches (cell, id)) WITHOUT ROWID");
    file.exec("INSERT INTO job_releases VALUES (" + std::to_string(job) + ", 'cell-7', 'lt-07')");
  }
  open();
  EXPECT_TRUE(demand(store_->may_release(job)));
  const auto copy = back_up();
  EXPECT_TRUE(copy) << copy.error().message;
}

TEST_F(BackupTest, AStoreThatIsPutBackServesWhatItServedBitForBit) {
  train("lt-07");
  train("lt-08");
  const std::string before = serialize(demand(store_->model("cell-7", 2)));
  const std::string batch = demand(store_->batch("cell-7", "lt-07")).csv;
  ASSERT_TRUE(back_up());
  store_.reset();
  fs::remove_all(path_ + ".models");
  for (const char* more : {"", "-wal", "-shm"}) fs::remove(path_ + more);
  fs::rename(copy_, path_);
  open();
  EXPECT_FALSE(store_->state().why_not_written);
  EXPECT_EQ(demand(store_->version_in_force("cell-7")), 2);
  EXPECT_EQ(serialize(demand(store_->model("cell-7", 2))), before);
  EXPECT_EQ(demand(store_->batch("cell-7", "lt-07")).csv, batch);
  EXPECT_FALSE(demand(store_->audit()).broken);
  train("lt-09");
  EXPECT_EQ(demand(store_->version_in_force("cell-7")), 3) << "and it goes on";
}

TEST_F(BackupTest, WhatIsWrittenMeanwhileIsWrittenAndTheCopyIsOfOneMoment) {
  for (int i = 0; i < 60; ++i) submit(fmt::format("b{}", i));
  std::atomic<int> written = 0;
  std::jthread writer;
  const auto copy = back_up_store(path_, copy_, [&](double share) {
    if (!writer.joinable() && share > 0.1) {
      writer = std::jthread([&] {
        for (int i = 0; i < 20; ++i) {
          submit(fmt::format("more{}", i));
          ++written;
        }
      });
    }
    if (share > 0.5) {
      while (written < 20) std::this_thread::yield();
    }
  });
  ASSERT_TRUE(copy) << copy.error().message;
  EXPECT_EQ(written, 20) << "the writer waited for nothing";
  EXPECT_EQ(copy->batches, 60);
  EXPECT_EQ(demand(store_->batches("cell-7")).size(), 80u);
  EXPECT_FALSE(store_->state().why_not_written);
  submit("last");
  store_.reset();
  EXPECT_EQ(SQLite::Database(path_, SQLite::OPEN_READONLY)
                .execAndGet("PRAGMA integrity_check")
                .getString(),
            "ok");
}

TEST_F(BackupTest, AFileThatIsThereIsNotWrittenOver) {
  submit("b1");
  std::ofstream(copy_) << "mine";
  const auto copy = back_up();
  ASSERT_FALSE(copy);
  EXPECT_EQ(copy.error().code, ErrorCode::kRefused);
  EXPECT_EQ(test::read_file(copy_), "mine");
  EXPECT_FALSE(back_up_store(path_, path_)) << "nor the store itself";
}

TEST_F(BackupTest, WhatIsNoStoreOrIsDamagedIsRefusedAndLeavesNoFile) {
  const std::string text = folder_.write("notes.txt", std::string(5000, 'x'));
  EXPECT_FALSE(back_up_store(text, copy_));
  EXPECT_FALSE(back_up_store(folder_.file("nothing.db"), copy_));
  EXPECT_FALSE(fs::exists(folder_.file("nothing.db")));
  EXPECT_FALSE(fs::exists(copy_));
  for (const auto& entry : fs::directory_iterator(folder_.path()))
    EXPECT_EQ(entry.path().string().find(".part"), std::string::npos) << entry.path();
}

TEST_F(BackupTest, ACopyThatWasChangedAfterwardsIsNotWhole) {
  train("lt-07");
  ASSERT_TRUE(back_up());
  ASSERT_TRUE(check_store_copy(copy_));
  SQLite::Database(copy_, SQLite::OPEN_READWRITE)
      .exec("UPDATE audit SET who = 'nobody' WHERE number = 2");
  const auto changed = check_store_copy(copy_);
  ASSERT_FALSE(changed);
  EXPECT_EQ(changed.error().row, 2);
  std::string bytes = test::read_file(copy_);
  std::ofstream(copy_, std::ios::binary) << bytes.substr(0, bytes.size() / 2);
  EXPECT_FALSE(check_store_copy(copy_)) << "half of it is missing";
  std::ofstream(copy_, std::ios::binary) << bytes.substr(0, bytes.size() - 1);
  EXPECT_FALSE(check_store_copy(copy_)) << "its last byte is missing";
}

TEST_F(BackupTest, ABatchOrAModelOfWhichADigitWasChangedIsNamed) {
  train("lt-07");
  ASSERT_TRUE(back_up());
  const std::string good = test::read_file(copy_);
  const auto changed = [&](const std::string& sql) {
    std::ofstream(copy_, std::ios::binary) << good;
    SQLite::Database(copy_, SQLite::OPEN_READWRITE).exec(sql);
    const auto copy = check_store_copy(copy_);
    return copy ? std::string() : copy.error().message;
  };
  EXPECT_EQ(changed("UPDATE batches SET poses = poses"), "");
  EXPECT_NE(changed("UPDATE batches SET csv = replace(csv, 'lt-07', 'lt-08')").find("batch lt-07"),
            std::string::npos);
  EXPECT_NE(
      changed("UPDATE models SET content = replace(content, '\"values\":[1', '\"values\":[2')")
          .find("version 1"),
      std::string::npos);
}

}  // namespace
}  // namespace trammel
