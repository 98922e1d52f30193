// The servers of a record, what each of them does, and whether they mean the same by a cell.
#include "server/store/servers.h"

#include <gtest/gtest.h>

#include <memory>
#include <set>

#include "server/base/hash.h"
#include "server/store/database/postgres_database.h"
#include "server/store/servers_json.h"
#include "server/store/store.h"
#include "server/store/store_describe.h"
#include "server/store/store_init.h"
#include "tests/support/demand.h"
#include "tests/support/postgres.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

using test::demand;
using Disputes = std::map<std::string, std::string>;

const CellDescription kFirst{"c1", "r1"}, kOtherRobot{"c1", "r2"}, kOtherCell{"c2", "r1"};

class Servers : public testing::Test {
 protected:
  std::unique_ptr<Store> open(const std::string& server) {
    auto store = demand(Store::open(url_, folder_.file(server)));
    store->works_as(server);
    return store;
  }
  /// It says that it is there with these files of cell-7, compares them, and says what came of it.
  static Disputes arrive(Store& store, const CellDescription& files, bool starts = true,
                         const std::set<std::string>& agreed = {}) {
    EXPECT_TRUE(store.tell_presence(here(files)));
    auto disputes = demand(store.agree_on_cells({{"cell-7", files}}, starts, agreed));
    ServerSelf self = here(files);
    self.cells["cell-7"].is_apart = !disputes.empty() && agreed.empty();
    EXPECT_TRUE(store.tell_presence(self));
    return disputes;
  }
  static ServerSelf here(const CellDescription& files, int version = 1) {
    ServerSelf self{"", "host-a", 7, "0.1.0", true, true, {}, 0};
    self.cells["cell-7"] = {version, files, ""};
    return self;
  }
  std::string say(const std::string& sql) const {
    return test::Postgres::of_program().sql(url_, sql);
  }
  void was_heard(const std::string& server, int seconds_ago) const {
    say(
        fmt::format("UPDATE servers SET heard_at = CAST(EXTRACT(EPOCH FROM clock_timestamp()) AS "
                    "bigint) - {} WHERE server = '{}'",
                    seconds_ago, server));
  }
  std::string record_goes_by() const { return demand(described_cells(url_)).front().server; }

  test::TemporaryFolder folder_;
  const std::string url_ = test::Postgres::of_program().new_store();
  std::unique_ptr<Store> one_ = open("one"), other_ = open("other");
};

TEST_F(Servers, EachIsSeenByAllWithWhatItServesAndWorksOnAndHowFarItIsBehind) {
  const std::string csv = "q1_deg\n1\n";
  StoredJob asked;
  asked.cell = "cell-7";
  asked.batch_ids = {"b1"};
  const auto job =
      demand(
          one_->add_batch({"cell-7", "b1", csv, sha256_hex(csv), "client:1", 1700000000, 1}, asked))
          .id;
  ServerSelf self = here(kFirst, 3);
  self.serves = false;
  self.followed = demand(one_->changes_made());
  ASSERT_TRUE(one_->tell_presence(self));
  ASSERT_TRUE(one_->set_job_running(job));
  ASSERT_TRUE(other_->tell_presence(here(kFirst, 2)));
  for (const Store* store : {one_.get(), other_.get()}) {
    const auto servers = demand(store->servers(true));
    ASSERT_EQ(servers.size(), 2U);
    EXPECT_EQ(servers[0].self.server, "one");
    EXPECT_EQ(servers[0].self.host, "host-a");
    EXPECT_FALSE(servers[0].self.serves);
    EXPECT_EQ(servers[0].behind, 0);
    EXPECT_EQ(servers[0].works_on, (std::vector<JobAtServer>{{job, "cell-7"}}));
    EXPECT_EQ(servers[0].self.cells.at("cell-7"), (CellAtServer{3, kFirst, ""}));
    EXPECT_EQ(servers[1].self.server, "other");
    EXPECT_EQ(servers[1].behind, self.followed);
    EXPECT_FALSE(servers[1].is_gone);
    EXPECT_TRUE(demand(store->servers(false))[0].self.cells.empty());
  }
  const auto json = servers_json(demand(other_->servers(true)));
  EXPECT_EQ(json[0]["works_on"][0]["job"], job);
  EXPECT_EQ(json[1]["cells"][0], (nlohmann::ordered_json{{"cell", "cell-7"}, {"version", 2}}));
}

