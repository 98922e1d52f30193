#pragma once

#include "server/http/exchange.h"

namespace trammel {

/// The page where a person drops a robot program and gets it back with its receipt. It is one file,
/// and may send to this server alone.
[[nodiscard]] HttpReply drop_page();

}  // namespace trammel
