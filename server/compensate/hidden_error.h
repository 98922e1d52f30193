#pragma once

#include "server/compensate/compensated_model.h"

/// An error of the arm behind an instrument that is stated to be worse than it is.
namespace trammel {

/// m per axis: the residual of the physics at the training poses, if it is less than half of the
/// stated sigma. The instrument's own error is then at most that residual, so all of it may be the
/// arm's. 0 if the residual is larger, or if there are too few poses.
[[nodiscard]] double left_within_sigma(const ModelParts& parts);
/// m per axis: left_within_sigma() if it raises the stated true error by a tenth or more; else 0.
[[nodiscard]] double hidden_by_sigma(const CompensatedModel& model);

}  // namespace trammel