TEST_F(Servers, OneThatEndsIsNotThereOneThatIsNotHeardOfIsGoneAndOneThatStartsAgainIsOne) {
  ASSERT_TRUE(one_->tell_presence(here(kFirst)));
  ASSERT_TRUE(other_->tell_presence(here(kFirst)));
  was_heard("other", 10);
  EXPECT_FALSE(demand(one_->servers(false))[1].is_gone) << "two heartbeats are missing";
  was_heard("other", 16);
  const auto gone = demand(one_->servers(false))[1];
  EXPECT_TRUE(gone.is_gone);
  EXPECT_GE(gone.silent_s, 16);
  ASSERT_TRUE(other_->tell_presence(here(kFirst)));
  EXPECT_FALSE(demand(one_->servers(false))[1].is_gone) << "it is heard of again";
  other_ = open("other");
  ASSERT_TRUE(other_->tell_presence(here(kFirst)));
  EXPECT_EQ(demand(one_->servers(false)).size(), 2U) << "another start of the same server";
  ASSERT_TRUE(other_->take_leave());
  EXPECT_EQ(demand(one_->servers(false)).size(), 1U);
  ASSERT_TRUE(other_->tell_presence(here(kFirst)));
  was_heard("other", 90'000);
  ASSERT_TRUE(one_->tell_presence(here(kFirst, 2)));
  EXPECT_EQ(demand(one_->servers(false)).size(), 1U) << "it is forgotten after a day";
}

TEST_F(Servers, ACellWithOtherFilesIsNotAgreedOnAndBothServersAreNamedWithWhatDiffers) {
  EXPECT_EQ(arrive(*one_, kFirst), Disputes());
  EXPECT_EQ(arrive(*other_, kFirst), Disputes());
  for (const auto& [files, what] :
       {std::pair(kOtherRobot, "another robot file"), std::pair(kOtherCell, "another cell file")}) {
    const auto disputes = arrive(*other_, files);
    ASSERT_TRUE(disputes.contains("cell-7"));
    const std::string why = disputes.at("cell-7");
    for (const std::string& word : {std::string("cell-7"), std::string("other has "),
                                    std::string(what), std::string("than one (on host-a)")})
      EXPECT_NE(why.find(word), std::string::npos) << why;
  }
  EXPECT_EQ(arrive(*one_, kFirst), Disputes()) << "the one that agrees with the record serves it";
  EXPECT_EQ(arrive(*other_, kFirst), Disputes()) << "the files agree again";
  EXPECT_FALSE(demand(one_->audit()).broken);
}

TEST_F(Servers, AFileThatIsLeftBehindIsNotTakenThoughNobodyElseIsThere) {
  EXPECT_EQ(arrive(*one_, kFirst), Disputes());
  ASSERT_TRUE(one_->take_leave());
  EXPECT_TRUE(arrive(*other_, kOtherRobot).contains("cell-7"));
  EXPECT_EQ(record_goes_by(), "one");
}

TEST_F(Servers, TheFilesOfACellChangeServerByServerWithoutACommand) {
  EXPECT_EQ(arrive(*one_, kFirst), Disputes());
  EXPECT_EQ(arrive(*other_, kFirst), Disputes());
  one_ = open("one");
  EXPECT_TRUE(arrive(*one_, kOtherRobot).contains("cell-7"))
      << "the other one still has the old file";
  other_ = open("other");
  EXPECT_EQ(arrive(*other_, kOtherRobot), Disputes()) << "all that are there have the new one";
  EXPECT_EQ(arrive(*one_, kOtherRobot, false), Disputes());
  EXPECT_EQ(record_goes_by(), "other");
}

TEST_F(Servers, OfThreeServersTheLastOneWithTheOldFileKeepsNobodyFromTheNewOneAndGoesOnAnswering) {
  const auto third = open("third");
  for (Store* store : {one_.get(), other_.get(), third.get()})
    EXPECT_EQ(arrive(*store, kFirst), Disputes());
  one_ = open("one");
  EXPECT_TRUE(arrive(*one_, kOtherRobot).contains("cell-7")) << "two have the old one";
  other_ = open("other");
  EXPECT_EQ(arrive(*other_, kOtherRobot), Disputes())
      << "most of those that are there want the new one";
  EXPECT_EQ(arrive(*one_, kOtherRobot, false), Disputes());
  const std::set<std::string> agreed = {"cell-7"};
  for (int look = 0; look < 2; ++look) {
    const auto disputes = arrive(*third, kFirst, false, agreed);
    ASSERT_TRUE(disputes.contains("cell-7"));
    EXPECT_NE(disputes.at("cell-7").find("third answers with the model that it has"),
              std::string::npos)
        << disputes.at("cell-7");
  }
  EXPECT_EQ(record_goes_by(), "other") << "it wants nothing back";
}

TEST_F(Servers, WhoWasLeftWithTheFormerFileDoesNotBringItBackNorHelpsAnyoneElseTo) {
  const auto third = open("third");
  for (Store* store : {one_.get(), third.get()}) EXPECT_EQ(arrive(*store, kFirst), Disputes());
  EXPECT_TRUE(arrive(*other_, kOtherRobot).contains("cell-7"));
  ASSERT_TRUE(describe_cell(url_, "cell-7", "other", "anna"));
  EXPECT_EQ(arrive(*other_, kOtherRobot, false), Disputes());
  const std::set<std::string> agreed = {"cell-7"};
  for (Store* store : {one_.get(), third.get()})
    EXPECT_TRUE(arrive(*store, kFirst, false, agreed).contains("cell-7"))
        << "two of three have the former one";
  ASSERT_TRUE(other_->take_leave());
  EXPECT_TRUE(arrive(*one_, kFirst, false, agreed).contains("cell-7"))
      << "nor now that nobody has the new one";
  const auto fourth = open("fourth");
  EXPECT_TRUE(arrive(*fourth, kFirst).contains("cell-7")) << "those two serve, and want nothing";
  EXPECT_EQ(record_goes_by(), "other");
}

TEST_F(Servers, AServerThatIsAloneTakesItsOwnChangeAsItStartsAndNotLater) {
  EXPECT_EQ(arrive(*one_, kFirst), Disputes());
  EXPECT_EQ(arrive(*other_, kFirst), Disputes());
  one_ = open("one");
  EXPECT_TRUE(arrive(*one_, kOtherRobot).contains("cell-7"));
  was_heard("other", 20);
  EXPECT_TRUE(arrive(*one_, kOtherRobot, false).contains("cell-7"))
      << "that the right one dies makes nothing right";
  one_ = open("one");
  EXPECT_EQ(arrive(*one_, kOtherRobot), Disputes()) << "it was started again: its owner means it";
}

TEST_F(Servers, APersonSaysWhoseFilesCount) {
  EXPECT_EQ(arrive(*one_, kFirst), Disputes());
  EXPECT_TRUE(arrive(*other_, kOtherRobot).contains("cell-7"));
  const auto cells = demand(described_cells(url_));
  ASSERT_EQ(cells.size(), 1U);
  EXPECT_EQ(cells[0].servers[1].differs, "robot file");
  EXPECT_EQ(describe_cell(url_, "cell-7", "nobody", "anna").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(describe_cell(url_, "cell-9", "other", "anna").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(describe_cell(folder_.file("trammel.db"), "cell-7", "other", "anna").error().code,
            ErrorCode::kRefused);
  const std::int64_t before = demand(one_->descriptions_made());
  ASSERT_TRUE(describe_cell(url_, "cell-7", "other", "anna"));
  EXPECT_GT(demand(one_->descriptions_made()), before) << "servers see that they must look";
  EXPECT_EQ(arrive(*other_, kOtherRobot, false), Disputes());
  EXPECT_TRUE(arrive(*one_, kFirst, false).contains("cell-7"));
  const AuditTrail trail = demand(one_->audit({"cell-7", 0, 0}));
  EXPECT_EQ(trail.rows.back().who, "anna");
  EXPECT_EQ(trail.rows.back().what, "describe");
  EXPECT_FALSE(trail.broken);
}

TEST_F(Servers, WhatHappensIsInTheTrailWithTheServerThatDidIt) {
  EXPECT_EQ(arrive(*other_, kFirst), Disputes());
  const AuditTrail trail = demand(read_audit(url_, {}));
  EXPECT_FALSE(trail.broken);
  EXPECT_EQ(trail.rows.back().server, "other");
  EXPECT_EQ(trail.rows.front().server, "") << "by trammel store init";
  say("UPDATE audit SET server = 'one' WHERE server = 'other'");
  EXPECT_TRUE(demand(read_audit(url_, {})).broken) << "it is under the hash";
}

TEST_F(Servers, TheServicesRoleIsRefusedToChangeOrDeleteWhatIsInTheTrail) {
  say("CREATE ROLE keeper LOGIN");
  ASSERT_TRUE(init_store(url_, "keeper"));
  std::string service = url_;
  service.replace(service.find("postgres@"), 9, "keeper@");
  const auto store = demand(Store::open(service));
  store->works_as("served");
  EXPECT_EQ(arrive(*store, kFirst), Disputes()) << "it may do what a server does";
  const auto role = demand(PostgresDatabase::connect(service, PostgresDatabase::Session::kWrites));
  for (const char* wrong :
       {"UPDATE audit SET who = 'nobody'", "DELETE FROM audit", "TRUNCATE audit",
        "DELETE FROM audit_end", "UPDATE cell_descriptions SET server = 'nobody'",
        "DELETE FROM cell_descriptions", "UPDATE trammel_schema SET version = 1",
        "DROP TABLE audit", "ALTER TABLE audit DROP COLUMN who"})
    EXPECT_THROW(role->execute(wrong), DatabaseError) << wrong;
  const AuditTrail trail = demand(read_audit(service, {}));
  EXPECT_FALSE(trail.broken);
  EXPECT_EQ(trail.rows.back().server, "served");
  EXPECT_EQ(store->record().trail_is_safe, true);
  EXPECT_EQ(one_->record().trail_is_safe, false) << "it is the owner's";
}

TEST_F(Servers, ARecordOfBeforeIsBroughtUpToDateAndWhoHadTheOldTablesMayUseTheNewOnes) {
  say("CREATE ROLE earlier LOGIN");
  ASSERT_TRUE(init_store(url_, "earlier"));
  one_.reset();
  other_.reset();
  say("DROP TABLE servers; DROP TABLE cell_descriptions; ALTER TABLE audit DROP COLUMN "
      "server;ALTER TABLE job_outcomes DROP COLUMN held_back; ALTER TABLE health_checks DROP "
      "COLUMN tolerance_m;UPDATE trammel_schema SET version = 2, works_from = 2");
  std::string service = url_;
  service.replace(service.find("postgres@"), 9, "earlier@");
  EXPECT_EQ(Store::open(service).error().code, ErrorCode::kRefused);
  ASSERT_TRUE(init_store(url_));
  const auto store = demand(Store::open(service));
  EXPECT_EQ(arrive(*store, kFirst), Disputes());
  EXPECT_FALSE(demand(store->audit()).broken);
}

TEST_F(Servers, AFileHasOneServerAndNobodyToTell) {
  const auto file = demand(Store::open(folder_.file("trammel.db")));
  EXPECT_TRUE(file->tell_presence(here(kFirst)));
  EXPECT_TRUE(demand(file->servers(true)).empty());
  EXPECT_EQ(demand(file->agree_on_cells({{"cell-7", kFirst}}, true)), Disputes());
  EXPECT_TRUE(file->take_leave());
}

}  // namespace
}  // namespace trammel
