#pragma once

#include <string>

#include "server/robot/shown_poses.h"

namespace trammel::cli {

/// Reads joints and poses as a controller shows them: a table with a header line. Joints `q1_deg`
/// (`J1`, `A1`, `Joint 1`; `_mm` of a rail) and on; `x_mm y_mm z_mm` (`X Y Z`); the orientation in
/// the controller's own angles, three columns named as makers name them (`A B C`, `W P R`, `Rx Ry
/// Rz`, `O A T`, `A E R`, `R P Y`; deg, or rad where the name says so), or `qw qx qy qz`. Makers
/// define the three angles differently, so every meaning is kept (ShownPoses::orientations), and
/// the comparison selects one. Refuses the same as CsvTable, and a table without joints or
/// positions.
[[nodiscard]] Result<ShownPoses> read_shown_poses(const std::string& path, const Chain& robot);
[[nodiscard]] Result<ShownPoses> parse_shown_poses(const std::string& text,
                                                   const std::string& where, const Chain& robot);

}  // namespace trammel::cli
