#pragma once

#include <cstdint>
#include <string>

namespace trammel {

/// The address of pages, metrics and requests over HTTP.
struct HttpOptions {
  std::string address = "127.0.0.1";  ///< 127.x.x.x, unless tokens and TLS guard another one
  std::uint16_t port = 0;             ///< TCP; 0: nothing is served
  bool api = false;                   ///< true: requests are answered, too (server/gateway)
  bool allow_network = false;         ///< true: `address` may be one that other hosts reach
  std::string tokens = {};  ///< file of tokens.h; empty: everybody on this host is believed
  std::string certificate = {}, key = {};  ///< PEM files for TLS; empty: none

  [[nodiscard]] bool has_tls() const { return !certificate.empty(); }
  [[nodiscard]] bool stays_here() const { return address.starts_with("127."); }
};

}  // namespace trammel
