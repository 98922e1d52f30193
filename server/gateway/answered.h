#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "server/dds/gateway/service_calls.h"
#include "server/gateway/routes.h"
#include "server/http/exchange.h"
#include "server/registry/model_registry.h"

namespace trammel {

/// A request that was admitted, and everything that its answer needs.
struct GatewayAsk {
  const HttpAsk& http;
  const FoundRoute& route;
  const ModelRegistry& registry;
  const std::string& version;  ///< of this software
  ServiceCalls& calls;
  CallFrom from;
};

/// Asks the service, and puts its answer or its refusal into a reply.
[[nodiscard]] HttpReply answered(const GatewayAsk& ask);

[[nodiscard]] HttpReply api_reply(int code, const nlohmann::ordered_json& json);
/// `{"error": {...}}` with the status that fits: by the result of the service, or by the error's
/// own code where the service was not asked.
[[nodiscard]] HttpReply refused_reply_of(const Error& error, const CallOutcome& outcome = {});

}  // namespace trammel
