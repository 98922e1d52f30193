#pragma once

#include <map>
#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"

/// The part of a model that holds at every pose: links, base and tools. Programs that know only
/// kinematics (URDF) can carry it; the rest is told with its size.
namespace trammel::cli {

/// The part of a model that rigid kinematics leaves out.
struct LeftOut {
  std::string source;  ///< in the spelling of a list of error sources; `bias` is the learned part
  std::string plain;   ///< for people
  double rms = 0, most = 0;  ///< m, how far it moves the tool at poses drawn in the model's domain
};

struct RigidRobot {
  PhysicalModel physics;                 ///< with the rigid sources alone
  std::vector<LinkGeometry> nominal;     ///< all joints at 0, as the drawing has them
  std::vector<LinkGeometry> links;       ///< all joints at 0, calibrated
  Pose X_WB_nominal = Pose::Identity();  ///< the base as the controller believes it
  Pose X_WB = Pose::Identity();          ///< calibrated
  std::map<std::string, Pose> tools;     ///< X_FT, calibrated
  std::vector<LeftOut> left_out;
  double rms = 0, most = 0;  ///< m, of all that is left out together
  int poses = 0;             ///< the number of poses for the sizes
};

/// Poses are drawn from the joint ranges of the model's training, always the same ones.
[[nodiscard]] RigidRobot rigid_robot(const CompensatedModel& model);

}  // namespace trammel::cli
