#pragma once

#include <optional>
#include <string>

#include "server/robot/cell.h"

namespace trammel {

/// Line of the cell file in which `model` has this key, counted from 1; empty where it has not.
[[nodiscard]] std::optional<long> row_of_model_key(const Cell& cell, const std::string& key);

}  // namespace trammel
