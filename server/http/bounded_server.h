#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/http/exchange.h"

namespace trammel {

struct HttpLimits {
  std::size_t workers = 4;
  std::size_t waiting = 32;                 ///< requests; one more is answered 503 at once
  std::chrono::milliseconds reading{2000};  ///< for a request from its first byte to its last
  std::chrono::milliseconds writing{5000};  ///< for a reply
  std::vector<std::string> apart =
      {};  ///< first words of paths that have a worker of their own each
};

/// A server of HTTP/1.1 for GET and HEAD, one request per connection. It has a fixed number of
/// threads of low priority, bounded queues, and a time limit for each request. A client that sends
/// slowly holds up nobody. A client that reads slowly holds up only other readers that share its
/// workers. Neither affects the rest of the process. It answers to names of this host only, so that
/// no foreign page can send requests through a browser (DNS rebinding).
class BoundedServer {
 public:
  /// Listens until it is destroyed. `handler` is called in its threads. Refuses (kUsage) an address
  /// that is not 127.x.x.x or that this host does not have, and (kConflict) an occupied port.
  [[nodiscard]] static Result<std::unique_ptr<BoundedServer>> start(const std::string& address,
                                                                    std::uint16_t port,
                                                                    const HttpLimits& limits,
                                                                    HttpHandler handler);
  ~BoundedServer();
  BoundedServer(const BoundedServer&) = delete;
  BoundedServer& operator=(const BoundedServer&) = delete;

  /// Connections that were answered 503 because too many waited.
  [[nodiscard]] std::uint64_t shed() const;

 private:
  class Running;
  explicit BoundedServer(std::unique_ptr<Running> running);
  std::unique_ptr<Running> running_;
};

/// Checks that the address and the port could be listened on now. Refuses as
/// BoundedServer::start().
[[nodiscard]] Status check_http_address(const std::string& address, std::uint16_t port);

}  // namespace trammel
