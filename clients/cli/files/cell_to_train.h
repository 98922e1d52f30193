#pragma once

#include <string>

#include "server/base/result.h"
#include "server/compensate/model_spec.h"

namespace trammel::cli {

/// read_cell() for a command that trains. Refuses also what the training would refuse of the file's
/// own `model`, as far as it is used.
[[nodiscard]] Result<Cell> read_cell_to_train(const std::string& path, SpecUse use = {});

}  // namespace trammel::cli
