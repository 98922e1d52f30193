// The state of a store, and what it goes on doing, after faults of the disk.
#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>

#include "server/compensate/model_file.h"
#include "server/store/writer_lock.h"
#include "tests/store/store_under_test.h"
#include "tests/support/faulty_disk.h"

namespace trammel {
namespace {

namespace fs = std::filesystem;
using test::demand;
using test::job_of;

constexpr std::streamoff kPage = 4096;

/// A batch of more than a page.
StoredBatch batch(const std::string& id) {
  return test::batch_of(id, "q1_deg\n" + id + std::string(3000, '0') + "\n", "client:" + id);
}

class StoreFaults : public testing::Test, protected test::StoreUnderTest {
 protected:
  ~StoreFaults() override { store_.reset(); }  // while the disk is there
  void put_in_force(int poses, const std::string& cell = "cell-7") {
    const auto& its = cell == "cell-7" ? cell_ : other_cell_;
    ASSERT_TRUE(store_->add_model(cell, test::nominal_model(its, poses), 0, true, "made"));
  }
  /// The first version that can be served, 0: none.
  int served(const std::string& cell = "cell-7") {
    for (const int version : store_->versions_to_serve(cell)) {
      if (store_->model(cell, version)) return version;
    }
    return 0;
  }
  void overwrite(std::streamoff at, std::size_t size) {
    std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(at);
    file << std::string(size, '\x5A');
  }
  void forget_copies() { fs::remove_all(path_ + ".models"); }

