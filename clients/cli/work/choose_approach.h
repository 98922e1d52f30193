#pragma once

#include <vector>

#include "clients/cam/lead_ins.h"
#include "clients/cli/service/answers.h"

/// Choices that a table of targets leaves, made so that the tool lands nearer: the turn about the
/// tool's axis, and the side from which each joint comes.
namespace trammel::cli {

/// Turns each pose about the tool's axis to where its sigma is smallest, clear of limits and of a
/// singular wrist; the posture stays. Fills Corrections::turned_deg. Joint targets stay.
[[nodiscard]] Status turn_freely(const cam::AskTargets& ask, const Chain& robot,
                                 std::vector<exchange::AskedTarget>& targets,
                                 Corrections& corrections);

/// Leads in to targets that are not near enough: Corrections::lead_ins then has the points.
[[nodiscard]] Status lead_in_where_needed(const cam::AskTargets& ask, const Chain& robot,
                                          const Pose& X_FT, const cam::LeadInOptions& options,
                                          const std::vector<exchange::AskedTarget>& targets,
                                          Corrections& corrections);

}  // namespace trammel::cli
