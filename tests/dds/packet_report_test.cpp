#include "server/dds/packet_report.h"

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
  EXPECT_EQ(report.due(begin), "packets were dropped unread: statistics submessage (2), numbers skipped (1)");
  counts->add(wire::Dropped::kHeader);
  EXPECT_FALSE(report.due(begin + std::chrono::seconds(59)));
  EXPECT_EQ(report.due(begin + std::chrono::seconds(60)), "packets were dropped unread: no RTPS message (1)");
  EXPECT_FALSE(report.due(begin + std::chrono::seconds(200)));
}

}  // namespace
}  // namespace trammel
