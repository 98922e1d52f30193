#include "server/gateway/gateway.h"

#include <charconv>
#include <optional>
#include <utility>

#include "server/gateway/answered.h"
#include "server/gateway/drop_page.h"
#include "server/gateway/open_api.h"
#include "server/gateway/routes.h"

namespace trammel {
namespace {

constexpr std::size_t kLargestBody = std::size_t{32} << 20;  // bytes, as a batch on DDS
constexpr std::size_t kLongestTrace = 64, kLongestChange = 64;
constexpr std::uint32_t kLongestDeadline = 120'000;  // ms

HttpReply refused_ask(int code, ErrorCode kind, const std::string& what, const std::string& next) {
  HttpReply reply = refused_reply_of(failure(kind, "{}", what).next(next).value());
  reply.code = code;
  return reply;
}

/// Options that the address does not have are mistakes: a misspelt one would go unnoticed.
Status check_options(const HttpAsk& ask, const Route& route) {
  for (const auto& [name, value] : ask.options) {
    bool known = route.endpoint == Endpoint::kPage && name == "cell";
    for (const RouteOption& option : route.options) known = known || option.name == name;
    if (!known)
      return failure(ErrorCode::kUsage, "'{}' is no option of {}", name, route.path).of(name);
  }
  for (const RouteOption& option : route.options) {
    if (option.needed && ask.option(option.name).empty())
      return failure(ErrorCode::kUsage, "'{}' is missing", option.name).of(option.name);
  }
  if (ask.option("change_id").size() > kLongestChange)
    return failure(ErrorCode::kTooLarge, "change_id is longer than {} bytes", kLongestChange)
        .of("change_id");
  return {};
}

Result<CallFrom> sender_of(const HttpAsk& ask) {
  CallFrom from{ask.asker.name, {}, ask.header("trammel-trace")};
  if (from.trace.size() > kLongestTrace)
    return failure(ErrorCode::kTooLarge, "a trace of {} bytes, limit {}", from.trace.size(),
                   kLongestTrace)
        .of("Trammel-Trace");
  const std::string text = ask.header("trammel-deadline-ms");
  if (text.empty()) return from;
  std::uint32_t ms = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), ms);
  if (error != std::errc() || end != text.data() + text.size() || ms < 1 || ms > kLongestDeadline)
    return failure(ErrorCode::kUsage, "'{}': expected 1 to {} ms", text, kLongestDeadline)
        .of("Trammel-Deadline-Ms")
        .with_text(text);
  from.deadline = std::chrono::milliseconds(ms);
  return from;
}

}  // namespace

Gateway::Gateway(const ModelRegistry& registry, WithCalls calls, std::string version)
    : registry_(registry), calls_(std::move(calls)), version_(std::move(version)) {}

HttpApi Gateway::api() {
  return {kLargestBody, [this](const HttpAsk& ask) { return admitted(ask); },
          [this](const HttpAsk& ask) { return answer(ask); }};
}

std::optional<HttpReply> Gateway::admitted(const HttpAsk& ask) const {
  const auto found = find_route(ask.method, ask.path);
  if (!found)
    return refused_ask(404, ErrorCode::kNotFound, "there is no such address",
                       "see /api/v1/openapi.json");
  const Route& route = *found->route;
  if (ask.method != route.method) {
    HttpReply reply = refused_ask(405, ErrorCode::kUsage, "another method is needed",
                                  std::string("send ") + route.method);
    reply.headers["Allow"] = route.method;
    return reply;
  }
  if (ask.asker.role < route.role)
    return refused_ask(403, ErrorCode::kRefused,
                       fmt::format("{} is {}, and this needs {}", ask.asker.name,
                                   to_text(ask.asker.role), to_text(route.role)),
                       "ask with the token of another role");
  if (const Status good = check_options(ask, route); !good) return refused_reply_of(good.error());
  if (const auto from = sender_of(ask); !from) return refused_reply_of(from.error());
  return std::nullopt;
}

HttpReply Gateway::answer(const HttpAsk& ask) {
  if (auto refused = admitted(ask)) return *refused;
  const FoundRoute found = *find_route(ask.method, ask.path);
  if (found.route->endpoint == Endpoint::kPage) return drop_page();
  if (found.route->endpoint == Endpoint::kOpenApi) return api_reply(200, open_api(version_));
  const std::string& client = ask.asker.name;
  if (!enter(client))
    return refused_reply_of(
        failure(ErrorCode::kBusy, "{} requests of {} are under way", kOfOneClient, client).value(),
        {"busy", std::chrono::seconds(1)});
  HttpReply reply =
      refused_reply_of(failure(ErrorCode::kBusy, "the service does not run").value(), {"busy", {}});
  try {
    static_cast<void>(calls_([&](ServiceCalls& calls) {
      reply = answered({ask, found, registry_, version_, calls, *sender_of(ask)});
    }));
  } catch (...) {
    leave(client);
    throw;
  }
  leave(client);
  return reply;
}

bool Gateway::enter(const std::string& client) {
  const MutexLock lock(mutex_);
  std::size_t& count = under_way_[client];
  if (count >= kOfOneClient) return false;
  ++count;
  return true;
}

void Gateway::leave(const std::string& client) {
  const MutexLock lock(mutex_);
  const auto found = under_way_.find(client);
  if (--found->second == 0) under_way_.erase(found);
}

}  // namespace trammel
