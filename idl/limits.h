#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>

/// Ports, times and limits of the wire that server and clients share. The types are in the IDL
/// files, the topics in topics.h.
namespace trammel::wire {

/// UDP port of the first server on a host; others take every second one after it.
inline constexpr std::uint16_t kFirstPort = 17500;

/// Equal for servers and clients: unequal leases delay discovery.
inline constexpr std::chrono::milliseconds kLease{2000};
inline constexpr std::chrono::milliseconds kAnnouncement{200};
/// A server whose status is older than this hangs.
inline constexpr std::chrono::milliseconds kStatusPeriod{1000};
inline constexpr std::chrono::milliseconds kStatusLost{3500};

/// Largest serialized samples, bytes.
inline constexpr std::size_t kMaxComputeSample = 8u << 20;  ///< requests and replies of targets
inline constexpr std::size_t kMaxTextSample = 32u << 20;    ///< batches, models, findings
inline constexpr std::size_t kMaxStateSample = 1u << 20;
/// Largest text of a file in a sample, bytes: the rest is for everything else.
inline constexpr std::size_t kMaxText = kMaxTextSample - 65536;

/// kRequestDepth requests wait at a server for each operation. kReplyDepth replies are kept for
/// each client and operation: a client may have at most as many requests unanswered.
inline constexpr int kRequestDepth = 512;
inline constexpr int kReplyDepth = 64;

/// A session puts fewer targets into one request than it may, so that the requests of other clients
/// come in between.
inline constexpr std::size_t kTargetsPerRequest = 2000;

}  // namespace trammel::wire
