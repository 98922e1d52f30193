#include "clients/cam/short_names.h"

#include <fmt/format.h>

namespace trammel::cam {

bool is_text_of_target(const std::string& name) {
  // An index has one number: `hole[3]`, `PR[1]`. The text of a target has several.
  if (name.find('{') != std::string::npos) return name.find_first_of(",:") != std::string::npos;
  for (std::size_t at = name.find('['); at != std::string::npos; at = name.find('[', at + 1)) {
    if (name.find(',', at) < name.find(']', at)) return true;
  }
  return false;
}

std::string short_name(int ordinal, int line) {
  return fmt::format("point {} at line {}", ordinal, line);
}

std::vector<std::string> counted(const std::vector<std::string>& sentences) {
  std::vector<std::string> once;
  std::map<std::string, int> times;
  for (const std::string& sentence : sentences)
    if (++times[sentence] == 1) once.push_back(sentence);
  for (std::string& sentence : once)
    if (const int n = times[sentence]; n > 1) sentence += fmt::format(" ({} times)", n);
  return once;
}

}  // namespace trammel::cam
