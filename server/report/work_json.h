#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "server/compensate/work_asked.h"

namespace trammel {

/// Which versions a cell's work was looked at with; `other` 0: none beside the one in force.
struct WorkVersions {
  std::string cell;
  int in_force = 0, other = 0;
};

/// For programs; lengths in mm, joints in deg, or mm on a rail.
[[nodiscard]] nlohmann::ordered_json work_json(const WorkAsked& work, const WorkVersions& versions,
                                               const Chain& robot);
/// For people, of what work_json() made.
[[nodiscard]] std::string work_text(const nlohmann::ordered_json& work);

}  // namespace trammel
