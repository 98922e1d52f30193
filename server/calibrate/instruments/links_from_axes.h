#pragma once

#include <vector>

#include "server/base/note.h"
#include "server/base/result.h"
#include "server/calibrate/instruments/arc_list.h"
#include "server/robot/chain.h"

/// From the axes of a robot's joints to the rows of its kinematic table.
namespace trammel {

/// An axis in W: unit direction and a point on it, m.
struct AxisLine {
  Vector3 n = Vector3::Zero(), c = Vector3::Zero();
};

/// True if the joint slides.
[[nodiscard]] bool slides(const Chain& robot, int joint);
/// The first and the last joint that turn. No arc shows the parts before the first or behind the
/// last.
struct TurningJoints {
  int first = 0, last = 0;
};
/// Refuses a robot without turning joints. Refuses a prismatic joint between turning ones unless it
/// slides along the next axis: arcs do not show how it leads from one axis to the other.
[[nodiscard]] Result<TurningJoints> turning_joints(const Chain& robot);

/// The robot with a Hayati row wherever an axis is parallel to the next one and both are measured.
/// The d of such a row moves into the row behind it. `notes` lists these rows.
[[nodiscard]] Result<Chain> with_hayati_rows(const Chain& robot, const TurningJoints& turning,
                                             std::vector<Note>& notes);

/// Transforms axes measured at the postures of `groups` to joints before them at zero, in their
/// kinematic sense. A prismatic joint along the next axis gets that axis; other prismatic joints
/// get no line.
[[nodiscard]] std::vector<AxisLine> at_zero(const Chain& robot,
                                            const std::vector<JointArcs>& groups,
                                            const std::vector<AxisLine>& measured);

struct Links {
  std::vector<LinkGeometry> links;
  Pose X_WB = Pose::Identity();
};

/// The DH procedure on axes at zero, source section 4.1.1 and Figure 4.1: the links nearest to
/// those of the nominal `robot`. `held` has, for each prismatic joint, its position during the
/// arcs, m; for other joints 0. Links that no arc shows stay nominal. Refuses parallel axes in a
/// row that is not a Hayati row.
[[nodiscard]] Result<Links> links_of(const Chain& robot, const std::vector<AxisLine>& lines,
                                     const JointVector& held);

}  // namespace trammel
