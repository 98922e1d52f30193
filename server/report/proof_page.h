#pragma once

#include <string>

#include "server/diagnose/diagnosis.h"

namespace trammel {

/// A proof in the batch's own residuals, as a section of a page: for each cause the size
/// from which it is named, beside the one that was predicted, and a plot of how often it was named
/// rightly and wrongly. A cause that no size names says so.
[[nodiscard]] std::string proof_section(const Proof& proof);

}  // namespace trammel
