// Stores as earlier programs left them, by their own statements: frozen here, whatever today's
// schema becomes.
#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include "server/base/hash.h"
#include "server/compensate/model_file.h"
#include "server/store/backup.h"
#include "server/store/served_models.h"
#include "server/store/store.h"
#include "tests/support/demand.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

using test::demand;

constexpr const char* kVersion1 = R"sql(
CREATE TABLE jobs (id INTEGER PRIMARY KEY AUTOINCREMENT, cell TEXT NOT NULL, level TEXT NOT NULL, bias TEXT NOT NULL,
  state TEXT NOT NULL CHECK (state IN ('queued', 'running', 'done', 'failed')), message TEXT NOT NULL,
  created_at INTEGER NOT NULL, model_version INTEGER NOT NULL DEFAULT 0, attempts INTEGER NOT NULL DEFAULT 0);
CREATE INDEX jobs_unfinished ON jobs (id) WHERE state IN ('queued', 'running');
CREATE TABLE batches (number INTEGER PRIMARY KEY AUTOINCREMENT, cell TEXT NOT NULL, id TEXT NOT NULL, csv TEXT NOT NULL,
  hash TEXT NOT NULL, request_id TEXT NOT NULL, accepted_at INTEGER NOT NULL, poses INTEGER NOT NULL,
  job INTEGER NOT NULL REFERENCES jobs (id), UNIQUE (cell, id));
CREATE TABLE job_batches (job INTEGER NOT NULL REFERENCES jobs (id), position INTEGER NOT NULL, cell TEXT NOT NULL,
  batch TEXT NOT NULL, PRIMARY KEY (job, position), FOREIGN KEY (cell, batch) REFERENCES batches (cell, id)) WITHOUT ROWID;
CREATE TABLE models (cell TEXT NOT NULL, version INTEGER NOT NULL, id TEXT NOT NULL, hash TEXT NOT NULL,
  level TEXT NOT NULL, batch_id TEXT NOT NULL, created_at INTEGER NOT NULL, training_poses INTEGER NOT NULL,
  validation_rms REAL NOT NULL, content TEXT NOT NULL, PRIMARY KEY (cell, version));
CREATE TABLE activations (number INTEGER PRIMARY KEY AUTOINCREMENT, cell TEXT NOT NULL, version INTEGER NOT NULL,
  back INTEGER REFERENCES activations (number), activated_at INTEGER NOT NULL,
  FOREIGN KEY (cell, version) REFERENCES models (cell, version));
CREATE INDEX activations_by_cell ON activations (cell, number);
PRAGMA application_id = 1414679884;
)sql";

constexpr const char* kVersion2 = R"sql(
ALTER TABLE jobs ADD COLUMN kind TEXT NOT NULL DEFAULT 'train' CHECK (kind IN ('train', 'diagnose'));
ALTER TABLE batches ADD COLUMN quarantine TEXT NOT NULL DEFAULT '';
CREATE TABLE diagnoses (job INTEGER PRIMARY KEY REFERENCES jobs (id), csv TEXT NOT NULL, apply INTEGER NOT NULL,
  findings TEXT NOT NULL DEFAULT '', page TEXT NOT NULL DEFAULT '');
)sql";

/// Beside version 2, before outcomes, changes and the audit trail were kept.
constexpr const char* kTimesOnly = R"sql(
CREATE TABLE job_times (job INTEGER PRIMARY KEY REFERENCES jobs (id), started_at INTEGER, finished_at INTEGER);
CREATE TABLE model_times (cell TEXT NOT NULL, version INTEGER NOT NULL, trained_at INTEGER NOT NULL, measured_at INTEGER,
  PRIMARY KEY (cell, version), FOREIGN KEY (cell, version) REFERENCES models (cell, version)) WITHOUT ROWID;
)sql";

/// Beside that, what servers told each other while each had a store of its own. The first one had
/// given number 4.
constexpr const char* kElsewhere = R"sql(
CREATE TABLE learned_elsewhere (cell TEXT NOT NULL, batch TEXT NOT NULL, PRIMARY KEY (cell, batch),
  FOREIGN KEY (cell, batch) REFERENCES batches (cell, id)) WITHOUT ROWID;