  const std::shared_ptr<const Cell> other_cell_ = test::small_cell("cell-8");
  std::optional<test::FaultyDisk> disk_;
};

TEST_F(StoreFaults,
       OnADiskThatIsFullAtTheStartTheModelsAreThereAndChangesAreRefusedUntilThereIsRoom) {
  test::FaultyDisk& disk = disk_.emplace();
  open();
  put_in_force(1);
  for (const int code :
       {SQLITE_FULL, SQLITE_IOERR_WRITE, SQLITE_READONLY, SQLITE_IOERR_SHMSIZE, SQLITE_CANTOPEN}) {
    store_.reset();
    disk.refuse_writing(code);
    open();
    EXPECT_EQ(served(), 1) << code;
    const std::string id = "lt-" + std::to_string(code);
    const auto refused = store_->add_batch(batch(id), job_of(id));
    ASSERT_FALSE(refused) << code;
    EXPECT_EQ(refused.error().code, ErrorCode::kBusy) << sentence(refused.error());
    EXPECT_FALSE(store_->try_again()) << code;
    EXPECT_TRUE(store_->state().why_not_written) << code;
    disk.work_again();
    EXPECT_TRUE(store_->wait_until_writable({})) << code;
    EXPECT_FALSE(store_->state().why_not_written) << code;
    EXPECT_TRUE(store_->add_batch(batch(id), job_of(id))) << code;
  }
}

TEST_F(StoreFaults, WhateverCallFailsWhatIsRefusedIsNotThereAndWhatIsAcceptedStays) {
  test::FaultyDisk& disk = disk_.emplace();
  open();
  put_in_force(1);
  std::set<std::string> accepted;
  for (const int code :
       {SQLITE_FULL, SQLITE_IOERR_WRITE, SQLITE_IOERR_FSYNC, SQLITE_IOERR_SHMMAP}) {
    for (int nth = 0; nth < 12; ++nth) {
      const std::string id = fmt::format("{}-{}", code, nth);
      disk.set_plan([code, left = nth](auto, const std::string&) mutable {
        return left-- == 0 ? code : SQLITE_OK;
      });
      if (store_->add_batch(batch(id), job_of(id))) accepted.insert(id);
      disk.work_again();
      const auto again = store_->add_batch(batch(id + "+"), job_of(id + "+"));
      EXPECT_TRUE(again) << "with room again it goes on: " << sentence(again.error());
      accepted.insert(id + "+");
    }
  }
  restart();
  std::set<std::string> kept;
  for (const StoredBatch& one : demand(store_->batches("cell-7"))) kept.insert(one.id);
  EXPECT_EQ(kept, accepted);
  EXPECT_EQ(demand(store_->unfinished_jobs()).size(), accepted.size());
  EXPECT_EQ(served(), 1);
}

TEST_F(StoreFaults,
       AStoreOfBeforeThatAFullDiskKeepsFromBeingTakenOnIsServedFromItsCopiesUntilThereIsRoom) {
  test::FaultyDisk& disk = disk_.emplace();
  open();
  put_in_force(1);
  store_.reset();
  SQLite::Database(path_, SQLite::OPEN_READWRITE).exec("DROP TABLE cells; DROP TABLE discarded");
  disk.refuse_writing(SQLITE_FULL);
  open();
  EXPECT_EQ(served(), 1);
  EXPECT_TRUE(store_->state().why_not_written)
      << "it would be taken for readable, and what reads it would fail";
  EXPECT_FALSE(store_->batches("cell-7"));
  disk.work_again();
  ASSERT_TRUE(store_->wait_until_writable({}));
  EXPECT_TRUE(store_->batches("cell-7"));
  EXPECT_EQ(served(), 1);
}

TEST_F(StoreFaults, ADiskThatFillsLaterIsTroubleUntilSomethingIsWrittenAgain) {
  test::FaultyDisk& disk = disk_.emplace();
  open();
  put_in_force(1);
  disk.refuse_writing(SQLITE_FULL);
  EXPECT_FALSE(store_->add_batch(batch("a"), job_of("a")));
  EXPECT_FALSE(store_->try_again());
  EXPECT_TRUE(store_->activate("cell-7", 1)) << "changes nothing";
  EXPECT_TRUE(store_->state().why_not_written);
  disk.work_again();
  EXPECT_TRUE(store_->try_again());
  EXPECT_FALSE(store_->state().why_not_written);
}

TEST_F(StoreFaults, AfterAPowerCutAtAnyCallAllThatWasAcknowledgedIsThere) {
  struct Acknowledged {
    std::size_t calls;
    int batches, models;
  };
  std::vector<Acknowledged> acknowledged;
  test::FaultyDisk& disk = disk_.emplace();
  open();
  acknowledged.push_back({disk.calls(), 0, 0});
  for (int i = 1; i <= 4; ++i) {
    const std::string id = std::to_string(i);
    const auto job = demand(store_->add_batch(batch(id), job_of(id)));
    acknowledged.push_back({disk.calls(), i, i - 1});
    ASSERT_TRUE(store_->add_model("cell-7", test::nominal_model(cell_, i), job.id, true, "made"));
    acknowledged.push_back({disk.calls(), i, i});
  }
  const std::size_t end = disk.calls();
  store_.reset();
  std::mt19937_64 random(13);
  for (std::size_t cut = acknowledged.front().calls; cut <= end; ++cut) {
    for (int round = 0; round < 2; ++round) {
      test::TemporaryFolder left;
      disk.cut_power(cut, random, left.path());
      auto store = Store::open(left.file("trammel.db"));
      ASSERT_TRUE(store) << "cut after call " << cut << ": " << sentence(store.error());
      Acknowledged least{};
      for (const Acknowledged& one : acknowledged) {
        if (one.calls <= cut) least = one;
      }
      const auto batches = demand((*store)->batches("cell-7"));
      const auto models = demand((*store)->models("cell-7"));
      EXPECT_GE(static_cast<int>(batches.size()), least.batches) << "cut after call " << cut;
      EXPECT_GE(static_cast<int>(models.size()), least.models) << "cut after call " << cut;
      EXPECT_EQ(demand((*store)->version_in_force("cell-7")).value_or(0),
                static_cast<int>(models.size()));
      for (const StoredBatch& one : batches)
        EXPECT_EQ(demand((*store)->batch("cell-7", one.id)).csv, batch(one.id).csv);
      EXPECT_TRUE(models.empty() || (*store)->model("cell-7", models.back().version));
      EXPECT_EQ(demand((*store)->unfinished_jobs()).size(), batches.size() - models.size());
    }
  }
}

/// Changes in an order that `seed` draws, each under an id of its own.
class Changes {
 public:
  explicit Changes(std::uint64_t seed) {
    std::mt19937_64 random(seed);
    for (int i = 0; i < 12; ++i) kinds_.push_back(std::uniform_int_distribution<int>(0, 7)(random));
  }
  /// Those from `*next` on, which rises with every answer.
  void ask(Store& store, std::size_t* next) const {
    for (; *next < kinds_.size(); ++*next) {
      const std::size_t i = *next;
      const ChangeId id{"robot-3:" + std::to_string(i), std::to_string(kinds_[i])};
      const int version = static_cast<int>(i) % 3 + 1;
      const std::string name = std::to_string(i);
      StoredBatch brought = batch(name);
      switch (kinds_[i]) {
        case 0:
          static_cast<void>(store.activate("cell-7", version, id));
          break;
        case 1:
          static_cast<void>(store.rollback("cell-7", 1, id));  // refused where nothing was before
          break;
        case 2:
          static_cast<void>(store.add_batch(brought, job_of(name)));
          break;
        case 3:
          static_cast<void>(store.add_job(job_of("first"), false, id));
          break;
        case 4:
          static_cast<void>(store.add_model("cell-7",
                                            test::nominal_model(cell_, 100 + static_cast<int>(i)),
                                            0, true, "better", false, id));
          break;
        case 5:
          static_cast<void>(store.add_model("cell-7",
                                            test::nominal_model(cell_, 100 + static_cast<int>(i)),
                                            0, false, "not better", false, id));
          break;
        case 6:
          while (store.prune_one("cell-7", {1, 1, 1}).value_or(false)) {
          }
          break;
        default:
          static_cast<void>(store.set_quarantine("cell-7", "first", name, id));
      }
    }
  }

