#pragma once

#include <string>

#include "server/base/result.h"

namespace trammel {

/// A store that was moved is taken up again, since the other one is given up. Refuses one that was
/// not moved.
[[nodiscard]] Status reopen_store(const std::string& place);

}  // namespace trammel
