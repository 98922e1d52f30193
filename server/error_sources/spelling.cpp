#include "server/error_sources/spelling.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <set>
#include <sstream>

#include "server/base/near_miss.h"
#include "server/error_sources/instruments.h"
#include "server/error_sources/joint_map.h"

namespace trammel {

namespace {

using causes::Form;
using causes::Lasting;
using causes::Scope;

constexpr double kMostPoses = 1e6;  // in a batch, for steps

/// Older names of causes, in models and cell files from before 2026-11-23.
constexpr std::array<std::pair<std::string_view, std::string_view>, 2> kFormerNames = {
    {{"link_weights", "self_weight"}, {"base_yielding", "base_compliance"}}};

std::string cause_in(const std::string& spec) { return spec.substr(0, spec.find_first_of(":@")); }

std::string as_named_today(const std::string& spec) {
  const std::string name = cause_in(spec);
  for (const auto& [former, now] : kFormerNames) {
    if (name == former) return std::string(now) + spec.substr(name.size());
  }
  return spec;
}

template <typename Number>
bool parse_number(const std::string& text, Number& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && !text.empty();
}

Result<SourceSpec> parse_spec(const std::string& text, const CauseRecord& known, const Cell& cell) {
  SourceSpec spec{text, cause_in(text), -1, {}};
  const std::size_t at = text.find('@');
  const std::size_t colon = text.substr(0, at).find(':');
  if (known.scope != Scope::kJoint) {
    if (colon != std::string::npos)
      return failure(ErrorCode::kUsage, "error source '{}' takes no joint", text);
  } else {
    int joint = 0;
    const std::string number =
        colon == std::string::npos ? "" : text.substr(colon + 1, at - colon - 1);
    if (!parse_number(number, joint) || joint < 1 || joint > cell.robot.size()) {
      return failure(ErrorCode::kUsage,
                     "error source '{}': expected {}:joint with a joint of 1 to {}", text,
                     spec.name, cell.robot.size());
    }
    spec.joint = joint - 1;
  }
  if (at != std::string::npos) {
    if (!known.takes_numbers && known.lasting != Lasting::kFromAPose)
      return failure(ErrorCode::kUsage, "error source '{}' takes nothing after '@'", text);
    std::istringstream numbers(text.substr(at + 1) + "+");
    for (std::string word; std::getline(numbers, word, '+');) {
      double value = 0;
      if (!parse_number(word, value) || !(value > 0) || !std::isfinite(value)) {
        return failure(ErrorCode::kUsage,
                       "error source '{}': '{}' after '@' is not a number above 0", text, word);
      }
      spec.at.push_back(value);
    }
  }
  const std::size_t most = known.takes_numbers ? 3 : 1;
  if (known.lasting == Lasting::kFromAPose &&
      (spec.at.empty() || spec.at.size() > most || spec.at[0] != std::floor(spec.at[0]) ||
       spec.at[0] > kMostPoses)) {
    return failure(ErrorCode::kUsage,
                   "error source '{}': expected {}@pose, the row of the batch at which it begins",
                   text, text.substr(0, at));
  }
  return spec;
}

bool is_earlier(const CauseRecord* one, const CauseRecord* other) {
  return std::pair(one->acts.on, one->acts.turn) < std::pair(other->acts.on, other->acts.turn);
}

}  // namespace

std::vector<std::string> known_causes() {
  std::vector<const CauseRecord*> records = all_causes();
  std::stable_sort(records.begin(), records.end(), is_earlier);
  std::vector<std::string> names;
  for (const CauseRecord* record : records) {
    for (const Form& form : record->forms) names.emplace_back(form.spelling);
  }
  return names;
}

bool acts_before(const ErrorSource& one, const ErrorSource& other) {
  return is_earlier(&one.cause(), &other.cause());
}

std::vector<std::string> alternatives(const std::string& spec, const Cell& cell) {
  const CauseRecord* record = find_cause(spec);
  if (record == nullptr || record->forms.size() < 2 || spec != record->spelling) return {spec};
  const std::size_t count = record->forms_differ(cell) ? record->forms.size() : 1;
  std::vector<std::string> spellings;
  for (std::size_t k = 0; k < count; ++k) spellings.emplace_back(record->forms[k].spelling);
  return spellings;
}

Result<ErrorSourcePtr> make_error_source(const std::string& given, const Cell& cell) {
  const std::string spec = as_named_today(given);
  if (is_of_instruments(spec)) return make_instrument_source(spec, cell);
  const CauseRecord* known = find_cause(spec);
  if (known == nullptr || known->forms.empty()) {
    std::vector<std::string> names = known_causes();
    for (const CauseRecord* record : all_causes()) {
      if (record->forms.size() > 1) names.emplace(names.begin(), record->spelling);
    }
    return failure(ErrorCode::kUsage, "unknown error source '{}'{}", spec,
                   did_you_mean(cause_in(spec), names))
        .of("error_sources")
        .with_text(spec)
        .next(fmt::format("levels are M0 to M3, more sources are joined by commas; known: {}",
                          fmt::join(names, ", ")));
  }
  if (const auto forms = alternatives(spec, cell); forms.front() != spec)
    return make_error_source(forms.front(), cell);
  const auto form = std::find_if(known->forms.begin(), known->forms.end(),
                                 [&](const Form& one) { return one.spelling == cause_in(spec); });
  if (form == known->forms.end())
    return failure(ErrorCode::kUsage, "error source '{}' takes nothing behind its name", spec)
        .of("error_sources")
        .with_text(spec);
  return parse_spec(spec, *known, cell)
      .and_then([&](const SourceSpec& parsed) { return form->make(parsed, cell); })
      .map_error([&](Error error) {
        return Failure(std::move(error)).of("error_sources").with_text(spec).value();
      });
}

std::vector<std::string> spelled_out(const std::vector<std::string>& specs, const Cell& cell) {
  const Chain& robot = cell.robot;
  std::vector<std::string> all;
  for (const std::string& spec : specs) {
    const std::size_t star = spec.substr(0, spec.find('@')).find(":*");
    const CauseRecord* record = find_cause(spec);
    if (star == std::string::npos || record == nullptr || record->scope != Scope::kJoint) {
      all.push_back(spec);
      continue;
    }
    for (int joint = 0; joint < robot.size(); ++joint) {
      if (record->of_turning_joint && robot.joint(joint).type != JointType::kRevolute) continue;
      all.push_back(fmt::format("{}:{}{}", spec.substr(0, star), joint + 1, spec.substr(star + 2)));
    }
  }
  return all;
}

bool are_forms_of_one(const std::string& source, const std::string& other) {
  if (source == other) return true;
  const CauseRecord* record = find_cause(source);
  return record != nullptr && record->forms.size() > 1 && record == find_cause(other);
}

std::string as_listed(const std::string& source, const std::vector<std::string>& list) {
  const auto listed = std::find_if(list.begin(), list.end(), [&](const std::string& spec) {
    const CauseRecord* record = find_cause(spec);
    if (record != nullptr && spec == record->spelling && are_forms_of_one(source, spec))
      return true;
    return spec == without_learned_spectrum(source);
  });
  return listed == list.end() ? source : *listed;
}

bool corrects(const std::vector<std::string>& sources, causes::Part part) {
  return std::any_of(sources.begin(), sources.end(), [&](const std::string& source) {
    const CauseRecord* record = find_cause(source);
    return record != nullptr && record->part == part;
  });
}

namespace {

/// The cause and its parts in words. Joint, number and place follow it as `:3`, `:d6`, `@40`.
std::string in_words(const CauseRecord& record, const std::string& spelling) {
  const std::size_t at = spelling.find('@');
  const std::size_t colon = spelling.substr(0, at).find(':');
  const std::string behind =
      colon == std::string::npos ? "" : spelling.substr(colon + 1, at - colon - 1);
  int joint = 0;
  const bool of_joint = parse_number(behind, joint);
  std::string words = plain_name(record, of_joint ? joint - 1 : -1);
  if (!behind.empty() && !of_joint) words += fmt::format(" ({})", behind);
  if (at != std::string::npos && record.lasting == Lasting::kFromAPose)
    words +=
        fmt::format(" from row {} on", spelling.substr(at + 1, spelling.find('+', at) - at - 1));
  return words;
}

}  // namespace

std::string in_words(const std::string& spelling) {
  const CauseRecord* record = find_cause(spelling);
  return record == nullptr ? spelling : in_words(*record, spelling);
}

Result<std::vector<std::string>> parse_level(const std::string& level) {
  std::vector<std::string> names;
  std::istringstream words(level);
  for (std::string word; std::getline(words, word, ',');) {
    word.erase(std::remove(word.begin(), word.end(), ' '), word.end());
    if (word.empty())
      return failure(ErrorCode::kUsage, "level '{}': an empty entry", level)
          .of("level")
          .with_text(level);
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
    return failure(ErrorCode::kUsage, "an empty level")
        .of("level")
        .next("expected M0, M1, M2, M3 or error sources");
  if (std::set<std::string>(names.begin(), names.end()).size() != names.size()) {
    return failure(ErrorCode::kUsage, "level '{}': an error source twice", level)
        .of("level")
        .with_text(level);
  }
  return names;
}

std::vector<std::string> standard_sources() { return parse_level("M3").value(); }

std::string level_of(const std::vector<std::string>& sources) {
  return sources.empty() ? "M0" : fmt::format("{}", fmt::join(sources, ","));
}

}  // namespace trammel
