#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "server/health/health_check.h"

namespace trammel {

/// Where a check's batch begins: what changed, changed before it.
struct CheckedSince {
  std::string session_id, pose_id;
};

/// A health check for programs, as the contract spells it; lengths in mm, joints from 1.
[[nodiscard]] nlohmann::ordered_json health_json(const HealthCheck& check,
                                                 const CheckedSince& since);
/// health_json() of a check of `batch`, with the `notes` of the model that it rests on: what every
/// door tells.
[[nodiscard]] nlohmann::ordered_json check_json(const HealthCheck& check, const CheckedBatch& batch,
                                                const CompensatedModel& model);
/// The evidence about the arm's drift in a check that health_json() wrote; empty: none.
[[nodiscard]] std::optional<DriftSeen> drift_of(const std::string& check);
/// For people: the verdict, what changed, what would have been seen, when the next check is due.
[[nodiscard]] std::string health_text(const HealthCheck& check);

}  // namespace trammel
