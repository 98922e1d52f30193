#pragma once

#include <string>

#include "server/base/yaml_file.h"
#include "server/robot/gauge.h"

/// The values in cell and robot files. Each reader refuses with the key of the wrong value.
namespace trammel {

/// Three numbers within the size of any cell.
[[nodiscard]] Vector3 read_vector(const YamlMap& map, const std::string& key);
/// A direction of length 1.
[[nodiscard]] Vector3 read_direction(const YamlMap& map, const std::string& key);
/// Refuses a text that is no name of a tool, a payload or an anchor, under the rules for ids in
/// requests.
void check_key(const YamlMap& map, const std::string& name, const char* what);

/// The instruments of the cell: its tracker, and the anchors of others.
[[nodiscard]] Tracker read_tracker(const YamlMap& map);
[[nodiscard]] Anchors read_anchors(const YamlMap& map);

}  // namespace trammel
