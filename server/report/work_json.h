#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "server/compensate/work_asked.h"

namespace trammel {

/// The versions that predicted a cell's recent work; `other` 0: only the one in force.
struct WorkVersions {
  std::string cell;
  int in_force = 0, other = 0;
};

/// For programs; lengths in mm, joints in deg, or mm on a rail.
[[nodiscard]] nlohmann::ordered_json work_json(const WorkAsked& work, const WorkVersions& versions,
                                               const Chain& robot);
/// The output of work_json() for people.
[[nodiscard]] std::string work_text(const nlohmann::ordered_json& work);

}  // namespace trammel
