#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "idl/repairs/guard/dropped.h"
#include "idl/repairs/guard/guard_memory.h"
#include "idl/repairs/guard/proof.h"
#include "idl/repairs/guard/relay.h"
#include "idl/repairs/guard/rtps_bytes.h"

namespace trammel::wire {

/// Stands before the library's receiver: drops what would end, stop or flood it, and passes
/// everything that an honest participant sends, secured or not. README.md says what is dropped and
/// why. Reads hostile bytes: it never reads beyond a message, allocates nothing but for an endpoint
/// that is new, and throws nothing. Thread-safe; it takes its one lock only for messages whose
/// sender it must remember.
class Guard {
 public:
  using Time = std::chrono::steady_clock::time_point;

  /// `largest_sample`: bytes that a sample of any topic may have.
  /// `relays` may announce others.
  /// `proof`: what is said without the proof that all give sends none of them away and skips
  /// nothing of theirs. `most_endpoints`: of one participant.
  explicit Guard(std::uint32_t largest_sample, std::shared_ptr<DropCounts> counts = nullptr,
                 std::vector<Relay> relays = {}, Proof proof = Proof::kNone,
                 std::size_t most_endpoints = EndpointWatch::kMostOfServer);

  /// The part of a message received from `socket` (address and port) that the library may see: all
  /// of it, as a rule. Empty: nothing. Valid until the calling thread's next call.
  [[nodiscard]] std::optional<Bytes> check(Bytes message, std::uint64_t socket,
                                           Time now = std::chrono::steady_clock::now());
  /// A message of our own that leaves.
  void sent(Bytes message);
  /// If false, lets_out() is true of every socket.
  [[nodiscard]] bool knows_strangers() const { return memory_.knows_strangers; }
  /// If true, a datagram may leave for that socket. One that only strangers name gets a few.
  [[nodiscard]] bool lets_out(std::uint64_t socket, Time now = std::chrono::steady_clock::now());

  [[nodiscard]] const DropCounts& counts() const { return *counts_; }

 private:
  [[nodiscard]] bool is_of_relay(Bytes message, std::uint64_t socket) const;
  void confirm(Bytes to, const Submessage& acknack);

  const std::uint32_t largest_sample_;
  const std::shared_ptr<DropCounts> counts_;
  const std::vector<Relay> relays_;
  const Proof proof_;
  std::atomic<bool> knows_own_{false};
  GuardMemory memory_;
};

}  // namespace trammel::wire
