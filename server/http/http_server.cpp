#include "server/http/http_server.h"

#include <atomic>
#include <nlohmann/json.hpp>
#include <utility>

#include "server/http/bounded_server.h"
#include "server/http/metrics.h"
#include "server/http/pages.h"
#include "server/http/readiness.h"

namespace trammel {
namespace {

constexpr const char* kJson = "application/json";
constexpr const char* kMetricsType = "text/plain; version=0.0.4; charset=utf-8";

HttpReply json_reply(int code, const nlohmann::ordered_json& json) {
  return {code, kJson,
          json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n"};
}

std::string option(const HttpAsk& ask, const std::string& name) {
  const auto found = ask.options.find(name);
  return found == ask.options.end() ? "" : found->second;
}

}  // namespace

class HttpServer::Running {
 public:
  Running(HttpOptions options, Watched server)
      : options_(std::move(options)),
        server_(std::move(server)),
        metrics_(server_),
        pages_(server_) {}

  Status start() {
    if (options_.port == 0) return {};
    HttpLimits limits;
    limits.apart = {"healthz", "readyz", "metrics"};  // a reader of pages holds up no supervisor
    auto listening = BoundedServer::start(options_.address, options_.port, limits,
                                          [this](const HttpAsk& ask) { return answer(ask); });
    if (!listening) return Failure(listening.error()).under("http");
    listening_ = std::move(*listening);
    listens_ = listening_.get();
    return {};
  }

  void set_phase(ServerPhase phase) { phase_ = phase; }
  void job_changed(const JobProgress& job) { metrics_.job_changed(job); }

 private:
  HttpReply answer(const HttpAsk& ask) {
    const ServerPhase phase = phase_;
    if (ask.path.size() != 1) return pages_.answer(ask, phase);
    if (ask.path[0] == "healthz") return health();
    if (ask.path[0] == "metrics") {
      const BoundedServer* listens = listens_;
      return {200, kMetricsType, metrics_.text(phase, listens == nullptr ? 0 : listens->shed())};
    }
    if (ask.path[0] == "readyz") {
      const Readiness now = readiness(server_, phase, option(ask, "cell"));
      return json_reply(now.ready ? 200 : 503, now.told);
    }
    return pages_.answer(ask, phase);
  }

  HttpReply health() const {
    if (phase_ != ServerPhase::kServing)
      return json_reply(200, {{"healthy", true}, {"still", nlohmann::ordered_json::array()}});
    const Movement movement = server_.movement();
    const bool healthy = movement.still.empty();
    return json_reply(healthy ? 200 : 503, {{"healthy", healthy}, {"still", movement.still}});
  }

  const HttpOptions options_;
  const Watched server_;
  std::atomic<ServerPhase> phase_{ServerPhase::kStarting};
  Metrics metrics_;
  Pages pages_;
  std::atomic<const BoundedServer*> listens_{nullptr};
  std::unique_ptr<BoundedServer> listening_;  // its threads use all of the above
};

HttpServer::HttpServer(HttpOptions options, Watched server)
    : running_(std::make_unique<Running>(std::move(options), std::move(server))) {}

HttpServer::~HttpServer() = default;

Status HttpServer::start() { return running_->start(); }

void HttpServer::set_phase(ServerPhase phase) { running_->set_phase(phase); }

void HttpServer::job_changed(const JobProgress& job) { running_->job_changed(job); }

Status check_http_options(const HttpOptions& options) {
  return options.port == 0 ? Status() : check_http_address(options.address, options.port);
}

}  // namespace trammel
