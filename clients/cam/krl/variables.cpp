#include "clients/cam/krl/variables.h"

#include <fmt/format.h>

#include <algorithm>

#include "clients/cam/krl/statements.h"
#include "server/base/letters.h"
#include "server/base/plain_text.h"

namespace trammel::cam::krl {

namespace {

constexpr int kDeepest = 20;  // calls within calls, names that stand for names

/// `FP1.TQ_STATE`, `FP1.POINT2[]`: parts of an FDAT that say nothing of tool, base or place.
bool is_without_place(const std::string& name) {
  const std::size_t part = name.find('.');
  if (part == std::string::npos) return false;
  const std::string what = name.substr(part + 1);
  return what == "TQ_STATE" || what == "POINT2" || what == "POINT2[]";
}

bool is_equal(const std::vector<Value>& a, const std::vector<Value>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const Value& one, const Value& other) {
                      return one.kind == other.kind && one.kind != Value::Kind::kOther &&
                             one.number == other.number && one.name == other.name &&
                             one.field_names == other.field_names &&
                             is_equal(one.field_values, other.field_values);
                    });
}

}  // namespace

std::string stem_of(const std::string& name) { return upper(name.substr(0, name.rfind('.'))); }

/// `XP[3].X` -> `XP[3]`
std::string root_of(const std::string& name) { return name.substr(0, name.find('.')); }

Variables::Variables(const std::vector<SourceFile>& files,
                     const std::vector<std::vector<Line>>& lines)
    : files_(files), lines_(lines) {}

void Variables::note_value(std::size_t f, std::size_t k) {
  note_value(f, k, 0);
  if (const std::size_t later = done_later(lines_[f][k].tokens); later > 0) note_value(f, k, later);
}

void Variables::note_value(std::size_t f, std::size_t k, std::size_t at) {
  const bool later = at > 0;
  const Tokens& tokens = lines_[f][k].tokens;
  static const std::set<std::string_view> kTypes = {"POS",  "E6POS", "FRAME", "AXIS", "E6AXIS",
                                                    "FDAT", "LDAT",  "PDAT",  "LOAD", "INT",
                                                    "REAL", "BOOL",  "CHAR"};
  bool declared = false;
  while (tokens[at].is("GLOBAL") || tokens[at].is("DECL") || tokens[at].is("CONST")) {
    declared |= tokens[at].is("DECL");
    ++at;
  }
  if ((declared || kTypes.contains(tokens[at].text)) && tokens[at + 1].is_word()) {
    ++at;
    declared_[std::string(tokens[at].text)].insert(stem_of(files_[f].name));
  }
  if (!tokens[at].is_word() || is_motion(tokens[at].text)) return;
  std::size_t next = at;
  const std::vector<Value> name = operands_at(tokens, at, &next);
  if (name.size() != 1 || name[0].kind != Value::Kind::kName) return;
  if (!tokens[next].is("=")) return;
  std::size_t end = next;
  std::vector<Value> operands = operands_at(tokens, next + 1, &end);
  if (is_without_place(name[0].name)) return;
  const std::string root = root_of(name[0].name);
  const auto key = std::pair(stem_of(files_[f].name), root);
  Variable& variable = variables_[key];
  if (later || root != name[0].name || root.find("[*]") != std::string::npos ||
      end < tokens.size()) {
    variable.changed = set_at(root, f, k);
    return;
  }
  variable.values.push_back({f, k, std::move(operands)});
  if (variable.values.size() > 1) variable.changed = set_at(root, f, k);
}

void Variables::note_parameters(std::size_t f, std::size_t k, std::size_t at) {
  const Tokens& tokens = lines_[f][k].tokens;
  for (; at + 1 < tokens.size(); ++at) {
    if ((!tokens[at].is("(") && !tokens[at].is(",")) || !tokens[at + 1].is_word()) continue;
    const std::string name(tokens[at + 1].text);
    declared_[name].insert(stem_of(files_[f].name));
    variables_[{stem_of(files_[f].name), name}].changed =
        fmt::format("{} is a parameter ({})", shown(spelled(name, f, k)), place(f, k));
  }
}

void Variables::note_handed_over(std::size_t f, std::size_t k, std::size_t at,
                                 const std::string& to) {
  const Tokens& tokens = lines_[f][k].tokens;
  std::size_t end = at;
  const std::vector<Value> name = operands_at(tokens, at, &end);
  const bool alone = tokens[end].is(",") || tokens[end].is(")");
  if (!alone || name.size() != 1 || name[0].kind != Value::Kind::kName) return;
  const std::string root = root_of(name[0].name);
  std::string& changed = variables_[{stem_of(files_[f].name), root}].changed;
  if (changed.empty())
    changed =
        fmt::format("{} may be set by {} ({})", shown(spelled(root, f, k)), shown(to), place(f, k));
}

