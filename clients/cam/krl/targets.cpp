#include "clients/cam/krl/targets.h"

#include <fmt/format.h>

#include <algorithm>

#include "clients/cam/keep.h"
#include "clients/cam/krl/statements.h"

namespace trammel::cam::krl {

std::string Targets::describe(const Site& site, ProgramTarget& target) const {
  const Assigned& place = places_.at({site.file, site.begin});
  target.line = lines_[place.file][place.line].number;
  if (const auto read = read_.find({site.file, site.begin}); read != read_.end())
    return read->second;
  const Value& first = place.operands[0];
  if (place.operands.size() == 1 && first.kind == Value::Kind::kAggregate) {
    if (first.field("A1") != nullptr) return describe_axes(first, target);
    const Told<std::vector<double>> numbers = names_.numbers_of(first, kPose);
    if (!numbers) return numbers.error();
    target.coordinates = Coordinates::kAnglesZyx;
    target.numbers = *numbers;
    rewrite(first, kPose, target);
    note_rest(first, target);
    return "";
  }
  const Told<Pose> pose = names_.frame_of(place.operands, place.file);
  if (!pose) return pose.error();
  target.coordinates = Coordinates::kAnglesZyx;
  target.numbers = cam::numbers_of(Coordinates::kAnglesZyx, *pose, std::vector<double>(6, 0.0));
  const Value* last = last_of(place.operands, place.file);
  if (last != nullptr) note_rest(*last, target);
  fold(place, last, target);
  return "";
}

std::string Targets::describe_axes(const Value& value, ProgramTarget& target) const {
  if (options_.keep_joints) return "joint targets are kept (--keep-joints)";
  const Told<std::vector<double>> numbers = names_.numbers_of(value, kAxes);
  if (!numbers) return numbers.error();
  target.coordinates = Coordinates::kJoints;
  target.numbers = *numbers;
  rewrite(value, kAxes, target);
  note_rest(value, target);
  return "";
}

void Targets::rewrite(const Value& value, const std::array<const char*, 6>& fields,
                      ProgramTarget& target) const {
  const std::string& text = program_.files[target.file].text;
  for (std::size_t k = 0; k < fields.size(); ++k) {
    const Value& number = *value.field(fields[k]);
    const auto written =
        read_number(std::string_view(text).substr(number.begin, number.end - number.begin));
    keep({number.begin, number.end}, k, written ? written->style : with_decimals(kDecimals),
         target);
  }
}

const Value* Targets::last_of(const std::vector<Value>& operands, std::size_t file) const {
  const Value& last = operands.back();
  if (last.kind != Value::Kind::kName) return &last;
  const Told<const Assigned*> named = names_.value_of(last.name, file);
  return named && (*named)->operands.size() == 1 ? &(*named)->operands[0] : nullptr;
}

std::string Targets::rest_of(const Value* value) {
  std::string text;
  if (value == nullptr || value->kind != Value::Kind::kAggregate) return text;
  for (std::size_t k = 0; k < value->field_names.size(); ++k) {
    const std::string& name = value->field_names[k];
    if (name == "S" || name == "T" || (name.size() == 2 && name[0] == 'E'))
      text += fmt::format(",{} {}", name, value->field_values[k].number);
  }
  return text;
}

/// The whole expression as one frame, with status, turns and external axes of its last operand.
void Targets::fold(const Assigned& place, const Value* last, ProgramTarget& target) const {
  const std::string& text = program_.files[place.file].text;
  const Span span{place.operands.front().begin, place.operands.back().end};
  NewText whole(span, "{X ");
  for (std::size_t k = 0; k < kPose.size(); ++k) {
    if (k > 0) whole.text(fmt::format(",{} ", kPose[k]));
    whole.number(k, kDecimals);
  }
  std::move(whole.text(rest_of(last) + "}")).fold(target);
  keep_original(text, span.begin, ";", text.substr(span.begin, span.end - span.begin), target);
}

/// Status, turns and external axes.
void Targets::note_rest(const Value& value, ProgramTarget& target) {
  const auto number = [&](const char* name) -> std::optional<double> {
    const Value* field = value.field(name);
    const bool known = field != nullptr &&
                       (field->kind == Value::Kind::kNumber || field->kind == Value::Kind::kBits);
    return known ? std::optional<double>(field->number) : std::nullopt;
  };
  for (int k = 0; k < 6; ++k) {
    if (const auto axis = number(fmt::format("E{}", k + 1).c_str())) target.external[k] = *axis;
  }
  if (target.coordinates == Coordinates::kJoints) return;
  Configuration& said = target.configuration;
  if (const auto status = number("S"); status && *status >= 0) {
    const auto bits = static_cast<unsigned>(*status);
    said.behind_axis_1 = (bits & 1U) != 0;
    said.larger_joint_3 = (bits & 2U) != 0;
    said.signs.resize(6);
    said.signs[4] = (bits & 4U) != 0 ? -1 : 1;
  }
  if (const auto turns = number("T"); turns && *turns >= 0) {
    const auto bits = static_cast<unsigned>(*turns);
    said.signs.resize(6);
    for (std::size_t j = 0; j < 6; ++j) said.signs[j] = ((bits >> j) & 1U) != 0 ? -1 : 1;
  }
}

/// Records other statements that read the rewritten targets.
void Targets::note_readings(std::size_t f) {
  if (targets_.empty()) {
    for (const auto& [key, variable] : names_.all()) {
      if (variable.values.size() != 1 || variable.values[0].operands.empty()) continue;
      const Assigned& at = variable.values[0];
      if (!places_.contains({at.file, at.operands[0].begin})) continue;
      targets_.emplace(key.second, &at);
      words_of_targets_.insert(key.second.substr(0, key.second.find('[')));
    }
  }
  for (std::size_t k = 0; k < lines_[f].size(); ++k) {
    const Tokens& tokens = lines_[f][k].tokens;
    for (std::size_t at = 0; at < tokens.size(); ++at) {
      if (tokens[at].is_word() && words_of_targets_.contains(std::string(tokens[at].text)))
        note_reading(f, k, at);
    }
  }
}

void Targets::note_reading(std::size_t f, std::size_t k, std::size_t at) {
  const Tokens& tokens = lines_[f][k].tokens;
  std::size_t end = at;
  const std::vector<Value> one = operands_at(tokens, at, &end);
  if (one.empty() || one[0].name.empty()) return;
  const std::string root = root_of(one[0].name);
  const bool number = root != one[0].name;
  const bool moves = is_motion(tokens[0].text) || is_relative(tokens[0].text);
  const bool plain = one.size() == 1 && !tokens[at - 1].is(":");
  if (moves && !number && plain) return;  // it is the target of the motion
  const auto own = names_.all().find({stem_of(program_.files[f].name), root});
  if (own != names_.all().end()) {
    if (own->second.values.size() == 1) add_reading(f, k, at, number, own->second.values[0]);
  } else if (const auto other = targets_.find(root); other != targets_.end()) {
    add_reading(f, k, at, number, *other->second);
  } else if (root.ends_with("[*]")) {
    const std::string beginning = root.substr(0, root.size() - 2);
    for (auto any = targets_.lower_bound(beginning);
         any != targets_.end() && any->first.starts_with(beginning); ++any)
      add_reading(f, k, at, number, *any->second);
  }
}

void Targets::add_reading(std::size_t f, std::size_t k, std::size_t at, bool number,
                          const Assigned& source) {
  if (source.operands.empty() || (source.file == f && source.line == k)) return;
  const auto where = std::pair(source.file, source.operands[0].begin);
  if (!places_.contains(where)) return;
  const Tokens& tokens = lines_[f][k].tokens;
  const bool moves = is_motion(tokens[0].text) || is_relative(tokens[0].text);
  const std::string& text = program_.files[f].text;
  static const std::set<std::string_view> kConditions = {"IF",   "WHILE", "UNTIL", "SWITCH",
                                                         "CASE", "FOR",   "WAIT"};
  std::string by;
  for (std::size_t k2 = 1; k2 < at && !moves && !kConditions.contains(tokens[0].text); ++k2) {
    if (!tokens[k2].is("=") || !tokens[k2 - 1].is_word()) continue;
    by = text.substr(tokens[k2 - 1].begin, tokens[k2 - 1].end - tokens[k2 - 1].begin);
  }
  if (number && !moves) {
    read_.emplace(where,
                  fmt::format("its numbers are read elsewhere too ({})", names_.place(f, k)));
    return;
  }
  const Line& line = lines_[f][k];
  program_.readings.push_back({source.file,
                               {source.operands.front().begin, source.operands.back().end},
                               text.substr(tokens[at].begin, tokens[at].end - tokens[at].begin),
                               f,
                               line.number,
                               by,
                               moves});
}

/// Positions of data lists that nothing moves to.
void Targets::list_unused() {
  for (const auto& one : names_.all()) {
    const auto& [key, variable] = one;
    const std::string& name = key.second;
    const bool is_position = variable.values.size() == 1 &&
                             variable.values[0].operands.size() == 1 &&
                             variable.values[0].operands[0].field("X") != nullptr &&
                             variable.values[0].operands[0].field("S") != nullptr;
    if (!is_position) continue;
    const Assigned& at = variable.values[0];
    const bool listed =
        std::any_of(program_.left.begin(), program_.left.end(),
                    [&](const LeftAlone& left) { return upper(left.name) == name; });
    if (places_.contains({at.file, at.operands[0].begin}) || listed) continue;
    leave_unused(program_, names_.spelled(name, at.file, at.line), at.file,
                 lines_[at.file][at.line].number);
  }
}

}  // namespace trammel::cam::krl
