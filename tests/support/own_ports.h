#pragma once

#include <cstdint>

namespace trammel::test {

/// The number of consecutive ports of a test process.
inline constexpr int kOwnPorts = 8;

/// The first of kOwnPorts ports on 127.0.0.1 that no other test process has while this one lives,
/// and on which nothing listens. They are above the ports that DDS derives from own_domain(), and
/// below those that the kernel assigns.
[[nodiscard]] std::uint16_t own_ports();
/// A DDS domain that belongs to the ports: seldom another test's at the same time.
[[nodiscard]] std::uint32_t own_domain();

}  // namespace trammel::test
