#pragma once

#include <map>
#include <memory>
#include <string>

#include "server/base/result.h"
#include "server/robot/cell.h"

namespace trammel {

/// The cells that a service answers for, by name.
using ServedCells = std::map<std::string, std::shared_ptr<const Cell>>;

/// kNotFound: another service's.
[[nodiscard]] inline Result<std::shared_ptr<const Cell>> find_cell(const ServedCells& cells,
                                                                   const std::string& name) {
  const auto found = cells.find(name);
  if (found == cells.end())
    return failure(ErrorCode::kNotFound, "cell {} is not served here", name);
  return found->second;
}

}  // namespace trammel