 private:
  std::vector<int> kinds_;
  const std::shared_ptr<const Cell> cell_ = test::small_cell("cell-7");
};

/// The trail without its times; "broken" where it does not verify.
std::string audited(const Store& store) {
  const AuditTrail trail = demand(store.audit());
  std::string all = trail.broken ? "broken: " + sentence(*trail.broken) : "";
  for (const AuditRow& row : trail.rows)
    all += fmt::format("\n{} {} {}: {} -> {} ({}) {}", row.number, row.what, row.subject,
                       row.before, row.after, row.why, row.request);
  return all;
}

/// Everything that the changes change.
std::string contents(const Store& store) {
  std::string all =
      fmt::format("in force {}", demand(store.version_in_force("cell-7")).value_or(0));
  if (const auto before = store.previous_in_force("cell-7"))
    all += fmt::format(", before {}", fmt::join(*before, " "));
  for (const StoredBatch& one : demand(store.batches("cell-7")))
    all += "\n" + one.id + " " + one.quarantine + (one.pruned ? " pruned" : "");
  for (const StoredModel& one : demand(store.models("cell-7")))
    all += fmt::format("\nversion {} {}", one.version,
                       store.model("cell-7", one.version) ? "there" : "pruned");
  for (const StoredJob& one : demand(store.unfinished_jobs()))
    all += fmt::format("\njob of {}", fmt::join(one.batch_ids, " "));
  return all + "\n" + audited(store);
}

class KilledStore : public StoreFaults, public testing::WithParamInterface<int> {};

TEST_P(KilledStore, AtAnyCallHasMadeEveryChangeOnceThatIsAskedForAgain) {
  constexpr int kPoints = 32;
  const int seed = GetParam();
  open();
  for (int i = 1; i <= 3; ++i) put_in_force(i);
  ASSERT_TRUE(store_->add_batch(batch("first"), job_of("first")));
  store_.reset();
  const auto fresh_copy = [&](const test::TemporaryFolder& to) {
    fs::copy(folder_.path(), to.path(), fs::copy_options::recursive);
    return to.file("trammel.db");
  };
  int killed = 0;
  auto* answered = static_cast<std::size_t*>(::mmap(
      nullptr, sizeof(std::size_t), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0));
  const Changes changes(static_cast<std::uint64_t>(seed));
  std::string expected;
  std::size_t calls = 0;
  {
    test::TemporaryFolder whole;
    test::FaultyDisk disk;
    auto store = demand(Store::open(fresh_copy(whole)));
    const std::size_t before = disk.calls();
    std::size_t next = 0;
    changes.ask(*store, &next);
    calls = disk.calls() - before;
    expected = contents(*store);
    store.reset();
  }
  for (int point = 0; point < kPoints; ++point) {
    test::TemporaryFolder left;
    const std::string path = fresh_copy(left);
    *answered = 0;
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      test::FaultyDisk disk;
      auto store = Store::open(path);
      auto calls_left = static_cast<int>(calls) * point / kPoints;
      disk.set_plan([calls_left](auto, const std::string&) mutable {
        if (calls_left-- == 0) ::kill(::getpid(), SIGKILL);
        return SQLITE_OK;
      });
      if (store) changes.ask(**store, answered);
      ::_exit(0);
    }
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    killed += WIFSIGNALED(status) ? 1 : 0;
    const auto store = demand(Store::open(path));
    EXPECT_FALSE(store->versions_to_serve("cell-7").empty());
    changes.ask(*store, answered);  // the client knows what was answered, and repeats the rest
    EXPECT_EQ(contents(*store), expected)
        << "seed " << seed << ", call " << static_cast<int>(calls) * point / kPoints;
  }
  EXPECT_GE(killed, kPoints - 1);
}

TEST_P(KilledStore, WhileAFileOfBeforeTheTrailIsTakenOnHasTakenItOnOnce) {
  constexpr int kPoints = 30;
  open();
  for (int i = 1; i <= 1 + GetParam(); ++i) {
    put_in_force(i);
    ASSERT_TRUE(store_->add_batch(batch(std::to_string(i)), job_of(std::to_string(i))));
  }
  store_.reset();
  {
    SQLite::Database before(path_, SQLite::OPEN_READWRITE);
    before.exec("DROP TABLE audit; DROP TABLE audit_end; DROP TABLE pruned");
  }
  std::size_t calls = 0;
  const auto fresh_copy = [&](const test::TemporaryFolder& to) {
    fs::copy(folder_.path(), to.path(), fs::copy_options::recursive);
    return to.file("trammel.db");
  };
  {
    test::TemporaryFolder whole;
    test::FaultyDisk disk;
    demand(Store::open(fresh_copy(whole))).reset();
    calls = disk.calls();
  }
  for (int point = 0; point < kPoints; ++point) {
    test::TemporaryFolder left;
    const std::string path = fresh_copy(left);
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      test::FaultyDisk disk;
      auto calls_left = static_cast<int>(calls) * point / kPoints;
      disk.set_plan([calls_left](auto, const std::string&) mutable {
        if (calls_left-- == 0) ::kill(::getpid(), SIGKILL);
        return SQLITE_OK;
      });
      static_cast<void>(Store::open(path));
      ::_exit(0);
    }
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    const auto store = demand(Store::open(path));
    const AuditTrail trail = demand(store->audit());
    EXPECT_FALSE(trail.broken) << sentence(*trail.broken);
    ASSERT_EQ(trail.rows.size(), 1u) << "call " << static_cast<int>(calls) * point / kPoints;
    EXPECT_EQ(trail.rows.front().what, "migrate");
    EXPECT_EQ(demand(store->version_in_force("cell-7")), 1 + GetParam());
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, KilledStore, testing::Range(0, 10));

TEST_F(StoreFaults, WhateverPageIsDamagedTheLastModelOfEveryCellIsServed) {
  open();
  for (int i = 1; i <= 3; ++i) {
    const std::string id = std::to_string(i);
    ASSERT_TRUE(store_->add_batch(batch(id), job_of(id)));
    put_in_force(i);
    put_in_force(i, "cell-8");
  }
  store_.reset();
  const std::string good = test::read_file(path_);
  const auto pages = static_cast<std::streamoff>(good.size()) / kPage;
  ASSERT_GT(pages, 20);
  for (std::streamoff page = 0; page < pages; ++page) {
    for (const std::streamoff at : {std::streamoff{0}, std::streamoff{1500}}) {
      std::ofstream(path_, std::ios::binary) << good;
      overwrite(page * kPage + at, 600);
      auto opened = Store::open(path_);
      ASSERT_TRUE(opened) << "page " << page << ": " << sentence(opened.error());
      store_ = std::move(*opened);
      EXPECT_EQ(served("cell-7"), 3) << "page " << page;
      EXPECT_EQ(served("cell-8"), 3) << "page " << page;
      static_cast<void>(store_->unfinished_jobs());
      store_.reset();
    }
  }
}

TEST_F(StoreFaults, WithoutCopiesADamagedModelIsAnErrorOfItsOwnAndOlderOnesAreServed) {
  open();
  put_in_force(1);
  put_in_force(2);
  put_in_force(1, "cell-8");
  store_.reset();
  forget_copies();
  {
    SQLite::Database(path_, SQLite::OPEN_READWRITE)
        .exec("UPDATE models SET content = 'x' WHERE version = 2");
  }
  open();
  forget_copies();
  EXPECT_EQ(store_->versions_to_serve("cell-7"), (std::vector<int>{2, 1}));
  EXPECT_EQ(served(), 1);
  EXPECT_EQ(served("cell-8"), 1);
}

TEST_F(StoreFaults, HoweverTheTextInForceIsDamagedItsCopyIsServedAndBothAreSaid) {
  open();
  put_in_force(1);
  put_in_force(2);
  store_.reset();
  for (const char* const damage :
       {"''", "'x'", "'{}'", "'null'", "substr(content, 1, length(content) / 2)",
        "substr(content, 2)", "replace(content, '2', '3')", "replace(content, ':', '')",
        "upper(content)", "content || '}'", "zeroblob(length(content))", "content || content",
        "(SELECT content FROM models AS other WHERE other.version = 1)"}) {
    SCOPED_TRACE(damage);
    {
      SQLite::Database file(path_, SQLite::OPEN_READWRITE);
      file.exec("CREATE TABLE kept AS SELECT content FROM models WHERE version = 2");
      file.exec(fmt::format("UPDATE models SET content = {} WHERE version = 2", damage));
    }
    open();
    const auto read = store_->read("cell-7", 2);
    ASSERT_TRUE(read) << sentence(read.error());
    EXPECT_EQ(read->model.provenance().training_poses, 2);
    EXPECT_NE(read->damage.find("version 2 is served from its copy " + path_ + ".models/"),
              std::string::npos)
        << read->damage;
    EXPECT_NE(read->damage.find("the text in the store is bad"), std::string::npos) << read->damage;
    EXPECT_EQ(store_->state().damages, std::vector<std::string>{read->damage});
    store_.reset();
    SQLite::Database file(path_, SQLite::OPEN_READWRITE);
    file.exec("UPDATE models SET content = (SELECT content FROM kept) WHERE version = 2");
    file.exec("DROP TABLE kept");
  }
  open();
  EXPECT_EQ(demand(store_->read("cell-7", 2)).damage, "");
}

TEST_F(StoreFaults, AStoreThatWasEmptiedOrIsNoStoreAnyMoreIsLeftAloneAndItsModelsAreServed) {
  open();
  put_in_force(1);
  put_in_force(2);
  store_.reset();
  for (const std::string& left : {std::string(), std::string(20000, 'x')}) {
    std::ofstream(path_, std::ios::binary) << left;
    open();
    EXPECT_EQ(served(), 2);
    const auto refused = store_->add_batch(batch("a"), job_of("a"));
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::kInternal) << sentence(refused.error());
    EXPECT_FALSE(store_->state().readable);
    store_.reset();
    EXPECT_EQ(test::read_file(path_), left);
  }
}

