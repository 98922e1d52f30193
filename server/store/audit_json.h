#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "server/base/result.h"
#include "server/store/audit.h"

namespace trammel {

/// The trail for programs: `rows` with the members of AuditRow, `verified`, and `broken` with `row`
/// and `why`, or null.
[[nodiscard]] nlohmann::ordered_json audit_json(const AuditTrail& trail);
/// The reverse. Refuses a text that is none.
[[nodiscard]] Result<AuditTrail> audit_of_json(const std::string& text);

}  // namespace trammel
