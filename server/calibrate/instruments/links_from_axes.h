#pragma once

#include <vector>

#include "server/base/result.h"
#include "server/calibrate/instruments/arc_list.h"
#include "server/robot/chain.h"

/// From the axes of a robot's joints to the rows of its kinematic table.
namespace trammel {

/// An axis in W: unit direction and a point on it, m.
struct AxisLine {
  Vector3 n, c;
};

/// Axes as measured at the postures of `groups` -> with the joints before them at zero, in their kinematic sense.
[[nodiscard]] std::vector<AxisLine> at_zero(const Chain& robot, const std::vector<JointArcs>& groups,
                                            const std::vector<AxisLine>& measured);

struct Links {
  std::vector<LinkGeometry> links;
  Pose X_WB = Pose::Identity();
};

/// The DH procedure on axes at zero, source section 4.1.1 and Figure 4.1: the links that come nearest to those of the
/// nominal `robot`. Refuses parallel axes in a row that is not a Hayati one.
[[nodiscard]] Result<Links> links_of(const Chain& robot, const std::vector<AxisLine>& lines);

}  // namespace trammel
