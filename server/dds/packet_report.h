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

/// Counts the participants that DDS-Security refused (without a certificate, with one of another
/// authority, or with a revoked one) and names them, at most once a minute. Not thread-safe.
class StrangerReport {
 public:
  /// More participants than this in a minute are reported in sum.
  static constexpr std::size_t kTold = 16;

  /// `who`: the name that it gives itself. A participant tries repeatedly, under one GUID.
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
      strangers_;  // since the last report, by the names that they give themselves
  std::optional<PacketReport::Time> told_at_;
};

}  // namespace trammel
