// A database that is reached by TLS: both sides show certificates, and whoever is not who he should
// be is refused with what is wrong, and is told no secret.
#include <gtest/gtest.h>

#include <set>

#include "server/store/store_init.h"
#include "server/store/store_place.h"
#include "tests/store/store_under_test.h"
#include "tests/support/own_ports.h"
#include "tests/support/postgres.h"

namespace trammel {
namespace {

using test::batch_of;
using test::demand;
using test::job_of;

class Certificates : public testing::Test {
 protected:
  static test::Postgres& server() {
    static test::Postgres one;
    return one;
  }
  static void SetUpTestSuite() {
    server().take_certificates(test::own_ports());
    for (const char* role : {"keeper", "another"})
      server().sql(server().url("postgres"), fmt::format("CREATE ROLE {} LOGIN", role));
  }
  Certificates() {
    const std::string url = server().new_store();
    EXPECT_TRUE(init_store(url, "keeper"));
    EXPECT_TRUE(init_store(url, "another"));
    const std::string name = server().sql(url, "SELECT current_database()");
    database_ = name.substr(0, name.find('\n'));
  }
  static std::string with(std::string url, const std::string& what, const std::string& by) {
    const std::size_t at = url.find(what);
    EXPECT_NE(at, std::string::npos) << what;
    return at == std::string::npos ? url : url.replace(at, what.size(), by);
  }
  /// It is refused for good, in words that say `why` and name the place.
  void expect_refused(const std::string& url, const std::string& why) {
    const auto opened = Store::open(url, folder_.file("none"));
    ASSERT_FALSE(opened) << why;
    EXPECT_EQ(opened.error().code, ErrorCode::kRefused) << sentence(opened.error());
    EXPECT_EQ(opened.error().file, spoken_place(url));
    EXPECT_NE(opened.error().message.find(why), std::string::npos) << sentence(opened.error());
  }

  std::string database_;
  test::TemporaryFolder folder_;
};

TEST_F(Certificates, AServerThatShowsItsOwnAndComparesTheDatabasesDoesAllThatItDoesByTls) {
  const std::string url = server().certified_url(database_);
  const auto store = demand(Store::open(url, folder_.file("cache")));
  store->works_as("one");
  ASSERT_TRUE(store->add_batch(batch_of("lt-07"), job_of("lt-07")));
  const auto cell = test::small_cell("cell-7");
  ASSERT_TRUE(store->add_model("cell-7", test::nominal_model(cell, 1), 0, true, "made"));
  store->wait_for_change({}, std::chrono::milliseconds(1));  // it listens
  ASSERT_TRUE(store->tell_presence(ServerSelf::here("0.1.0", true, true)));
  const std::string lines = server().sql(
      server().url(database_),
      "SELECT DISTINCT ssl, version, client_dn FROM pg_stat_ssl JOIN pg_stat_activity USING (pid) "
      "WHERE application_name = 'trammel' AND datname = current_database()");
  EXPECT_EQ(lines, "t|TLSv1.3|/CN=keeper\n") << "each connection";
  EXPECT_FALSE(demand(read_audit(url, {})).broken);
}

TEST_F(Certificates, WhoIsNotWhoHeShouldBeIsRefusedWithWhatIsWrong) {
  const std::string url = server().certified_url(database_), files = server().certificates();
  expect_refused(with(url, "/ca.crt", "/other-ca.crt"), "certificate verify failed");
  expect_refused(with(url, "localhost", "127.0.0.1"), "does not match host name");
  expect_refused(with(url, "keeper@", "another@"), "certificate authentication failed");
  expect_refused(with(with(url, "&sslcert=" + files + "/keeper.crt", ""),
                      "&sslkey=" + files + "/keeper.key", ""),
                 "certificate");
  expect_refused(with(url, "keeper.key", "missing.key"), "private key");
  expect_refused(with(url, "/ca.crt", "/missing.crt"), "certificate file");
  expect_refused(with(url, "sslmode=verify-full", "sslmode=disable"), "no pg_hba.conf entry");
}

TEST_F(Certificates, WhatOpensAKeyIsNeverInWords) {
  const std::string url =
      with(server().certified_url(database_), "keeper.key", "missing.key") + "&sslpassword=s3cret";
  const auto refused = Store::open(with(url, "keeper@", "keeper:pa55word@"), folder_.file("none"));
  ASSERT_FALSE(refused);
  for (const char* secret : {"s3cret", "pa55word"})
    EXPECT_EQ(sentence(refused.error()).find(secret), std::string::npos)
        << sentence(refused.error());
}

TEST_F(Certificates, ADatabaseThatWasAwayIsComeBackToByTheSameWay) {
  const auto store = demand(Store::open(server().certified_url(database_), folder_.file("cache")));
  server().stop();
  const auto refused = store->add_batch(batch_of("lt-07"), job_of("lt-07"));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kBusy);
  server().start();
  ASSERT_TRUE(store->wait_until_writable({}));
  EXPECT_TRUE(store->add_batch(batch_of("lt-07"), job_of("lt-07")));
}

}  // namespace
}  // namespace trammel
