#pragma once

#include <optional>
#include <string>

#include "server/robot/cell.h"

namespace trammel {

/// Line of the cell file with this key of `model`, counted from 1; empty if the key is missing.
[[nodiscard]] std::optional<long> row_of_model_key(const Cell& cell, const std::string& key);

}  // namespace trammel
