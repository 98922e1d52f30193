#pragma once

#include <memory>

#include "server/base/result.h"
#include "server/http/exchange.h"
#include "server/http/http_options.h"
#include "server/http/watched.h"

namespace trammel {

/// Answers requests below `/api`. README.md says who may ask.
struct HttpApi {
  std::size_t largest_body = 0;  ///< bytes
  HttpAdmission admission = {};  ///< before a body is read
  HttpHandler answer = {};       ///< may wait for the service
};

/// Shows the state of a server over HTTP: metrics for Prometheus, health and readiness, and pages
/// for people; and hands requests to an HttpApi. Changes nothing itself, and works in threads of
/// its own, of low priority and of a fixed number. README.md has the addresses. Thread-safe.
class HttpServer {
 public:
  /// The parts that `server` refers to outlive it.
  HttpServer(HttpOptions options, Watched server, HttpApi api = {});
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

/// Checks that the server could listen now. Refuses an address that leaves this host without
/// `allow_network`, tokens and TLS, files of these that cannot be used, and an occupied port.
[[nodiscard]] Status check_http_options(const HttpOptions& options);

}  // namespace trammel
