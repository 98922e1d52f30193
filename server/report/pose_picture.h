#pragma once

#include <string>
#include <vector>

#include "server/robot/pose.h"

namespace trammel {

/// A pose in a drawing, and the distance that it is off by.
struct DrawnPose {
  std::string name;          ///< text
  Vector3 place_mm, off_mm;  ///< in B
  bool marked = false;       ///< drawn in the colour of what is doubtful
};

/// The poses from above and from the side, each with an arrow for what it is off by, much enlarged,
/// and the base. SVG without scripts; empty where no pose has a place.
[[nodiscard]] std::string pose_picture(const std::vector<DrawnPose>& poses);

}  // namespace trammel
