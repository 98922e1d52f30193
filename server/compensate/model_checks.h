#pragma once

#include "server/compensate/compensated_model.h"

namespace trammel {

/// Whether what a file says can be a model at all: frames rigid; covariance symmetric and positive semidefinite, and as
/// large as the parameters are many; numbers finite, and within what their kind can be. Which bias a model has is
/// checked where it is restored.
[[nodiscard]] Status check_parts(const CompensatedModel::Parts& parts);

}  // namespace trammel
