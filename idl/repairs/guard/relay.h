#pragma once

#include <array>
#include <cstdint>

#include "idl/repairs/guard/rtps_bytes.h"

namespace trammel::wire {

/// A discovery server: it passes on, in its own name, what others announce. Only a participant that
/// asks it has any.
struct Relay {
  std::array<unsigned char, kPrefix> prefix{};
  std::uint32_t address = 0;  ///< IPv4 that it sends from, first octet the highest
};

}  // namespace trammel::wire
