#pragma once

#include "server/base/result.h"
#include "server/compensate/model_parts.h"

namespace trammel::model_file {

/// Checks that the values of a file can be a model: rigid frames; a covariance that is symmetric,
/// positive semidefinite and as large as there are parameters; finite numbers within the limits of
/// their kind. A bias is checked where it is restored.
[[nodiscard]] Status check_parts(const ModelParts& parts);

}  // namespace trammel::model_file
