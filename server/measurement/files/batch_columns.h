#pragma once

#include <string>
#include <vector>

namespace trammel {

/// Names of the columns of a measured pose, in a batch that is read or written.
inline const std::vector<std::string> kPositionColumns = {"x_mm", "y_mm", "z_mm"};
inline const std::vector<std::string> kQuaternionColumns = {"qw", "qx", "qy", "qz"};

}  // namespace trammel
