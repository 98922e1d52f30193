#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "server/health/health_check.h"

namespace trammel {

/// The start of a check's batch: changes happened before it.
struct CheckedSince {
  std::string session_id, pose_id;
};

/// A health check for programs, as the contract spells it; lengths in mm, joints from 1.
[[nodiscard]] nlohmann::ordered_json health_json(const HealthCheck& check,
                                                 const CheckedSince& since);
/// health_json() of a check of `batch`, with the `notes` of the model behind it. The command line,
/// the library, Python and the service all return this.
[[nodiscard]] nlohmann::ordered_json check_json(const HealthCheck& check, const CheckedBatch& batch,
                                                const CompensatedModel& model);
/// The evidence about the arm's drift in a check that health_json() wrote; empty: none.
[[nodiscard]] std::optional<DriftSeen> drift_of(const std::string& check);
/// For people: the verdict, the changes, the smallest visible changes, and the date of the next
/// check.
[[nodiscard]] std::string health_text(const HealthCheck& check);

}  // namespace trammel
