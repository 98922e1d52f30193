#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/robot/cell.h"

namespace trammel {

/// What the arm must not touch, in B.
struct Obstacles {
  static constexpr double kUsualRadius = 0.1;  ///< m, of a link where the cell file gives none
  struct Box {
    std::string name;
    Workspace box;
    bool carries = false;  ///< the arm stands on it
  };
  std::optional<double> floor = {};  ///< m, its height along z
  std::vector<Box> boxes = {};
  std::vector<double> link_radius = {};  ///< m, of each joint's link and of the tool; the last one
                                         ///< is also that of all beyond; empty: kUsualRadius
};
/// The obstacles in the cell file; empty: it states none, or the cell has no file.
[[nodiscard]] Result<std::optional<Obstacles>> obstacles_of(const Cell& cell);

}  // namespace trammel
