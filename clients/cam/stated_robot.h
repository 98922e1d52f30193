#pragma once

#include <string>
#include <vector>

#include "clients/cam/cell_tools.h"
#include "clients/cam/program.h"

/// The robot as the files of a controller state it: where it stands, and which one it is.
namespace trammel::cam {

/// Adds what further files say.
void take_stated(const StatedRobot& stated, StatedRobot& all);

/// Makes the frames of a program seen from the robot's base: by a row `robot_base` of --frames,
/// else by what the files say; where nobody says anything the controller's world is the base.
void stand_in_world(Program& program, const ReadOptions& options);

/// Refuses two places that stand the robot differently, and lengths, axes or a type that are not
/// those of `robot`, each with both places and values.
[[nodiscard]] Status check_stated_robot(const Program& program, const Chain& robot);

/// True if a robot file of this name is of the type that a controller names: maker's model, load
/// and reach are the same, as far as the name of the file says them.
[[nodiscard]] bool is_type(const std::string& type, const std::string& robot);

/// Refuses a program that says of its robot that it is mounted otherwise than the cell's base and
/// gravity do.
[[nodiscard]] Status check_gravity(const Program& program, const CellTools& cell);

/// Where the robot was taken to stand, where that is not the origin of the controller's world; a
/// sentence each.
[[nodiscard]] std::vector<std::string> notes_on_base(const Program& program, const CellTools& cell);

}  // namespace trammel::cam
