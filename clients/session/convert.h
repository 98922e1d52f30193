#pragma once

#include <string>

#include "clients/session/session_types.h"
#include "idl/repairs/valid.h"
#include "server/base/result.h"

/// Converts between the types of the session and those of the wire. Predictions and corrections:
/// idl/exchange.
namespace trammel::client {

[[nodiscard]] wire::Context to_wire(const CallContext& context);

[[nodiscard]] exchange::ModelInfo from_wire(const wire::ModelInfo& info);
[[nodiscard]] JobStatus status_of(const wire::Job& job);
[[nodiscard]] ServerStatus from_wire(const wire::ServiceStatus& status);
[[nodiscard]] DatedJob from_wire(const wire::Job& job, const std::string& server);
[[nodiscard]] BatchOfService from_wire(const wire::BatchInfo& batch);
/// The error in a reply that is not RESULT_OK.
[[nodiscard]] Error error_of(const wire::ReplyHeader& header);

}  // namespace trammel::client
