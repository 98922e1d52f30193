#pragma once

#include "server/base/result.h"
#include "server/http/exchange.h"

namespace trammel {

/// `{"error": {...}}`, as the command line writes an error.
[[nodiscard]] HttpReply refusal(int code, const Error& error);

}  // namespace trammel
