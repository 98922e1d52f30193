// The page on which a server shows the others of its record.
#include "server/http/servers_page.h"

#include <gtest/gtest.h>

#include "server/http/metrics.h"
#include "server/http/readiness.h"
#include "tests/http/watched_server.h"
#include "tests/support/postgres.h"

namespace trammel {
namespace {

/// Beside the server that is watched another one, `server-b` on `hall-3`, has the same record.
class ServersPage : public testing::Test {
 protected:
  ServersPage() : other_(test::demand(Store::open(url_, folder_.file("cache")))) {
    other_->works_as("server-b");
  }
  /// It says that it serves cell-7 by these files.
  void other_arrives(const CellDescription& files) {
    ServerSelf self{"", "hall-3", 7, "0.1.0", true, true, {}, 0};
    self.cells["cell-7"] = {2, files, ""};
    ASSERT_TRUE(other_->tell_presence(self));
    static_cast<void>(test::demand(other_->agree_on_cells({{"cell-7", files}}, true)));
  }
  void other_is_silent() const {
    test::Postgres::of_program().sql(
        url_, "UPDATE servers SET heard_at = heard_at - 60 WHERE server = 'server-b'");
  }
  static bool has(const std::string& text, const std::string& words) {
    return text.find(words) != std::string::npos;
  }

  test::TemporaryFolder folder_;
  const std::string url_ = test::Postgres::of_program().new_store();
  std::unique_ptr<Store> other_;
};

TEST_F(ServersPage, ShowsAllServersWithWhatTheyServeAndThatOneIsGone) {
  other_arrives(description_of(*test::small_cell("cell-7")));
  test::WatchedServer server({{"cell-7", test::small_cell("cell-7")}}, url_);
  static_cast<void>(test::demand(server.trainer().take_up()));
  const std::string there = servers_page(server.watched()).body;
  EXPECT_TRUE(has(there, "All 2 servers are there.")) << there;
  EXPECT_TRUE(has(there, "version 2: server-b")) << there;
  EXPECT_TRUE(has(there, "hall-3")) << there;
  other_is_silent();
  const std::string gone = servers_page(server.watched()).body;
  EXPECT_TRUE(has(gone, "1 of 2 servers gone: server-b.")) << gone;
  EXPECT_TRUE(has(gone, "not heard of since")) << gone;
  EXPECT_FALSE(has(gone, "version 2: server-b")) << "it serves no more";
  EXPECT_FALSE(has(gone, "server-a has")) << gone;
}

TEST_F(ServersPage, ACellWithOtherFilesIsDarkAndNamesBothServers) {
  CellDescription files = description_of(*test::small_cell("cell-7"));
  files.robot = "another";
  other_arrives(files);
  test::WatchedServer server({{"cell-7", test::small_cell("cell-7")}}, url_);
  static_cast<void>(test::demand(server.trainer().take_up()));
  const auto cells = cells_readiness(server.watched());
  ASSERT_EQ(cells.size(), 1U);
  EXPECT_EQ(cells[0].state, CellReadiness::State::kDescribedOtherwise);
  EXPECT_TRUE(has(cells[0].why, "server-a has another robot file than server-b (on hall-3)"))
      << cells[0].why;
  const Readiness ready = readiness(server.watched(), ServerPhase::kServing, "");
  EXPECT_FALSE(ready.ready);
  EXPECT_EQ(ready.told["dark"][0]["state"], "described_otherwise");
  ASSERT_TRUE(server.store().tell_presence(server.trainer().self())) << "as its heartbeat does";
  EXPECT_TRUE(has(servers_page(server.watched()).body, cells[0].why.substr(0, 40)));
  test::SmallBatch measured;
  const auto refused = server.trainer().submit(
      "cell-7", "b1", test::small_batch_csv(*test::small_cell("cell-7"), measured), "b1");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kConflict);
}

TEST_F(ServersPage, AFileHasItsOneServer) {
  test::WatchedServer server;
  server.submit("cell-7", "b1", 1);
  server.work();
  const std::string page = servers_page(server.watched()).body;
  EXPECT_TRUE(has(page, "Its server is there.")) << page;
  EXPECT_TRUE(has(page, "version 1: server-a")) << page;
  const std::string metrics = Metrics(server.watched()).text(ServerPhase::kServing, 0);
  EXPECT_TRUE(has(metrics, "trammel_record_reachable 1")) << metrics;
  EXPECT_TRUE(has(metrics, "name=\"server-a\"")) << metrics;
  EXPECT_EQ(
      readiness(server.watched(), ServerPhase::kServing, "").told["record"]["servers"][0]["server"],
      "server-a");
}

}  // namespace
}  // namespace trammel
