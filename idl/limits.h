#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>

/// Ports, times and limits of the wire that server and clients share. The types are in the IDL files, the topics in
/// topics.h.
namespace trammel::wire {

/// UDP port of the first server on a host; replicas take every second one after it.
inline constexpr std::uint16_t kFirstPort = 17500;

/// Equal on both sides, because unequal leases delay discovery.
inline constexpr std::chrono::milliseconds kLease{2000};
inline constexpr std::chrono::milliseconds kAnnouncement{200};
/// A server whose status is older than this hangs.
inline constexpr std::chrono::milliseconds kStatusPeriod{1000};
inline constexpr std::chrono::milliseconds kStatusLost{3500};

/// Largest serialized samples, bytes; larger ones are dropped unread. A hostile length field can make a reader reserve
/// about a hundred times the sample for structures, hence the closer limit for them.
inline constexpr std::size_t kMaxComputeSample = 4u << 20;  ///< requests and replies of targets
inline constexpr std::size_t kMaxTextSample = 32u << 20;    ///< batches and models
inline constexpr std::size_t kMaxStateSample = 1u << 20;

/// Requests that a server keeps waiting for each operation, and replies for each client and operation: a client has at
/// most as many requests unanswered.
inline constexpr int kRequestDepth = 512;
inline constexpr int kReplyDepth = 64;

/// What a session puts into one request of those it may: so that other clients have their turn in between.
inline constexpr std::size_t kTargetsPerRequest = 2000;

}  // namespace trammel::wire
