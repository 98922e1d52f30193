#pragma once

#include <memory>

#include "server/base/result.h"
#include "server/http/http_options.h"
#include "server/http/watched.h"

namespace trammel {

/// Shows the state of a server over HTTP, to this host only: metrics for Prometheus, health and
/// readiness, and pages for people. Changes nothing, and works in threads of its own, of low
/// priority and of a fixed number. README.md has the addresses. Thread-safe.
class HttpServer {
 public:
  /// The parts that `server` refers to outlive it.
  HttpServer(HttpOptions options, Watched server);
  ~HttpServer();  ///< stops listening
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  /// Listens if a port is set. Until the phase is kServing it reports that the server is starting.
  [[nodiscard]] Status start();
  void set_phase(ServerPhase phase);
  /// Counts the outcomes of jobs.
  void job_changed(const JobProgress& job);

 private:
  class Running;
  const std::unique_ptr<Running> running_;
};

/// Checks that the server could listen now. Refuses an address that leaves this host, and an
/// occupied port.
[[nodiscard]] Status check_http_options(const HttpOptions& options);

}  // namespace trammel
