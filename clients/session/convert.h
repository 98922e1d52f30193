#pragma once

#include <string>

#include "clients/session/session_types.h"
#include "idl/exchange/wire_told.h"
#include "idl/repairs/valid.h"
#include "server/base/result.h"

/// Converts between the types of the session and those of the wire. What a gateway tells, too:
/// idl/exchange.
namespace trammel::client {

[[nodiscard]] wire::Context to_wire(const CallContext& context);

using wire::error_of;
using wire::from_wire;
using wire::status_of;
[[nodiscard]] ServerStatus from_wire(const wire::ServiceStatus& status);

}  // namespace trammel::client