TEST_F(StoreFaults, TheStoreOfAnotherServerInItsPlaceIsLeftAloneAndTheModelsThatServedHereGoOn) {
  const std::string other = folder_.file("other.db");
  {
    auto store = demand(Store::open(other));
    ASSERT_TRUE(
        store->add_model("cell-7", test::nominal_model(cell_, 77), 0, true, "another server's"));
  }
  open();
  put_in_force(1);
  const std::string hash = demand(store_->model("cell-7", 1)).provenance().hash;
  store_.reset();
  fs::copy_file(other, path_, fs::copy_options::overwrite_existing);
  open();
  EXPECT_EQ(demand(store_->model("cell-7", served())).provenance().hash, hash);
  EXPECT_FALSE(store_->add_batch(batch("a"), job_of("a")));
}

TEST_F(StoreFaults, AStoreThatWentBackToABackupTakesBackWhatWasInForceSince) {
  open();
  put_in_force(1);
  store_.reset();
  const std::string backup = test::read_file(path_);
  open();
  put_in_force(2);
  put_in_force(3);
  store_.reset();
  std::ofstream(path_, std::ios::binary) << backup;
  open();
  EXPECT_EQ(served(), 3);
  ASSERT_TRUE(store_->take_back_from_copy("cell-7"));
  EXPECT_EQ(demand(store_->version_in_force("cell-7")), 3);
  put_in_force(4);
  EXPECT_EQ(demand(store_->version_in_force("cell-7")), 4)
      << "a number that was taken is not given again";
  restart();
  EXPECT_EQ(served(), 4);
  EXPECT_EQ(demand(store_->rollback("cell-7")), 3);
}

