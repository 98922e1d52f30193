#pragma once

#include <vector>

#include "clients/cam/lead_ins.h"
#include "clients/cli/service/answers.h"

/// Choices that a table of targets leaves open: the turn about the tool's axis, and the side from
/// which each joint comes. They are made so that the tool lands nearer.
namespace trammel::cli {

/// Turns each pose about the tool's axis to the smallest sigma, away from limits and a singular
/// wrist. The posture stays. Fills Corrections::turned_deg. Joint targets stay unchanged.
[[nodiscard]] Status turn_freely(const cam::AskTargets& ask, const Chain& robot,
                                 std::vector<exchange::AskedTarget>& targets,
                                 Corrections& corrections);

/// Adds lead-ins to targets that are not near enough. Corrections::lead_ins then has the points.
[[nodiscard]] Status lead_in_where_needed(const cam::AskTargets& ask, const Chain& robot,
                                          const Pose& X_FT, const cam::LeadInOptions& options,
                                          const std::vector<exchange::AskedTarget>& targets,
                                          Corrections& corrections);

}  // namespace trammel::cli
