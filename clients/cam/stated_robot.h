#pragma once

#include <string>
#include <vector>

#include "clients/cam/cell_tools.h"
#include "clients/cam/program.h"

/// The robot by its controller's files: its place and its identity.
namespace trammel::cam {

/// Adds the statements of further files.
void take_stated(const StatedRobot& stated, StatedRobot& all);

/// Expresses the frames of a program in the robot's base: by a row `robot_base` of --frames,
/// otherwise by the files; without either, the controller's world is the base.
void stand_in_world(Program& program, const ReadOptions& options);

/// Refuses two different places of the robot. Refuses lengths, axes or a type that differ from
/// those of `robot`. The error has both values.
[[nodiscard]] Status check_stated_robot(const Program& program, const Chain& robot);

/// True if a robot file of this name is of the type that a controller names: maker's model, load
/// and reach are the same, as far as the name of the file says them.
[[nodiscard]] bool is_type(const std::string& type, const std::string& robot);

/// Refuses a program whose stated mounting of the robot contradicts the cell's base and gravity.
[[nodiscard]] Status check_gravity(const Program& program, const CellTools& cell);

/// What the controller's files say of the robot otherwise than the robot file and the cell, and
/// what does not forbid a correction by itself: the ends of its axes, and a base that is turned
/// against the vertical. One sentence each, with both places and values.
[[nodiscard]] std::vector<std::string> contradictions_of(const StatedRobot& stated,
                                                         const Chain& robot, const CellTools& cell);

/// The robot's assumed place, if it is not the origin of the controller's world; one sentence each.
[[nodiscard]] std::vector<std::string> notes_on_base(const Program& program, const CellTools& cell);

}  // namespace trammel::cam
