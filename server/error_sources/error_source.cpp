#include "server/error_sources/error_source.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>
#include <sstream>

#include "server/base/near_miss.h"
#include "server/error_sources/sources.h"

namespace trammel {

namespace {

constexpr double kMostPoses = 1e6;  // in a batch, for steps

enum class Joint { kNone, kOne };
enum class At { kNone, kPose, kNumbers };

/// One line an error source, in the order in which they act on the arm.
struct Known {
  const char* name;
  Joint joint;  // whether a spec names a joint
  At at;        // what may follow the @
  SourceMaker make;
};

constexpr Known kKnown[] = {
    {"base", Joint::kNone, At::kNone, make_base},
    {"tracker_drift", Joint::kNone, At::kNone, make_tracker_drift},
    {"tracker_moved", Joint::kNone, At::kPose, make_tracker_moved},
    {"geometry", Joint::kNone, At::kNone, make_geometry},
    {"thermal_growth", Joint::kNone, At::kNone, make_thermal_growth},
    {"tool", Joint::kNone, At::kNone, make_tool},
    {"tool_changed", Joint::kNone, At::kPose, make_tool_changed},
    {"gear_transmission", Joint::kOne, At::kNumbers, make_gear_transmission},
    {"encoder_eccentricity", Joint::kOne, At::kNone, make_encoder_eccentricity},
    {"joint_map", Joint::kOne, At::kNumbers, make_joint_map},
    {"wrist_coupling", Joint::kNone, At::kNone, make_wrist_coupling},
    {"joint_slip", Joint::kOne, At::kPose, make_joint_slip},
    {"time_lag", Joint::kNone, At::kNone, make_time_lag},
    {"payload", Joint::kNone, At::kNone, make_payload},
    {"payload_changed", Joint::kNone, At::kPose, make_payload_changed},
    {"backlash", Joint::kOne, At::kNone, make_backlash},
    {"link_bending", Joint::kOne, At::kNone, make_link_bending},
    {"compliance_first_order", Joint::kNone, At::kNone, make_compliance_first_order},
    {"compliance_equilibrium", Joint::kNone, At::kNone, make_compliance_equilibrium},
    {"compliance_linear", Joint::kNone, At::kNone, make_compliance_linear},
};

std::string cause_of(const std::string& spec) { return spec.substr(0, spec.find_first_of(":@")); }

const Known* find_known(const std::string& cause) {
  const auto* known =
      std::find_if(std::begin(kKnown), std::end(kKnown), [&](const Known& k) { return cause == k.name; });
  return known == std::end(kKnown) ? nullptr : known;
}

template <typename Number>
bool parse_number(const std::string& text, Number& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && !text.empty();
}

Result<SourceSpec> parse_spec(const std::string& text, const Known& known, const Cell& cell) {
  SourceSpec spec{text, known.name, -1, {}};
  const std::size_t at = text.find('@');
  const std::size_t colon = text.substr(0, at).find(':');
  if (known.joint == Joint::kNone) {
    if (colon != std::string::npos) return failure(ErrorCode::kUsage, "error source '{}' takes no joint", text);
  } else {
    int joint = 0;
    const std::string number = colon == std::string::npos ? "" : text.substr(colon + 1, at - colon - 1);
    if (!parse_number(number, joint) || joint < 1 || joint > cell.robot.size()) {
      return failure(ErrorCode::kUsage, "error source '{}': expected {}:joint with a joint of 1 to {}", text,
                     known.name, cell.robot.size());
    }
    spec.joint = joint - 1;
  }
  if (at != std::string::npos) {
    if (known.at == At::kNone) return failure(ErrorCode::kUsage, "error source '{}' takes nothing after '@'", text);
    std::istringstream numbers(text.substr(at + 1) + "+");
    for (std::string word; std::getline(numbers, word, '+');) {
      double value = 0;
      if (!parse_number(word, value) || !(value > 0) || !std::isfinite(value)) {
        return failure(ErrorCode::kUsage, "error source '{}': '{}' after '@' is not a number above 0", text, word);
      }
      spec.at.push_back(value);
    }
  }
  if (known.at == At::kPose &&
      (spec.at.size() != 1 || spec.at[0] != std::floor(spec.at[0]) || spec.at[0] > kMostPoses)) {
    return failure(ErrorCode::kUsage, "error source '{}': expected {}@pose, the row of the batch at which it begins",
                   text, text.substr(0, at));
  }
  return spec;
}

}  // namespace

std::vector<std::string> known_causes() {
  std::vector<std::string> names;
  for (const Known& known : kKnown) names.emplace_back(known.name);
  return names;
}

int acting_order(const std::string& source_name) {
  const Known* known = find_known(cause_of(source_name));
  return known == nullptr ? 0 : static_cast<int>(known - std::begin(kKnown));
}

std::vector<std::string> alternatives(const std::string& spec, const Cell& cell) {
  if (spec != "compliance") return {spec};
  if (cell.payloads.empty() && !cell.robot.has_link_masses()) return {"compliance_first_order"};
  return {"compliance_first_order", "compliance_equilibrium", "compliance_linear"};
}

Result<ErrorSourcePtr> make_error_source(const std::string& spec, const Cell& cell) {
  if (const auto forms = alternatives(spec, cell); forms.front() != spec) return make_error_source(forms.front(), cell);
  const Known* known = find_known(cause_of(spec));
  if (known == nullptr) {
    std::vector<std::string> names = {"compliance"};
    for (std::string& name : known_causes()) names.push_back(std::move(name));
    return failure(ErrorCode::kUsage, "unknown error source '{}'{}", spec, did_you_mean(cause_of(spec), names))
        .of("error_sources")
        .with_text(spec)
        .next(fmt::format("known: {}", fmt::join(names, ", ")));
  }
  return parse_spec(spec, *known, cell)
      .and_then([&](const SourceSpec& parsed) { return known->make(parsed, cell); })
      .map_error([&](Error error) { return Failure(std::move(error)).of("error_sources").with_text(spec).value(); });
}

Result<std::vector<std::string>> parse_level(const std::string& level) {
  std::vector<std::string> names;
  std::istringstream words(level);
  for (std::string word; std::getline(words, word, ',');) {
    word.erase(std::remove(word.begin(), word.end(), ' '), word.end());
    if (word.empty())
      return failure(ErrorCode::kUsage, "level '{}': an empty entry", level).of("level").with_text(level);
    if (word == "M0") continue;
    if (word == "M1" || word == "M2" || word == "M3") {
      names.emplace_back("base");
      if (word != "M1") names.emplace_back("geometry");
      if (word == "M3") names.emplace_back("compliance");
    } else {
      names.push_back(word);
    }
  }
  if (level.empty())
    return failure(ErrorCode::kUsage, "an empty level").of("level").next("expected M0, M1, M2, M3 or error sources");
  if (std::set<std::string>(names.begin(), names.end()).size() != names.size()) {
    return failure(ErrorCode::kUsage, "level '{}': an error source twice", level).of("level").with_text(level);
  }
  return names;
}

std::string level_of(const std::vector<std::string>& sources) {
  return sources.empty() ? "M0" : fmt::format("{}", fmt::join(sources, ","));
}

}  // namespace trammel
