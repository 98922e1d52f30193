#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "idl/transport/participant.h"
#include "server/base/host_port.h"
#include "server/base/mutex.h"
#include "server/base/result.h"

/// Where servers are, as discovery servers (Fast DDS's own `fast-discovery-server`) tell it. They
/// tell nothing else: who knows a place goes there with its usual participant. A place is a hint of
/// whoever said it.
namespace trammel::wire {

inline constexpr std::size_t kMostPlaces = 64;  ///< that one look takes
/// After the first place is found: so long the look goes on for others.
inline constexpr std::chrono::milliseconds kOtherPlaces{500};

/// A server of one domain.
struct Place {
  HostPort at;
  std::uint32_t domain = 0;
  std::string server_id;
  bool operator==(const Place&) const = default;
};
/// As it travels in user data: `trammel.server=10.1.0.3:17500;domain=0;id=line-3`.
[[nodiscard]] std::string place_text(const Place& place);
/// Empty: not exactly such a text, or a place where no server can be. Looks up no name.
[[nodiscard]] std::optional<Place> read_place(std::string_view text);

/// The places of one domain, each once, as they are heard. Thread-safe.
class FoundPlaces {
 public:
  /// `far`: places on 127.x are those of another host.
  FoundPlaces(std::uint32_t domain, bool far) : domain_(domain), far_(far) {}

  /// User data of anybody.
  void heard(std::string_view user_data);
  /// Once kOtherPlaces have passed since the first one, or after `limit`.
  [[nodiscard]] std::vector<HostPort> wait(std::chrono::milliseconds limit);

 private:
  const std::uint32_t domain_;
  const bool far_;
  Mutex mutex_;
  Condition changed_;
  std::vector<HostPort> places_ TRAMMEL_GUARDED_BY(mutex_);
};

/// Tells the discovery servers of a place, from its own address, as long as what it returns lives.
/// The number of a discovery server is its position: `fast-discovery-server -i 0` is the first.
/// Waits for none of them.
[[nodiscard]] Result<ParticipantPtr> announce_place(const Place& place,
                                                    const std::vector<HostPort>& discovery_servers);

/// Asks them, from the address of this host that leads to the first. kUnreachable: none told of a
/// server of `domain`.
[[nodiscard]] Result<std::vector<HostPort>> look_for_places(
    const std::vector<HostPort>& discovery_servers, std::uint32_t domain,
    std::chrono::milliseconds limit);

}  // namespace trammel::wire
