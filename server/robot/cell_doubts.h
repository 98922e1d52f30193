#pragma once

#include <string>
#include <vector>

#include "server/robot/cell.h"

namespace trammel {

/// Something in a cell file or robot file that may be read without an error and is hardly meant so.
struct CellDoubt {
  std::string code;  ///< `gravity_up`, `quaternion_order`, `lengths_in_metres`, `hayati_missing`
  std::string text;  ///< one sentence, with the key and the value
  bool of_robot_file = false;  ///< true: about the robot file; false: about the cell file
};

/// Joints (0-based) whose axis is parallel to the next one, but whose row in the robot file is not
/// a Hayati row. For such a pair the model has no number for the tilt between the two axes, and it
/// cannot separate the two values of d.
[[nodiscard]] std::vector<int> rows_without_hayati(const Chain& robot);

/// The doubts about the files before any measurement. They are: gravity that points up over an
/// upright base; a quaternion that would put the base upright in the order x, y, z, w; a tool, a
/// payload's centre or a base closer than 2 mm, as if given in metres; two consecutive parallel
/// axes without `hayati: true`, whose two values of d cannot be separated (Hayati, 1983).
[[nodiscard]] std::vector<CellDoubt> doubts_of(const Cell& cell);

}  // namespace trammel
