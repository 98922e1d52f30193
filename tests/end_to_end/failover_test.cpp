// A PostgreSQL that fails over by itself, under two servers that go on. The longer series, with
// hosts that are frozen and cut off, is tests/benchmarks/failover_benchmark.cpp.
#include <gtest/gtest.h>

#include "tests/support/failing_over.h"

namespace trammel {
namespace {

constexpr std::chrono::seconds kFailoverLimit{180};

TEST(Failover, WhenTheHostOfThePrimaryIsKilledChangesGoOnAndNothingAcknowledgedIsLost) {
  test::FailingOver fleet;
  ASSERT_EQ(fleet.why_not(), "");
  const auto doctor =
      test::run({TRAMMEL_BINARY_DIR "/clients/trammel", "doctor", "--port",
                 std::to_string(fleet.first->port()), "--domain",
                 std::to_string(fleet.first->domain()), "--store", fleet.url, "--json", "-"});
  EXPECT_NE(doctor.out.find("an acknowledged change survives the loss of one host of three"),
            std::string::npos)
      << doctor.out << doctor.err;
  EXPECT_NE(fleet.first->process().standard_error().find("survives the loss of one host of three"),
            std::string::npos);
  test::ChangeLoad load(fleet.session_options(), 2);
  ASSERT_TRUE(load.wait_for_everybody(kFailoverLimit));
  ASSERT_TRUE(fleet.record.wait_until_whole()) << "no host may take over before it has everything";
  const int killed = fleet.record.primary();
  ASSERT_GT(killed, 0);
  fleet.record.act("kill", killed);
  EXPECT_TRUE(load.wait_for_everybody(kFailoverLimit)) << "changes are taken again";
  load.stop();
  EXPECT_NE(fleet.record.primary(), killed);
  EXPECT_EQ(fleet.lost(load), std::set<std::string>())
      << "of " << load.acknowledged() << " that were acknowledged";
  EXPECT_EQ(fleet.twice(), "");
  EXPECT_LT(fleet.until_served_elsewhere_s(), 2) << "all hear of the new primary's changes";
}

}  // namespace
}  // namespace trammel
