#pragma once

#include <memory>

#include "server/base/result.h"
#include "server/http/http_options.h"
#include "server/http/watched.h"

namespace trammel {

/// Shows what a server does to those who watch it, over HTTP and to this host only: metrics for
/// Prometheus, whether it is well and ready, and pages for people. Changes nothing, and works in
/// threads of its own, of low priority and of a fixed number. README.md has the addresses.
/// Thread-safe.
class HttpServer {
 public:
  /// The parts that `server` refers to outlive it.
  HttpServer(HttpOptions options, Watched server);
  ~HttpServer();  ///< stops listening
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  /// Listens, where a port is named. From now until the phase is kServing it says that the server
  /// is starting.
  [[nodiscard]] Status start();
  void set_phase(ServerPhase phase);
  /// For counting what becomes of jobs.
  void job_changed(const JobProgress& job);

 private:
  class Running;
  const std::unique_ptr<Running> running_;
};

/// Checks that the server could listen now. Refuses an address that leaves this host and a port
/// that is taken.
[[nodiscard]] Status check_http_options(const HttpOptions& options);

}  // namespace trammel