TEST_F(StoreFaults, AJournalThatIsLostDamagedOrCutLosesNothing) {
  open();
  std::string journal;
  for (int i = 1; i <= 3; ++i) {
    const std::string id = std::to_string(i);
    ASSERT_TRUE(store_->add_batch(batch(id), job_of(id)));
    put_in_force(i);
    journal = test::read_file(path_ + "-wal");
  }
  const std::string file = test::read_file(path_);
  const std::vector<std::string> journals = {"", journal.substr(0, journal.size() / 2),
                                             journal.substr(0, 20),
                                             std::string(journal.size(), 'x'), journal};
  for (const std::string& left : journals) {
    test::TemporaryFolder crashed;
    std::ofstream(crashed.file("trammel.db"), std::ios::binary) << file;
    if (!left.empty()) std::ofstream(crashed.file("trammel.db-wal"), std::ios::binary) << left;
    const auto store = demand(Store::open(crashed.file("trammel.db")));
    EXPECT_EQ(demand(store->batches("cell-7")).size(), 3u);
    EXPECT_EQ(demand(store->version_in_force("cell-7")), 3);
    EXPECT_TRUE(store->model("cell-7", 3));
  }
}

/// Another program's change of the file while the store is open, and how that is taken back.
/// `kept` is the file as it was just before.
struct Meddling {
  const char* name;
  void (*meddle)(const std::string& path, const std::string& kept, const std::string& earlier);
  void (*take_back)(const std::string& path, const std::string& kept);
};

