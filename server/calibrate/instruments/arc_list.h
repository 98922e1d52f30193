#pragma once

#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/robot/chain.h"

/// Arcs that reflectors draw while one joint turns, as measured.
namespace trammel {

/// One position of a reflector.
struct ArcPoint {
  int joint = 0;          ///< the turning joint, from 0
  std::string reflector;  ///< which of several; may be empty
  JointVector q;          ///< rad, all joints as commanded
  Vector3 p_W = Vector3::Zero();
  int row = 0;  ///< line in its file
};

struct ArcList {
  std::string where;  ///< the file as messages name it
  std::vector<ArcPoint> points;
};

/// Reads `joint,q_deg,x_mm,y_mm,z_mm`: the joint's number from 1, its angle, and the reflector in
/// W. Optional columns are `reflector`, and `q1_deg` ... `qn_deg` with the angles of the held
/// joints; without them these joints are at zero. Refuses a missing column, a value that is not a
/// number, a joint that the robot does not have, and postures with a wrong number of joints.
[[nodiscard]] Result<ArcList> parse_arcs_csv(const std::string& text, const std::string& where,
                                             const Chain& robot);
[[nodiscard]] Result<ArcList> read_arcs_csv(const std::string& path, const Chain& robot);

/// The points of one joint, arc by arc. Points into the list it was made from.
struct JointArcs {
  int joint = 0;
  JointVector posture;  ///< rad, where the other joints are held; its own value means nothing
  std::vector<std::vector<const ArcPoint*>> arcs;
};

/// An entry for each joint; a prismatic joint has no arcs. Refuses joints that follow another
/// joint, since their axis moves. Refuses a turning joint without arcs, arcs of a prismatic joint,
/// a prismatic joint that moves, an arc with fewer than 3 points (5 where sigma is not stated), and
/// held joints that move.
[[nodiscard]] Result<std::vector<JointArcs>> sorted_by_joint(const Chain& robot,
                                                             const ArcList& arcs,
                                                             bool sigma_stated);

}  // namespace trammel
