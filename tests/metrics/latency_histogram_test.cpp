#include "server/metrics/latency_histogram.h"

#include <gtest/gtest.h>

#include <numeric>
#include <thread>
#include <vector>

#include "server/metrics/operation_counts.h"

namespace trammel {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

TEST(LatencyHistogram, CountsInTheClassWhoseBoundIsNotExceeded) {
  LatencyHistogram histogram;
  histogram.add(microseconds(100));  // the first bound itself
  histogram.add(microseconds(101));
  histogram.add(milliseconds(9));
  histogram.add(std::chrono::seconds(11));
  const auto counts = histogram.counts();
  EXPECT_EQ(counts.in_class[0], 1u);
  EXPECT_EQ(counts.in_class[1], 1u);
  EXPECT_EQ(counts.in_class[6], 1u) << "up to 10 ms";
  EXPECT_EQ(counts.in_class.back(), 1u) << "above all bounds";
  EXPECT_NEAR(counts.sum, 11.009201, 1e-9);
}

TEST(LatencyHistogram, LosesNothingWhereManyThreadsCount) {
  LatencyHistogram histogram;
  OperationCounts operation;
  std::vector<std::jthread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      for (int k = 0; k < 10000; ++k) {
        histogram.add(microseconds(k));
        operation.answered(static_cast<std::size_t>(k % 2), 1);
      }
    });
  }
  threads.clear();
  const auto counts = histogram.counts();
  EXPECT_EQ(std::accumulate(counts.in_class.begin(), counts.in_class.end(), std::uint64_t{0}),
            40000u);
  EXPECT_EQ(operation.of_result(0), 20000u);
  EXPECT_EQ(operation.of_result(1), 20000u);
}

TEST(OperationCounts, ACodeThatNobodyKnowsYetIsCountedAsTheLast) {
  OperationCounts operation;
  operation.answered(999, 2);
  EXPECT_EQ(operation.of_result(OperationCounts::kResults - 1), 2u);
}

}  // namespace
}  // namespace trammel
