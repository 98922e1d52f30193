#pragma once

#include <string>
#include <vector>

#include "clients/cam/dialect.h"
#include "clients/cam/program.h"
#include "server/base/result.h"
#include "server/robot/pose.h"

/// Values of tools and frames that a program leaves open, in a table of a person.
namespace trammel::cam {

/// A row: a frame seen from the robot's base, a tool from the flange.
struct GivenPose {
  std::string name;
  Pose X;
  int line = 0;
  bool may_be_unused = false;  ///< its row may belong to other programs
};

/// CSV: `name,x_mm,y_mm,z_mm,qw,qx,qy,qz`, and `may_be_unused` (yes or no). `where` names the
/// table.
[[nodiscard]] Result<std::vector<GivenPose>> read_given_poses(const std::string& text,
                                                              const std::string& where);
/// Refuses rows without effect on the program, since their author expects one.
[[nodiscard]] Status check_used(const std::vector<GivenPose>& rows, const std::string& where,
                                const Program& program, Dialect dialect);

}  // namespace trammel::cam
