#pragma once

#include <string>
#include <vector>

#include "server/robot/chain.h"

/// Robot files as they are written; models/README.md says what stands in them.
namespace trammel {

/// The keys `joints` and `coupling`, with everything that the chain holds. `links`: what stands in
/// place of its nominal ones, one a joint.
[[nodiscard]] std::string joints_yaml(const Chain& robot, const std::vector<LinkGeometry>& links);

/// A robot file of the chain as it is. `source`: where its numbers come from, one line.
[[nodiscard]] std::string robot_yaml(const Chain& robot, const std::string& source);

}  // namespace trammel
