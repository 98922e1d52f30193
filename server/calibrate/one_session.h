#pragma once

#include "server/calibrate/changes.h"

namespace trammel {

/// True if the change held in Change::session only, and the sessions after it are as those before:
/// a reflector that sat elsewhere that day. Its source ends where the session does:
/// `tool_changed@121+1+180`.
[[nodiscard]] bool is_of_one_session(const Change& change);

}  // namespace trammel
