#pragma once

#include <cstdint>
#include <string>

namespace trammel {

/// The address of pages and metrics.
struct HttpOptions {
  std::string address = "127.0.0.1";  ///< an address of this host only: 127.x.x.x
  std::uint16_t port = 0;             ///< TCP; 0: nothing is served
};

}  // namespace trammel
