#pragma once

#include <vector>

#include "server/health/health_verdict.h"

/// The figures beside a change that was seen.
namespace trammel::health {

/// True if the cause is the zero of one joint, or of several.
[[nodiscard]] bool is_zero(const SingleCause& cause);
[[nodiscard]] SingleCause unknown_cause();
/// Does nothing if the list already contains it.
void add_rival(const SingleCause& rival, SeenChange& change);
/// Adds the instrument as a rival: if it measures all lengths too long, it looks like an arm, with
/// its tool, that grew.
void tell_instrument(std::vector<SeenChange>& changed);

}  // namespace trammel::health
