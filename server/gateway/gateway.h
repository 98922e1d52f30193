#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <string>

#include "server/base/mutex.h"
#include "server/dds/gateway/service_calls.h"
#include "server/http/http_server.h"
#include "server/registry/model_registry.h"

namespace trammel {

/// Calls `work` with the service's calls; false: the service does not run.
using WithCalls = std::function<bool(const std::function<void(ServiceCalls&)>& work)>;

/// Requests as JSON over HTTP, below `/api/v1`. It translates and asks the service; what a request
/// may do, how long it waits and when it is refused is decided there. Thread-safe.
class Gateway {
 public:
  /// `registry` and what `calls` refers to outlive it. `version`: of this software.
  Gateway(const ModelRegistry& registry, WithCalls calls, std::string version);

  /// For the HTTP server; this gateway outlives it.
  [[nodiscard]] HttpApi api();
  /// Refuses an unknown address, another method, and who may not ask.
  [[nodiscard]] std::optional<HttpReply> admitted(const HttpAsk& ask) const;
  [[nodiscard]] HttpReply answer(const HttpAsk& ask);

 private:
  /// One client may have so many requests under way, so that others find a worker.
  static constexpr std::size_t kOfOneClient = 8;

  [[nodiscard]] bool enter(const std::string& client);
  void leave(const std::string& client);

  const ModelRegistry& registry_;
  const WithCalls calls_;
  const std::string version_;
  Mutex mutex_;
  std::map<std::string, std::size_t> under_way_ TRAMMEL_GUARDED_BY(mutex_);  // by client
};

}  // namespace trammel
