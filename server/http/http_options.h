#pragma once

#include <cstdint>
#include <string>

namespace trammel {

/// Where pages and metrics are served.
struct HttpOptions {
  std::string address = "127.0.0.1";  ///< of this host alone: 127.x.x.x
  std::uint16_t port = 0;             ///< TCP; 0: nothing is served
};

}  // namespace trammel
