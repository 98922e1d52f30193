#pragma once

#include <string>

#include "server/store/audit.h"

namespace trammel::cli {

/// A line a row, oldest first (dates in UTC), and how far the trail can be believed.
[[nodiscard]] std::string audit_text(const AuditTrail& trail, const std::string& where);

}  // namespace trammel::cli
