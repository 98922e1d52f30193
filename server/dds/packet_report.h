#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "idl/guard/dropped.h"
#include "server/dds/service_events.h"

namespace trammel {

/// Says which packets the guard has dropped, at most once a minute. Not thread-safe.
class PacketReport {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::seconds kAtMostEvery{60};

  explicit PacketReport(std::shared_ptr<const wire::DropCounts> counts) : counts_(std::move(counts)) {}

  /// What is new since the last report, by reason; empty when nothing is, or when the last report is too young.
  [[nodiscard]] std::optional<std::string> due(Time now);

 private:
  std::shared_ptr<const wire::DropCounts> counts_;
  std::array<std::uint64_t, wire::kDroppedReasons> told_{};
  std::optional<Time> told_at_;
};

/// Says how many participants were refused, at most once a minute. Not thread-safe.
class StrangerReport {
 public:
  /// What is new since the last report; empty when nothing is, or when the last report is too young.
  [[nodiscard]] std::optional<std::string> due(const Strangers& strangers, PacketReport::Time now);

 private:
  std::uint64_t told_ = 0;
  std::optional<PacketReport::Time> told_at_;
};

}  // namespace trammel
