#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace trammel::cam {

/// One instance of a type of ABB's system parameters: `-name "ROB_1" -base_frame_pos_x 1.5
/// -use_check`.
struct ParameterInstance {
  std::string type;  ///< `ROBOT`
  int line = 0;
  std::map<std::string, std::string>
      values;  ///< by attribute without its dash; a switch has an empty value

  [[nodiscard]] std::string text(const std::string& attribute) const {
    const auto found = values.find(attribute);
    return found == values.end() ? "" : found->second;
  }
};

/// The instances of a configuration file, in order. Other lines are skipped, so a file never fails.
[[nodiscard]] std::vector<ParameterInstance> parameter_instances(std::string_view text);

}  // namespace trammel::cam