CREATE TABLE versions_elsewhere (cell TEXT PRIMARY KEY, newest INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE job_claims (job INTEGER PRIMARY KEY REFERENCES jobs (id), server TEXT NOT NULL, token TEXT NOT NULL,
  lease_until INTEGER NOT NULL, cancelled_by TEXT);
CREATE TABLE cells (cell TEXT PRIMARY KEY, last_version INTEGER NOT NULL) WITHOUT ROWID;
INSERT INTO replica VALUES (1, 4294967296, 1, '', 'writer');
INSERT INTO versions_elsewhere VALUES ('cell-7', 4);
INSERT INTO cells VALUES ('cell-7', 2);
)sql";

/// Beside that, before servers told each other what became of batches.
constexpr const char* kBeforeElsewhere = R"sql(
CREATE TABLE job_outcomes (job INTEGER PRIMARY KEY REFERENCES jobs (id), verdict TEXT NOT NULL, before_m REAL, after_m REAL,
  limit_m REAL, code TEXT NOT NULL, why TEXT NOT NULL, next_step TEXT NOT NULL, peak_bytes INTEGER, processor_s REAL);
CREATE TABLE job_releases (job INTEGER NOT NULL REFERENCES jobs (id), cell TEXT NOT NULL, batch TEXT NOT NULL,
  PRIMARY KEY (job, cell, batch), FOREIGN KEY (cell, batch) REFERENCES batches (cell, id)) WITHOUT ROWID;
CREATE TABLE health_checks (job INTEGER PRIMARY KEY REFERENCES jobs (id));
CREATE TABLE activation_figures (number INTEGER PRIMARY KEY REFERENCES activations (number), before_m REAL, after_m REAL,
  limit_m REAL, why TEXT NOT NULL);
CREATE TABLE changes (number INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE, asked TEXT NOT NULL,
  version INTEGER NOT NULL, job INTEGER NOT NULL, made_at INTEGER NOT NULL);
CREATE TABLE pruned (kind TEXT NOT NULL, cell TEXT NOT NULL, id TEXT NOT NULL, PRIMARY KEY (kind, cell, id)) WITHOUT ROWID;
CREATE TABLE discarded (cell TEXT NOT NULL, batch TEXT NOT NULL, PRIMARY KEY (cell, batch),
  FOREIGN KEY (cell, batch) REFERENCES batches (cell, id)) WITHOUT ROWID;
CREATE TABLE store_identity (id TEXT NOT NULL);
CREATE TABLE replica (one INTEGER PRIMARY KEY CHECK (one = 1), epoch INTEGER NOT NULL, writes INTEGER NOT NULL,
  follows TEXT NOT NULL, told TEXT NOT NULL);
CREATE TABLE audit (number INTEGER PRIMARY KEY, at INTEGER NOT NULL, who TEXT NOT NULL, cell TEXT NOT NULL,
  what TEXT NOT NULL, subject TEXT NOT NULL, before TEXT NOT NULL, after TEXT NOT NULL, why TEXT NOT NULL,
  request TEXT NOT NULL, hash_before TEXT NOT NULL, hash TEXT NOT NULL);
CREATE TABLE audit_end (rows INTEGER NOT NULL, hash TEXT NOT NULL);
INSERT INTO audit_end (rows, hash) VALUES (0, '');
)sql";

struct OldStore {
  const char* name;
  int schema;
  std::vector<const char*> statements;
  int next_version = 3;
};
const std::vector<OldStore> kOldStores = {
    {"version 1", 1, {kVersion1}},
    {"version 2", 2, {kVersion1, kVersion2}},
    {"version 2 with times", 2, {kVersion1, kVersion2, kTimesOnly}},
    {"version 2 of servers that follow models only",
     2,
     {kVersion1, kVersion2, kTimesOnly, kBeforeElsewhere}},
    {"version 2 of servers that follow each other",
     2,
     {kVersion1, kVersion2, kTimesOnly, kBeforeElsewhere, kElsewhere},
     5}};

