#pragma once

#include <fastdds/rtps/common/Locator.h>
#include <fastdds/rtps/transport/TransportDescriptorInterface.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "idl/repairs/guard/dropped.h"
#include "idl/repairs/guard/proof.h"
#include "server/base/mutex.h"

/// Keeps DDS domains apart. Discovery here uses a fixed port in every domain, and Fast DDS 2.9 does
/// not check the domain of an announcement. So this gate, a transport below the library, reads the
/// domain in each announcement and drops those of other domains. The library ignores participants
/// that it has not discovered.
namespace trammel::wire {

struct Relay;  // guard/relay.h

/// The user data of our participants: `trammel.domain=5`. Other participants may send it too. Most
/// DDS libraries, Cyclone among them, send the standard parameter PID_DOMAIN_ID instead; Fast
/// DDS 2.9 does not.
[[nodiscard]] std::string domain_mark(std::uint32_t domain);

/// True if an RTPS message holds the announcement of a participant of another domain. Never reads
/// beyond `message`, also when it is malformed.
[[nodiscard]] bool is_of_another_domain(std::span<const unsigned char> message,
                                        std::uint32_t domain);

/// True if it holds a participant's announcement at all.
[[nodiscard]] bool is_announcement(std::span<const unsigned char> message);

/// The messages that a participant that is its own peer receives from itself. They prove that the
/// threads of the library run.
struct HeardOfItself {
  std::atomic<std::uint64_t> announcements{0};  ///< received and processed
  /// Entity id of one of its reliable writers, first octet highest; 0: none. The gate drops the
  /// first copy of each sample of this writer that comes back to the participant, at most twice a
  /// second. Such a sample arrives only if the resending thread runs.
  std::atomic<std::uint32_t> first_lost_of{0};
};

/// Tells if the library hears already. A participant announces itself while it is being made, and
/// the library drops what is answered before that is done: of the handshake of certificates the
/// next attempt comes a second later. Thread-safe.
class Hearing {
 public:
  void begins() {
    {
      const MutexLock lock(mutex_);
      begun_ = true;
    }
    changed_.notify_all();
  }
  /// Until it does, kLongest at most.
  void wait() {
    MutexLock lock(mutex_);
    changed_.wait_until(lock, std::chrono::steady_clock::now() + kLongest,
                        [this]() TRAMMEL_REQUIRES(mutex_) { return begun_; });
  }

 private:
  static constexpr std::chrono::seconds kLongest{2};
  Mutex mutex_;
  Condition changed_;
  bool begun_ TRAMMEL_GUARDED_BY(mutex_) = false;
};

struct GateOptions {
  std::uint32_t domain = 0;
  std::shared_ptr<HeardOfItself> heard = {};  ///< may be null
  std::shared_ptr<DropCounts> dropped =
      {};  ///< null: there is no guard. For tests that show what it is for
  std::uint32_t largest_sent =
      UINT32_MAX;              ///< bytes of a datagram; others may send what `below` takes
  Proof proof = Proof::kNone;  ///< what participants prove
  bool serves = false;         ///< others are clients: they have few endpoints
  std::shared_ptr<Hearing> hearing = {};  ///< what comes waits for it; null: it does not
  /// Where others are looked for: they are sent what they are sent, whoever else names them.
  std::vector<eprosima::fastrtps::rtps::Locator_t> hosts = {};
};

/// The transport `below` with the gate in front, and before it the guard (guard/guard.h), which
/// counts in `dropped`.
[[nodiscard]] std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface>
with_domain_gate(std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> below,
                 const GateOptions& options);

/// `below` with a guard in front that lets `relays` announce others, of any domain.
[[nodiscard]] std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface>
with_relay_guard(std::shared_ptr<eprosima::fastdds::rtps::TransportDescriptorInterface> below,
                 std::vector<Relay> relays);

}  // namespace trammel::wire
