#pragma once

#include "server/calibrate/changes.h"

namespace trammel {

/// True if the change lasted for Change::session only, as when a reflector sat elsewhere that day.
/// Its source ends with the session: `tool_changed@121+1+180`.
[[nodiscard]] bool is_of_one_session(const Change& change);

}  // namespace trammel
