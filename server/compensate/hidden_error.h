#pragma once

#include "server/compensate/compensated_model.h"

/// An error of the arm behind an instrument that is stated to be worse than it is.
namespace trammel {

/// m per axis: what the physics leaves at the training poses, where that is less than half of the
/// stated sigma: the instrument errs by no more, so all of it may be the arm's. 0 where more is
/// left, or too few poses tell.
[[nodiscard]] double left_within_sigma(const ModelParts& parts);
/// m per axis: left_within_sigma() where it makes what is promised of the true error a tenth larger
/// or more; else 0.
[[nodiscard]] double hidden_by_sigma(const CompensatedModel& model);

}  // namespace trammel
