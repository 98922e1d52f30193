#include "server/http/http_server.h"

#include <algorithm>
#include <atomic>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "server/http/bounded_server.h"
#include "server/http/metrics.h"
#include "server/http/pages.h"
#include "server/http/readiness.h"
#include "server/http/refusal.h"

namespace trammel {
namespace {

constexpr const char* kJson = "application/json";
constexpr const char* kMetricsType = "text/plain; version=0.0.4; charset=utf-8";

HttpReply json_reply(int code, const nlohmann::ordered_json& json) {
  return {code, kJson,
          json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n"};
}

/// Everybody on this host, where nobody needs a token.
const Asker kAnybody{"http", Role::kEngineer};

HttpReply who_are_you(bool api) {
  HttpReply reply = refusal(
      401,
      refused("no token that this server knows").next("send Authorization: Bearer TOKEN").value());
  reply.headers["WWW-Authenticate"] = api ? "Bearer" : "Basic realm=\"trammel\"";
  return reply;
}

bool is_api(const HttpAsk& ask) { return !ask.path.empty() && ask.path[0] == "api"; }

/// A page of another site sends its address along. It must not ask in the name of who looks at it.
bool is_from_another_site(const HttpAsk& ask) {
  const std::string origin = ask.header("origin");
  const std::size_t host = origin.find("://");
  return !origin.empty() &&
         (host == std::string::npos || origin.substr(host + 3) != ask.header("host"));
}

Status check_guards(const HttpOptions& options) {
  if (options.certificate.empty() != options.key.empty())
    return failure(ErrorCode::kUsage, "TLS needs both `certificate` and `key`").of("certificate");
  if (options.stays_here()) return {};
  if (options.allow_network && options.has_tls() && !options.tokens.empty()) return {};
  return failure(ErrorCode::kUsage,
                 "'{}' leaves this host: it needs `allow_network`, `tokens`, `certificate` and "
                 "`key`",
                 options.address)
      .of("address")
      .with_text(options.address);
}

/// What guards a server: read when it starts.
struct Guards {
  std::optional<Tokens> tokens;
  TlsContext tls;
};

Result<Guards> read_guards(const HttpOptions& options) {
  TRY(check_guards(options));
  Guards guards;
  if (!options.tokens.empty()) guards.tokens = TRY(Tokens::read(options.tokens));
  if (options.has_tls()) guards.tls = TRY(open_tls(options.certificate, options.key));
  return guards;
}

}  // namespace

class HttpServer::Running {
 public:
  Running(HttpOptions options, Watched server, HttpApi api)
      : options_(std::move(options)),
        server_(std::move(server)),
        api_(std::move(api)),
        metrics_(server_),
        pages_(server_) {}

  Status start() {
    if (options_.port == 0) return {};
    auto guards = read_guards(options_);
    if (!guards) return Failure(guards.error()).under("http");
    tokens_ = std::move(guards->tokens);
    HttpLimits limits;
    limits.tls = guards->tls;
    limits.stays_here = options_.stays_here();
    limits.posts = posts();
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
  /// With TLS the workers are needed even where nothing can be sent.
  std::optional<HttpPosts> posts() {
    if (!options_.api && !options_.has_tls()) return std::nullopt;
    HttpPosts posts;
    posts.word = "api";
    posts.body = std::max<std::size_t>(api_.largest_body, 1);
    posts.admission = [this](const HttpAsk& ask) { return admit(ask); };
    return posts;
  }

  /// The reply to who may not ask; else fills in who it is.
  std::optional<HttpReply> refused_asker(HttpAsk& ask) const {
    ask.asker = kAnybody;
    const bool free = !tokens_ || (!is_api(ask) && options_.stays_here()) ||
                      (ask.path.size() == 1 && ask.path[0] == "healthz");
    if (free) return std::nullopt;
    const auto asker = tokens_->asker_of(ask.header("authorization"));
    if (!asker) return who_are_you(is_api(ask));
    ask.asker = *asker;
    return std::nullopt;
  }

  std::optional<HttpReply> admit(HttpAsk ask) const {
    if (is_from_another_site(ask))
      return refusal(403, refused("a page of another site asks")
                              .of("Origin")
                              .with_text(ask.header("origin"))
                              .value());
    if (auto refused = refused_asker(ask)) return refused;
    return options_.api && api_.admission ? api_.admission(ask) : std::nullopt;
  }

  HttpReply answer(HttpAsk ask) {
    const ServerPhase phase = phase_;
    if (auto refused = refused_asker(ask)) return *refused;
    if (is_api(ask) && options_.api && api_.answer) {
      if (phase == ServerPhase::kServing) return api_.answer(ask);
      return refusal(503, failure(ErrorCode::kBusy, "the service does not run").value());
    }
    if (ask.path.size() != 1) return pages_.answer(ask, phase);
    if (ask.path[0] == "healthz") return health();
    if (ask.path[0] == "metrics") {
      const BoundedServer* listens = listens_;
      return {200, kMetricsType, metrics_.text(phase, listens == nullptr ? 0 : listens->shed())};
    }
    if (ask.path[0] == "readyz") {
      const Readiness now = readiness(server_, phase, ask.option("cell"));
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
  const HttpApi api_;
  std::optional<Tokens> tokens_;  // empty: nobody needs one
  std::atomic<ServerPhase> phase_{ServerPhase::kStarting};
  Metrics metrics_;
  Pages pages_;
  std::atomic<const BoundedServer*> listens_{nullptr};
  std::unique_ptr<BoundedServer> listening_;  // its threads use all of the above
};

HttpServer::HttpServer(HttpOptions options, Watched server, HttpApi api)
    : running_(std::make_unique<Running>(std::move(options), std::move(server), std::move(api))) {}

HttpServer::~HttpServer() = default;

Status HttpServer::start() { return running_->start(); }

void HttpServer::set_phase(ServerPhase phase) { running_->set_phase(phase); }

void HttpServer::job_changed(const JobProgress& job) { running_->job_changed(job); }

Status check_http_options(const HttpOptions& options) {
  if (options.port == 0) return {};
  TRY(read_guards(options));
  return check_http_address(options.address, options.port, options.stays_here());
}

}  // namespace trammel
