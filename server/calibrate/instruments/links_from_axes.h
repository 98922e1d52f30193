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
/// The first and the last joint that turn. What stands before or behind them no arc shows.
struct TurningJoints {
  int first = 0, last = 0;
};
/// Refuses a robot without any, and a joint that slides between turning ones in another line than
/// the next axis: arcs do not tell how it leads from the one axis to the other.
[[nodiscard]] Result<TurningJoints> turning_joints(const Chain& robot);

/// The robot with a Hayati row wherever an axis is parallel to the next one and both are
/// measured; what such a row had as d stands in the row behind it. `notes`: which rows those are.
[[nodiscard]] Result<Chain> with_hayati_rows(const Chain& robot, const TurningJoints& turning,
                                             std::vector<Note>& notes);

/// Axes as measured at the postures of `groups` -> with the joints before them at zero, in their
/// kinematic sense. A joint that slides along the next axis has that axis; else the line of a joint
/// that slides is none.
[[nodiscard]] std::vector<AxisLine> at_zero(const Chain& robot,
                                            const std::vector<JointArcs>& groups,
                                            const std::vector<AxisLine>& measured);

struct Links {
  std::vector<LinkGeometry> links;
  Pose X_WB = Pose::Identity();
};

/// The DH procedure on axes at zero, source section 4.1.1 and Figure 4.1: the links that come
/// nearest to those of the nominal `robot`. `held`: of each joint, where it slides: the place at
/// which it stood, m; else 0. Links that no arc shows are the nominal ones. Refuses parallel axes
/// in a row that is not a Hayati one.
[[nodiscard]] Result<Links> links_of(const Chain& robot, const std::vector<AxisLine>& lines,
                                     const JointVector& held);

}  // namespace trammel
