#pragma once

#include <string>

#include "server/robot/cell.h"

namespace trammel {

/// Marks by which two descriptions of a cell are compared: hashes of the contents of its two files,
/// as far as they decide numbers. Not counted are the order of keys, the spelling of numbers,
/// comments, the path of the robot file, and texts for people only.
struct CellDescription {
  std::string cell, robot;  ///< 32 hex digits each
  bool operator==(const CellDescription&) const = default;
};

[[nodiscard]] CellDescription description_of(const Cell& cell);

/// The differing files: `cell file`, `robot file`, `cell file and robot file`; empty: none.
[[nodiscard]] std::string what_differs(const CellDescription& a, const CellDescription& b);

}  // namespace trammel
