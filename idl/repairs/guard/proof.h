#pragma once

#include <cstdint>

namespace trammel::wire {

/// The facts that participants prove by DDS-Security.
enum class Proof : std::uint8_t {
  kNone,
  kOfIdentity,  ///< who they are, and what they say of endpoints
  kOfMessages   ///< also that each message is theirs
};

}  // namespace trammel::wire