void put_in_place_of(const std::string& path, const std::string& text) {
  std::ofstream(path + ".new", std::ios::binary) << text;
  fs::rename(path + ".new", path);
}

void write_over(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << text;
}

void replace_by_pipe(const std::string& path) {
  fs::remove(path);
  ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
}

const Meddling kMeddlings[] = {
    {"Renamed", [](auto& path, auto&, auto&) { fs::rename(path, path + ".away"); },
     [](auto& path, auto&) { fs::rename(path + ".away", path); }},
    {"Removed", [](auto& path, auto&, auto&) { fs::remove(path); }, put_in_place_of},
    {"ReplacedByAnEarlierState",
     [](auto& path, auto&, auto& earlier) { put_in_place_of(path, earlier); }, put_in_place_of},
    {"ReplacedByNoStore", [](auto& path, auto&, auto&) { put_in_place_of(path, "something else"); },
     put_in_place_of},
    {"ReplacedByAPipe", [](auto& path, auto&, auto&) { replace_by_pipe(path); }, put_in_place_of},
    {"Emptied", [](auto& path, auto&, auto&) { fs::resize_file(path, 0); }, write_over},
    {"Cut", [](auto& path, auto& kept, auto&) { fs::resize_file(path, kept.size() / 2); },
     write_over},
    {"WrittenOverByAnEarlierState",
     [](auto& path, auto&, auto& earlier) { write_over(path, earlier); }, write_over},
    {"WrittenOverByNoStore",
     [](auto& path, auto& kept, auto&) { write_over(path, std::string(kept.size(), 'x')); },
     write_over}};

class MeddledStore : public StoreFaults, public testing::WithParamInterface<Meddling> {};

TEST_P(MeddledStore, AcknowledgesNothingUntilTheFileIsBackAndLosesNothing) {
  open();
  put_in_force(1);
  const std::string earlier = test::read_file(path_);
  put_in_force(2);
  ASSERT_TRUE(store_->add_batch(batch("before"), job_of("before")));
  const std::string kept = test::read_file(path_);
  GetParam().meddle(path_, kept, earlier);
  EXPECT_FALSE(store_->try_again()) << "it is noticed without a change";
  ASSERT_TRUE(store_->state().why_not_written);
  const auto refused = store_->add_batch(batch("during"), job_of("during"));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kBusy) << sentence(refused.error());
  EXPECT_FALSE(store_->activate("cell-7", 1));
  EXPECT_EQ(served(), 2) << "models are served";
  GetParam().take_back(path_, kept);
  EXPECT_TRUE(store_->wait_until_writable({}));
  EXPECT_FALSE(store_->state().why_not_written);
  EXPECT_TRUE(store_->add_batch(batch("after"), job_of("after")));
  EXPECT_TRUE(store_->activate("cell-7", 1));
  restart();
  EXPECT_FALSE(store_->state().why_not_written);
  EXPECT_EQ(served(), 1);
  std::set<std::string> ids;
  for (const StoredBatch& one : demand(store_->batches("cell-7"))) ids.insert(one.id);
  EXPECT_EQ(ids, (std::set<std::string>{"before", "after"}));
}

