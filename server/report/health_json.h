#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "server/health/health_check.h"

namespace trammel {

/// Where a check's batch begins: what changed, changed before it.
struct CheckedSince {
  std::string session_id, pose_id;
};

/// A health check for programs, as the contract spells it; lengths in mm, joints from 1.
[[nodiscard]] nlohmann::ordered_json health_json(const HealthCheck& check, const CheckedSince& since);
/// For people: the verdict, what changed, what would have been seen, when the next check is due.
[[nodiscard]] std::string health_text(const HealthCheck& check);

}  // namespace trammel
