#pragma once

#include "server/numerics/numerics_table.h"

namespace trammel {

/// The fastest build that this processor runs; the same for the life of the process.
[[nodiscard]] const Numerics& numerics();

}  // namespace trammel
