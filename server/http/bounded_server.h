#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/http/exchange.h"
#include "server/http/tls.h"

namespace trammel {

/// Requests that send something: below one first word, by workers of their own.
struct HttpPosts {
  std::string word;                           ///< of their paths: `api`
  std::size_t workers = 16;                   ///< they wait for the service, which computes
  std::size_t body = std::size_t{1} << 20;    ///< bytes that one may send
  std::chrono::milliseconds reading{30'000};  ///< for a request from its first byte to its last
  HttpAdmission admission;                    ///< is asked before a body is read
};

struct HttpLimits {
  std::size_t workers = 4;
  std::size_t waiting = 32;                 ///< requests; one more is answered 503 at once
  std::chrono::milliseconds reading{2000};  ///< for a request from its first byte to its last
  std::chrono::milliseconds writing{5000};  ///< for a reply
  std::vector<std::string> apart =
      {};  ///< first words of paths that have a worker of their own each
  std::optional<HttpPosts> posts = {};  ///< empty: nothing can be sent
  TlsContext tls = nullptr;             ///< null: without TLS
  bool stays_here = true;               ///< false: other hosts may ask
};

/// A server of HTTP/1.1 for GET and HEAD, and for POST below one word. Below that word a connection
/// may have one request after the other, without TLS; elsewhere it has one.
/// It has a fixed number of threads of low priority, bounded queues, and a time limit for each
/// request. A client that sends slowly holds up nobody. A client that reads slowly holds up only
/// other readers that share its workers. Neither affects the rest of the process. Where only this
/// host may ask, it answers to names of this host only, so that no foreign page can send requests
/// through a browser (DNS rebinding). With TLS all requests share the workers of HttpPosts: what
/// one asks for is known only after the handshake.
class BoundedServer {
 public:
  /// Listens until it is destroyed. `handler` is called in its threads. Refuses (kUsage) an address
  /// that leaves this host, though `stays_here`, or that this host does not have, and (kConflict)
  /// an occupied port.
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
[[nodiscard]] Status check_http_address(const std::string& address, std::uint16_t port,
                                        bool stays_here = true);

}  // namespace trammel
