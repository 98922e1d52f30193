#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "idl/repairs/guard/dropped.h"

namespace trammel {

/// Says which packets the guard has dropped, at most once a minute. Not thread-safe.
class PacketReport {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::seconds kAtMostEvery{60};

  explicit PacketReport(std::shared_ptr<const wire::DropCounts> counts)
      : counts_(std::move(counts)) {}

  /// The news since the last report, by reason; empty when there are none, or when the last report
  /// is too young.
  [[nodiscard]] std::optional<std::string> due(Time now);

 private:
  std::shared_ptr<const wire::DropCounts> counts_;
  std::array<std::uint64_t, wire::kDroppedReasons> told_{};
  std::optional<Time> told_at_;
};

/// Counts the participants that DDS-Security refused (no certificate, one of another authority, one
/// that was revoked) and says who they were, at most once a minute. Not thread-safe.
class StrangerReport {
 public:
  /// More than these in a minute are told as one.
  static constexpr std::size_t kTold = 16;

  /// `who`: what it says of itself. A participant tries again and again, under one GUID.
  void refused(const std::string& who, const std::string& guid);
  /// One sentence for each who was refused since the last report; empty where the last report is
  /// too young.
  [[nodiscard]] std::vector<std::string> due(PacketReport::Time now);
  [[nodiscard]] std::uint64_t tries() const { return tries_; }

 private:
  struct Stranger {
    std::uint64_t tries = 0;
    std::string guid = {};
  };
  std::uint64_t tries_ = 0;
  std::map<std::string, Stranger>
      strangers_;  // since the last report, by what they say of themselves
  std::optional<PacketReport::Time> told_at_;
};

}  // namespace trammel
