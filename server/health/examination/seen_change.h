#pragma once

#include <vector>

#include "server/health/health_verdict.h"

/// The figures beside a change that was seen.
namespace trammel::health {

/// True if the cause is the zero of one joint, or of several.
[[nodiscard]] bool is_zero(const SingleCause& cause);
[[nodiscard]] SingleCause unknown_cause();
/// Unless it stands there already.
void add_rival(const SingleCause& rival, SeenChange& change);
/// An instrument that tells all lengths too long is like an arm that grew, and the tool with it.
void tell_instrument(std::vector<SeenChange>& changed);

}  // namespace trammel::health