TEST_P(MeddledStore, StartedAgainInThatStateServesTheModels) {
  open();
  put_in_force(1);
  const std::string earlier = test::read_file(path_);
  put_in_force(2);
  GetParam().meddle(path_, test::read_file(path_), earlier);
  restart();
  EXPECT_EQ(served(), 2);
}

INSTANTIATE_TEST_SUITE_P(WhileOpen, MeddledStore, testing::ValuesIn(kMeddlings),
                         [](const auto& meddling) { return meddling.param.name; });

TEST_F(StoreFaults, AStoreThatWasRemovedSaysHowToBringItBackAndThatBringsAllOfItBack) {
  open();
  put_in_force(1);
  fs::remove(path_);
  ASSERT_FALSE(store_->try_again());
  const std::string said = store_->state().why_not_written->next;
  const std::size_t from = said.find("cp "), to = said.find(')');
  ASSERT_NE(from, std::string::npos) << said;
  ASSERT_EQ(std::system(said.substr(from, to - from).c_str()), 0) << said;
  EXPECT_TRUE(store_->wait_until_writable({})) << sentence(*store_->state().why_not_written);
  restart();
  EXPECT_EQ(demand(store_->version_in_force("cell-7")), 1);
}

TEST_F(StoreFaults, AStoreThatIsOnlyTouchedGoesOn) {
  open();
  put_in_force(1);
  fs::permissions(path_, fs::perms::owner_read | fs::perms::owner_write);
  EXPECT_TRUE(store_->add_batch(batch("a"), job_of("a")));
  fs::create_hard_link(path_, folder_.file("backup.db"));
  EXPECT_TRUE(store_->add_batch(batch("b"), job_of("b")));
  fs::remove(path_ + "-wal");
  EXPECT_TRUE(store_->add_batch(batch("c"), job_of("c")));
  restart();
  EXPECT_EQ(demand(store_->batches("cell-7")).size(), 3u);
}

TEST_F(StoreFaults, AFileThatIsGoneIsNoNewBeginningWhileItsCopiesAreThere) {
  open();
  put_in_force(1);
  put_in_force(2);
  store_.reset();
  const std::string kept = test::read_file(path_);
  fs::remove(path_);
  open();
  EXPECT_EQ(served(), 2);
  ASSERT_TRUE(store_->state().why_not_written);
  EXPECT_NE(sentence(*store_->state().why_not_written).find("not there"), std::string::npos);
  EXPECT_FALSE(store_->add_batch(batch("a"), job_of("a")));
  EXPECT_FALSE(fs::exists(path_));
  write_over(path_, kept);
  EXPECT_TRUE(store_->wait_until_writable({}));
  EXPECT_EQ(demand(store_->version_in_force("cell-7")), 2);
  store_.reset();
  fs::remove(path_);
  forget_copies();
  open();
  EXPECT_EQ(served(), 0) << "a new beginning";
}

TEST_F(StoreFaults, ASecondWriterIsRefusedByWhateverNameItComes) {
  open();
  put_in_force(1);
  const std::string other = folder_.file("other.db");
  fs::create_hard_link(path_, other);
  fs::remove(path_ + ".lock");
  for (const std::string& name : {other, path_}) {
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      const auto store = Store::open(name);
      const bool refused = !store && store.error().code == ErrorCode::kConflict;
      ::_exit(refused && !WriterLock::look(name) ? 0 : 1);
    }
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    EXPECT_EQ(status, 0) << name;
  }
  put_in_force(2);
  EXPECT_FALSE(store_->state().why_not_written);
}

}  // namespace
}  // namespace trammel
