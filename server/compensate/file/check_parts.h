#pragma once

#include "server/base/result.h"
#include "server/compensate/model_parts.h"

namespace trammel::model_file {

/// Whether what a file says can be a model at all: frames rigid; covariance symmetric and positive semidefinite, and as
/// large as the parameters are many; numbers finite, and within what their kind can be. Which bias a model has is
/// checked where it is restored.
[[nodiscard]] Status check_parts(const ModelParts& parts);

}  // namespace trammel::model_file
