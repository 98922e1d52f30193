#pragma once

#include <cstdint>

namespace trammel::test {

/// How many ports in a row a test process has for itself.
inline constexpr int kOwnPorts = 8;

/// The first of kOwnPorts ports on 127.0.0.1 that no other test process has while this one lives,
/// and that nothing listens on. Above the ports that DDS derives from own_domain(), below those
/// that the kernel hands out.
[[nodiscard]] std::uint16_t own_ports();
/// A DDS domain that goes with the ports: seldom another test's at the same time.
[[nodiscard]] std::uint32_t own_domain();

}  // namespace trammel::test
