#pragma once

#include <string>

#include "server/diagnose/diagnosis.h"

namespace trammel {

/// A proof in the batch's own residuals, as a section of a page. For each cause it has the measured
/// size from which it is named, the predicted size, and a plot of the shares named correctly and
/// wrongly. If no size is named, it says so.
[[nodiscard]] std::string proof_section(const Proof& proof);

}  // namespace trammel
