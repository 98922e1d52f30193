#pragma once

#include <string>

#include "server/base/result.h"

namespace trammel {

/// Makes the empty database at `url` a store, or upgrades an older schema. The calling role owns
/// the store; `role`, if given, gets access: it may add to the audit trail, but neither change nor
/// delete rows. Refuses a place that is not a URL, a database of another program and a newer
/// schema.
[[nodiscard]] Status init_store(const std::string& url, const std::string& role = "");

}  // namespace trammel
