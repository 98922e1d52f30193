#pragma once

#include <string>

#include "server/base/result.h"
#include "server/compensate/model_spec.h"

namespace trammel::cli {

/// read_cell() for a command that trains. Also refuses the parts of the file's own `model` that the
/// training would use and refuse.
[[nodiscard]] Result<Cell> read_cell_to_train(const std::string& path, SpecUse use = {});

}  // namespace trammel::cli