void Variables::join_globals() {
  static const std::set<std::string> kOfTheController = {"TOOL_DATA", "BASE_DATA", "LOAD_DATA"};
  for (auto one = variables_.begin(); one != variables_.end();) {
    const auto& [stem, root] = one->first;
    const std::string word = root.substr(0, root.find('['));
    const auto known = declared_.find(word);
    std::set<std::string> owners;
    if (kOfTheController.contains(word))
      owners = {""};
    else if (known != declared_.end() && !known->second.contains(stem))
      owners = known->second;
    if (owners.empty() || owners.contains(stem)) {
      ++one;
      continue;
    }
    for (const std::string& owner : owners) merge(one->second, root, variables_[{owner, root}]);
    one = variables_.erase(one);
  }
}

void Variables::merge(const Variable& from, const std::string& root, Variable& into) const {
  if (into.changed.empty()) into.changed = from.changed;
  for (const Assigned& value : from.values) {
    const bool same = !into.values.empty() && is_equal(into.values[0].operands, value.operands);
    if (!into.values.empty() && !same) into.changed = set_at(root, value.file, value.line);
    if (!same) into.values.push_back(value);
  }
}

std::string Variables::set_at(const std::string& name, std::size_t f, std::size_t k) const {
  return fmt::format("{} is set at run time ({})", shown(spelled(name, f, k)), place(f, k));
}

std::string Variables::place(std::size_t f, std::size_t k) const {
  return fmt::format("{} line {}", files_[f].name, lines_[f][k].number);
}

std::string Variables::spelled(const std::string& name, std::size_t f, std::size_t k) const {
  const std::string word = name.substr(0, name.find('['));
  for (const Token token : lines_[f][k].tokens) {
    if (token.is_word() && token.is(word))
      return files_[f].text.substr(token.begin, token.end - token.begin) + name.substr(word.size());
  }
  return name;
}

const Variable* Variables::find(const std::string& name, std::size_t f) const {
  const auto own = variables_.find({stem_of(files_[f].name), name});
  if (own != variables_.end()) return &own->second;
  for (const auto& [key, variable] : variables_) {
    if (key.second == name) return &variable;
  }
  return nullptr;
}

const Variable* Variables::any_changed(const std::string& name, std::size_t f) const {
  const std::size_t index = name.find('[');
  const Variable* any =
      index == std::string::npos ? nullptr : find(name.substr(0, index) + "[*]", f);
  return any == nullptr || any->changed.empty() ? nullptr : any;
}

bool Variables::is_set(const std::string& name, std::size_t f) const {
  return any_changed(name, f) != nullptr || find(root_of(name), f) != nullptr;
}

Told<const Assigned*> Variables::value_of(const std::string& name, std::size_t f) const {
  // One element of an array is changed where any may be.
  if (const Variable* any = any_changed(name, f)) return because(any->changed);
  const Variable* variable = find(root_of(name), f);
  if (variable == nullptr)
    return because(fmt::format("{} is not in the files handed over", shown(name)));
  if (!variable->changed.empty()) return because(variable->changed);
  if (variable->values.empty())
    return because(fmt::format("{} has no value in the files", shown(name)));
  return &variable->values[0];
}

Told<Pose> Variables::frame_of(const std::vector<Value>& operands, std::size_t f, int depth) const {
  if (operands.empty() || depth > kDeepest) return because("it is not constant");
  Pose X = Pose::Identity();
  for (const Value& operand : operands) {
    const Told<Pose> one = frame_of(operand, f, depth);
    if (!one) return one;
    X = X * *one;
  }
  return X;
}

Told<Pose> Variables::frame_of(const Value& value, std::size_t f, int depth) const {
  if (value.kind == Value::Kind::kAggregate) {
    const Told<std::vector<double>> numbers = numbers_of(value, kPose);
    if (!numbers) return because(numbers.error());
    return pose_of(Coordinates::kAnglesZyx, *numbers);
  }
  if (value.kind != Value::Kind::kName) return because("it is not constant");
  if (value.name == "$NULLFRAME" || value.name == "$WORLD") return Pose::Identity();
  if (value.name == "$ROBROOT") return X_WB_;
  if (value.name.starts_with("$")) return because(fmt::format("{} decides it", shown(value.name)));
  const Told<const Assigned*> assigned = value_of(value.name, f);
  if (!assigned) return because(assigned.error());
  return frame_of((*assigned)->operands, (*assigned)->file, depth + 1);
}

Told<std::vector<double>> Variables::numbers_of(const Value& value,
                                                const std::array<const char*, 6>& fields) {
  std::vector<double> numbers;
  for (const char* name : fields) {
    const Value* field = value.field(name);
    if (field == nullptr) return because(fmt::format("it does not say {}", name));
    if (field->kind != Value::Kind::kNumber)
      return because(fmt::format("{} is not a constant number", name));
    numbers.push_back(field->number);
  }
  return numbers;
}

}  // namespace trammel::cam::krl
