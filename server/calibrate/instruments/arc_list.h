#pragma once

#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/robot/chain.h"

/// Arcs that reflectors draw while one joint turns: as they were measured, and joint by joint.
namespace trammel {

/// One position of a reflector.
struct ArcPoint {
  int joint = 0;          ///< that turns, from 0
  std::string reflector;  ///< which of several; may be empty
  JointVector q;          ///< rad, all joints as commanded
  Vector3 p_W = Vector3::Zero();
  int row = 0;  ///< line in its file
};

struct ArcList {
  std::string where;  ///< the file as messages name it
  std::vector<ArcPoint> points;
};

/// Reads `joint,q_deg,x_mm,y_mm,z_mm` (joint from 1, its angle, the reflector in W) with, where recorded, `reflector`
/// and the posture that the other joints are held at, `q1_deg` ... `qn_deg`; joints without such columns are at zero.
/// Refuses, naming file, row, value and limit: a missing column, numbers that are none, a joint the robot has not,
/// postures with another number of joints.
[[nodiscard]] Result<ArcList> parse_arcs_csv(const std::string& text, const std::string& where, const Chain& robot);
[[nodiscard]] Result<ArcList> read_arcs_csv(const std::string& path, const Chain& robot);

/// The points of one joint, arc by arc. Refers to the list it was sorted from.
struct JointArcs {
  int joint = 0;
  JointVector posture;  ///< rad, that the others are held at; its own value stands for nothing
  std::vector<std::vector<const ArcPoint*>> arcs;
};

/// One entry a joint. Refuses: joints that slide or follow another, and so draw no arc about an axis that stands still;
/// a joint without arc; an arc of fewer than 3 points, or 5 where sigma is not stated; held joints that move.
[[nodiscard]] Result<std::vector<JointArcs>> sorted_by_joint(const Chain& robot, const ArcList& arcs,
                                                             bool sigma_stated);

}  // namespace trammel
