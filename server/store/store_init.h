#pragma once

#include <string>

#include "server/base/result.h"

namespace trammel {

/// Makes the empty database at `url` a store, or brings one of an older schema up to today's. The
/// role that does it owns the store; `role`, if any, is let in to use it: it may add to the audit
/// trail, and neither change nor delete it. Refuses what is no URL, a database of another program
/// and a newer schema.
[[nodiscard]] Status init_store(const std::string& url, const std::string& role = "");

}  // namespace trammel
