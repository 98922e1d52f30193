#include "server/error_sources/error_source.h"

#include <algorithm>
#include <charconv>
#include <set>
#include <sstream>

#include "server/error_sources/sources.h"

namespace trammel {

namespace {

/// One line an error source. `per_joint`: its spec names a joint.
struct Known {
  const char* name;
  bool per_joint;
  Result<ErrorSourcePtr> (*make)(const Cell& cell, int joint);
};

constexpr Known kKnown[] = {
    {"base", false, make_base},
    {"tool", false, make_tool},
    {"geometry", false, make_geometry},
    {"compliance_first_order", false, make_compliance_first_order},
    {"compliance_equilibrium", false, make_compliance_equilibrium},
    {"compliance_linear", false, make_compliance_linear},
};

std::string known_names() {
  std::string names;
  for (const Known& known : kKnown) names += fmt::format("{}{}", names.empty() ? "" : ", ", known.name);
  return names;
}

}  // namespace

std::vector<std::string> alternatives(const std::string& spec) {
  if (spec != "compliance") return {spec};
  return {"compliance_first_order", "compliance_equilibrium", "compliance_linear"};
}

Result<ErrorSourcePtr> make_error_source(const std::string& spec, const Cell& cell) {
  if (const auto forms = alternatives(spec); forms.front() != spec) return make_error_source(forms.front(), cell);
  const std::size_t colon = spec.find(':');
  const std::string name = spec.substr(0, colon);
  const auto* known =
      std::find_if(std::begin(kKnown), std::end(kKnown), [&](const Known& k) { return name == k.name; });
  if (known == std::end(kKnown)) {
    return failure(ErrorCode::kUsage, "unknown error source '{}'; known: {}", spec, known_names());
  }
  if (!known->per_joint) {
    if (colon != std::string::npos) return failure(ErrorCode::kUsage, "error source '{}' takes no joint", spec);
    return known->make(cell, -1);
  }
  int joint = 0;
  const std::string number = colon == std::string::npos ? "" : spec.substr(colon + 1);
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), joint);
  if (error != std::errc() || end != number.data() + number.size() || joint < 1 || joint > cell.robot.size()) {
    return failure(ErrorCode::kUsage, "error source '{}': expected {}:joint with a joint of 1 to {}", spec, name,
                   cell.robot.size());
  }
  return known->make(cell, joint - 1);
}

Result<std::vector<std::string>> parse_level(const std::string& level) {
  std::vector<std::string> names;
  std::istringstream words(level);
  for (std::string word; std::getline(words, word, ',');) {
    word.erase(std::remove(word.begin(), word.end(), ' '), word.end());
    if (word.empty()) return failure(ErrorCode::kUsage, "level '{}': an empty entry", level);
    if (word == "M0") continue;
    if (word == "M1" || word == "M2" || word == "M3") {
      names.emplace_back("base");
      if (word != "M1") names.emplace_back("geometry");
      if (word == "M3") names.emplace_back("compliance");
    } else {
      names.push_back(word);
    }
  }
  if (level.empty()) return failure(ErrorCode::kUsage, "an empty level; expected M0, M1, M2, M3 or error sources");
  if (std::set<std::string>(names.begin(), names.end()).size() != names.size()) {
    return failure(ErrorCode::kUsage, "level '{}': an error source twice", level);
  }
  return names;
}

}  // namespace trammel