class MigrationTest : public testing::Test {
 protected:
  /// Two batches, two models in force one after the other, a job that is not over.
  void write(const OldStore& old, const std::string& path) const {
    SQLite::Database file(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    for (const char* statements : old.statements) file.exec(statements);
    file.exec(fmt::format("PRAGMA user_version = {}", old.schema));
    file.exec(
        "INSERT INTO jobs (cell, level, bias, state, message, created_at, model_version, attempts) "
        "VALUES ('cell-7', '', '', 'done', 'made', 1650000000, 1, 1), ('cell-7', '', '', 'done', "
        "'better', 1650000100, 2, 1),('cell-7', '', '', 'queued', '', 1650000200, 0, 0)");
    for (int i = 1; i <= 2; ++i) {
      SQLite::Statement batch(file,
                              "INSERT INTO batches (cell, id, csv, hash, request_id, accepted_at, "
                              "poses, job) VALUES ('cell-7', ?, ?, ?, ?, 1650000000, 40, ?)");
      batch.bind(1, fmt::format("b{}", i));
      batch.bind(2, csv(i));
      batch.bind(3, sha256_hex(csv(i)));
      batch.bind(4, fmt::format("client:{}", i));
      batch.bind(5, i);
      batch.exec();
      SQLite::Statement model(
          file,
          "INSERT INTO models VALUES ('cell-7', ?, ?, ?, 'none', 'by-hand', 1650000000, ?, 0, ?)");
      model.bind(1, i);
      model.bind(2, made(i).provenance().id);
      model.bind(3, made(i).provenance().hash);
      model.bind(4, 40 + i);
      model.bind(5, serialize(made(i)));
      model.exec();
    }
    file.exec(
        "INSERT INTO job_batches VALUES (1, 0, 'cell-7', 'b1'), (2, 0, 'cell-7', 'b2'), (3, 0, "
        "'cell-7', 'b2')");
    file.exec(
        "INSERT INTO activations (cell, version, back, activated_at) VALUES ('cell-7', 1, NULL, "
        "1650000000), ('cell-7', 2, 1, 1650000100)");
  }
  static std::string csv(int i) { return fmt::format("q1_deg\n{}\n", i); }
  [[nodiscard]] CompensatedModel made(int i) const { return test::nominal_model(cell_, 40 + i); }

  const std::shared_ptr<const Cell> cell_ = test::small_cell("cell-7");
};

TEST_F(MigrationTest, AStoreOfEveryEarlierSchemaIsTakenOnWithAllThatItHolds) {
  for (const OldStore& old : kOldStores) {
    SCOPED_TRACE(old.name);
    const test::TemporaryFolder folder;
    const std::string path = folder.file("trammel.db");
    write(old, path);
    for (int start = 0; start < 2; ++start) {
      auto store = demand(Store::open(path));
      EXPECT_FALSE(store->state().why_not_written);
      EXPECT_EQ(demand(store->version_in_force("cell-7")), 2);
      for (int i = 1; i <= 2; ++i) {
        EXPECT_EQ(serialize(demand(store->model("cell-7", i))), serialize(made(i)));
        EXPECT_EQ(demand(store->batch("cell-7", fmt::format("b{}", i))).csv, csv(i));
      }
      EXPECT_EQ(demand(store->unfinished_jobs()).size(), 1u);
      EXPECT_EQ(demand(store->recent_jobs("cell-7", 5)).size(), 3u);
      EXPECT_FALSE(demand(store->audit()).broken);
      EXPECT_EQ(demand(store->batches("cell-7")).size(), 2u);
      EXPECT_EQ(demand(store->batches_learned_from("cell-7")), (std::set<std::string>{"b1", "b2"}));
    }
    auto store = demand(Store::open(path));
    ASSERT_TRUE(store->add_model("cell-7", test::nominal_model(cell_, 50), 3, true, "made"))
        << "and it goes on";
    EXPECT_EQ(demand(store->version_in_force("cell-7")), old.next_version)
        << "what another server gave stays given";
    store.reset();
    SQLite::Database file(path);
    for (const char* gone : {"replica", "learned_elsewhere", "versions_elsewhere"})
      EXPECT_FALSE(file.tableExists(gone));
  }
}

TEST_F(MigrationTest, AStoreOfEveryEarlierSchemaIsLookedAtAndCopiedWithoutBeingChanged) {
  for (const OldStore& old : kOldStores) {
    SCOPED_TRACE(old.name);
    const test::TemporaryFolder folder;
    const std::string path = folder.file("trammel.db");
    write(old, path);
    const std::string before = test::read_file(path);
    const auto models = ServedModels::open(path);
    ASSERT_TRUE(models) << models.error().message;
    std::vector<int> versions;
    EXPECT_FALSE(demand(models->find("cell-7", [&](const ModelOnDisk& on_disk) {
      versions.push_back(on_disk.version);
      return false;
    })));
    EXPECT_EQ(versions, (std::vector<int>{2, 1})) << "the one in force first";
    const auto copy = back_up_store(path, folder.file("copy.db"));
    ASSERT_TRUE(copy) << copy.error().message;
    EXPECT_EQ(copy->models, 2);
    EXPECT_EQ(test::read_file(path), before);
  }
}

}  // namespace
}  // namespace trammel
