#pragma once

#include <string>

#include "server/base/result.h"

namespace trammel {

/// Opens a moved store again after the other store has been given up. Refuses a store that was not
/// moved.
[[nodiscard]] Status reopen_store(const std::string& place);

}  // namespace trammel
