#pragma once

#include <string>
#include <vector>

#include "server/robot/cell.h"

namespace trammel {

/// Something in a cell file or robot file that may be read without an error and is hardly meant so.
struct CellDoubt {
  std::string code;  ///< `gravity_up`, `quaternion_order`, `lengths_in_metres`, `hayati_missing`
  std::string text;  ///< one sentence, with the key and the value
  bool of_robot_file = false;  ///< else of the cell file
};

/// Joints (0-based) whose axis is parallel to the next one, and whose row of the robot file is no
/// Hayati row: the model has no number for the tilt of the one axis against the other, and d of one
/// is not told from d of the other.
[[nodiscard]] std::vector<int> rows_without_hayati(const Chain& robot);

/// The doubts about the files before any measurement: gravity that points up over an upright
/// base; a quaternion that would put the base upright in the order x, y, z, w; a tool, a payload's
/// centre or a base that is less than 2 mm away, as numbers in metres are; two consecutive parallel
/// axes without `hayati: true`, whose d nobody can tell apart (Hayati, 1983).
[[nodiscard]] std::vector<CellDoubt> doubts_of(const Cell& cell);

}  // namespace trammel
