#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "server/compensate/session_changes.h"

namespace trammel {

/// The changes between sessions, for programs: cause and joint (from 1), the first session and
/// pose, sizes with U(k=2) and their unit, possible alternatives, and whether the change rests on
/// the order of the sessions.
[[nodiscard]] nlohmann::ordered_json session_changes_json(
    const std::vector<SessionChange>& changes);
/// The changes between sessions as a table of a page; empty where nothing changed.
[[nodiscard]] std::string session_changes_html(const std::vector<SessionChange>& changes);

}  // namespace trammel
