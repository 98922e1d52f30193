#pragma once

#include <string>

#include "server/robot/cell.h"

namespace trammel {

/// The marks that tell two descriptions of a cell apart: hashes of what its two files say that
/// decides numbers. The order of keys, how a number is spelled, comments, where the robot file lies
/// and what is written for people only do not count.
struct CellDescription {
  std::string cell, robot;  ///< 32 hex digits each
  bool operator==(const CellDescription&) const = default;
};

[[nodiscard]] CellDescription description_of(const Cell& cell);

/// `cell file`, `robot file`, `cell file and robot file`: what differs; empty: nothing.
[[nodiscard]] std::string what_differs(const CellDescription& a, const CellDescription& b);

}  // namespace trammel
