#pragma once

#include <string>

#include "server/base/result.h"
#include "server/plan/plan.h"

/// A plan as a program for the robot's controller. For each pose it moves fast to the pose of the
/// approach, slowly to the pose, and waits there until the arm is still and measured (source
/// section 3.2.4.2). Joints are commanded values in degrees (mm for a rail) with four decimals. The
/// program stops where tool or payload must be changed by hand.
namespace trammel {

struct ProgramOptions {
  std::string name = "measure";  ///< of the program: its file without the ending
  double wait_s = 5;             ///< at each pose
  std::string rapid_tool =
      "tool0";         ///< a tooldata of the controller, with the load that is mounted
  int krl_tool = 0;    ///< number in $TOOL_DATA; 0 is the flange
  int fanuc_tool = 1;  ///< number of the tool frame
};

/// ABB RAPID: a module `T_name` (letters that RAPID does not take become `_`) of jointtargets and
/// MoveAbsJ. A rail before or after the six axes is eax_a in mm. Refuses a robot that is not six
/// turning joints with at most one rail at either end, a tool name that is no RAPID identifier (32
/// letters, digits or `_`, a letter first), and a wait that is negative or not finite.
[[nodiscard]] Result<std::string> to_rapid(const Chain& robot, const Plan& plan,
                                           const ProgramOptions& options);

/// KUKA KRL: a .src of PTP motions. A rail is E1 in mm. Refuses as to_rapid(), a tool number
/// outside 0 to 16, and a name that is not a KRL name (24 letters, digits or `_`, a letter first),
/// because the file must have the same name.
[[nodiscard]] Result<std::string> to_krl(const Chain& robot, const Plan& plan,
                                         const ProgramOptions& options);

/// FANUC TP as a listing (.ls): positions of joints in degrees, a rail E1 in mm. Refuses as
/// to_rapid(), a tool number outside 1 to 29, and a name that is no TP name (36 letters, digits or
/// `_`, a letter first).
[[nodiscard]] Result<std::string> to_fanuc(const Chain& robot, const Plan& plan,
                                           const ProgramOptions& options);

/// Universal Robots script of movej to joints in rad, in a function of the program's name (letters
/// that a script does not take become `_`). A popup waits for each change of tool or payload.
/// Refuses the same as to_rapid(), and a rail.
[[nodiscard]] Result<std::string> to_urscript(const Chain& robot, const Plan& plan,
                                              const ProgramOptions& options);

}  // namespace trammel
