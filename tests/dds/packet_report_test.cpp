#include "server/dds/packet_report.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

namespace trammel {
namespace {

TEST(PacketReport, SaysWhatWasDroppedOnceAMinute) {
  const auto counts = std::make_shared<wire::DropCounts>();
  PacketReport report(counts);
  const PacketReport::Time begin{};
  EXPECT_FALSE(report.due(begin)) << "nothing";
  counts->add(wire::Dropped::kStatistics);
  counts->add(wire::Dropped::kStatistics);
  counts->add(wire::Dropped::kSkipped);
  EXPECT_EQ(report.due(begin),
            "packets were dropped unread: statistics submessage (2), numbers skipped (1)");
  counts->add(wire::Dropped::kHeader);
  EXPECT_FALSE(report.due(begin + std::chrono::seconds(59)));
  EXPECT_EQ(report.due(begin + std::chrono::seconds(60)),
            "packets were dropped unread: no RTPS message (1)");
  EXPECT_FALSE(report.due(begin + std::chrono::seconds(200)));
}

TEST(StrangerReport, SaysWhoWasRefusedOnceAMinute) {
  StrangerReport report;
  const PacketReport::Time begin{};
  EXPECT_TRUE(report.due(begin).empty()) << "nobody";
  report.refused("says it is CN=anna", "01.02");
  ASSERT_EQ(report.due(begin).size(), 1u);
  report.refused("says it is CN=bob", "03.04");
  report.refused("says it is CN=anna", "01.02");
  report.refused("says it is CN=anna", "01.05");
  EXPECT_TRUE(report.due(begin + std::chrono::seconds(59)).empty());
  const std::vector<std::string> told = report.due(begin + std::chrono::seconds(60));
  ASSERT_EQ(told.size(), 2u);
  EXPECT_NE(told[0].find("CN=anna (2 tries, the last of 01.05)"), std::string::npos) << told[0];
  EXPECT_NE(told[1].find("CN=bob (1 try, the last of 03.04)"), std::string::npos) << told[1];
  EXPECT_EQ(report.tries(), 4u);
}

TEST(StrangerReport, ManyStrangersDoNotFillTheLog) {
  StrangerReport report;
  for (int i = 0; i < 1000; ++i) report.refused(fmt::format("says it is CN=name-{}", i), "01.02");
  const std::vector<std::string> told = report.due({});
  ASSERT_EQ(told.size(), StrangerReport::kTold + 1);
  EXPECT_NE(told.front().find(fmt::format("others ({} tries", 1000 - StrangerReport::kTold)),
            std::string::npos)
      << told.front();
}

}  // namespace
}  // namespace trammel
