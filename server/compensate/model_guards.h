#pragma once

#include <vector>

#include "server/compensate/compensated_model.h"
#include "server/compensate/note.h"

/// What speaks against trusting a model, judged from the model alone. The command line, the library, Python and the
/// daemon ask this one function, so that a model gets the same words at each of them.
namespace trammel {

/// Times the stated sigma: what the model leaves of an axis of a training pose, the bias taken off. Positions whose
/// rows state a larger sigma of their own, and single poses that do not fit the others, do not count. At least 1; 1
/// also for models of gauges alone, and where the cell states no sigma.
[[nodiscard]] double sigmas_left(const CompensatedModel& model);

/// Those that are true of `model`, the gravest first. Code `left_beyond_sigma`: from kNotedSigmas it leads, from
/// kHeldSigmas it holds.
[[nodiscard]] std::vector<Note> guards_of(const CompensatedModel& model);

inline constexpr double kNotedSigmas = 3;
inline constexpr double kHeldSigmas = 30;

}  // namespace trammel
