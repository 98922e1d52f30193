#pragma once

#include <string>
#include <vector>

#include "server/robot/chain.h"

/// Writes robot files. models/README.md describes their content.
namespace trammel {

/// The keys `joints` and `coupling`, with everything that the chain holds. `links` replaces the
/// nominal links, one per joint.
[[nodiscard]] std::string joints_yaml(const Chain& robot, const std::vector<LinkGeometry>& links);

/// A robot file of the chain as it is. `source`: where its numbers come from, one line.
[[nodiscard]] std::string robot_yaml(const Chain& robot, const std::string& source);

}  // namespace trammel
