#include "clients/cam/rapid/readings.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "clients/cam/rapid/expressions.h"
#include "clients/cam/rapid/motions.h"
#include "server/base/letters.h"
#include "server/base/plain_text.h"

namespace trammel::cam::rapid {

namespace {

using Kind = Expression::Kind;

}  // namespace

void Readings::find() {
  note_references();
  for (std::size_t m = 0; m < modules_.size(); ++m) note_readings(m);
}

/// Names in the targets of motions are treated there.
void Readings::note_names(const Expression& expression) {
  if (expression.kind == Kind::kName) named_.insert(expression.name);
  for (const Expression& part : expression.parts) note_names(part);
}

/// Declared targets that nothing moves to.
void Readings::list_unused() {
  for (std::size_t m = 0; m < modules_.size(); ++m) {
    for (const Declaration& declared : modules_[m].declarations) {
      const bool is_target = declared.type == "robtarget" || declared.type == "jointtarget";
      if (!is_target || declared.storage == Storage::kParameter || !declared.value) continue;
      const Expression& value = *declared.value;
      const auto place = places_.lower_bound({m, value.begin});
      const bool used = place != places_.end() && place->first == m && place->second < value.end;
      if (used || named_.contains(declared.name)) continue;
      const auto unknown = unknown_.find(&declared);
      if (unknown == unknown_.end())
        program_.left.push_back(
            {declared.spelled, m, declared.line, "", "no motion in these files goes to it"});
      else
        program_.left.push_back({declared.spelled, m, declared.line, unknown->second->spelled,
                                 fmt::format("{} is not known here: it may move the robot there",
                                             shown(unknown->second->spelled))});
    }
  }
}

/// Why the bytes at a place must stay as they are; empty: they need not.
std::string Readings::why_kept(const std::pair<std::size_t, std::size_t>& place,
                               const Declaration* declared) const {
  const auto behind = references_.upper_bound(place);
  if (behind != references_.begin()) {
    const auto& [begin, reference] = *std::prev(behind);
    if (begin.first == place.first && place.second < reference.end) return reference.why;
  }
  const auto read = read_.find(declared);
  return read == read_.end() ? "" : read->second;
}

/// `PDispOn\ExeP:=pFound,pRef,tGun`: how many of the first arguments are such.
std::size_t Readings::old_points(const std::string& name) {
  static const std::map<std::string, std::size_t> kOldPoints = {
      {"pdispon", 1}, {"defdframe", 3}, {"defaccframe", 1}};
  const auto known = kOldPoints.find(name);
  return known == kOldPoints.end() ? 0 : known->second;
}

void Readings::note_references() {
  std::set<const Declaration*> measured;  // `pRef:=p10;` hands on
  for (bool grows = true; grows;) {
    const std::size_t before = measured.size();
    for (std::size_t m = 0; m < modules_.size(); ++m) {
      for (const Instruction& instruction : modules_[m].instructions)
        note_references(instruction.name, instruction.spelled, instruction.arguments,
                        {m, instruction.routine}, measured);
      for (const Assignment& assignment : modules_[m].assignments) {
        const Scope at{m, assignment.routine};
        note_references(assignment.value, at, measured);
        const auto to = meaning_.find(root_of(assignment.target)->name, at);
        if (to && measured.contains(to->declaration))
          note_reference(assignment.value, at, root_text(assignment.target, m), assignment.line,
                         measured);
      }
    }
    grows = measured.size() > before;
  }
}

void Readings::note_references(const std::string& name, const std::string& spelled,
                               const std::vector<Expression>& arguments, const Scope& at,
                               std::set<const Declaration*>& measured) {
  std::size_t position = 0;
  for (const Expression& argument : arguments) {
    if (argument.label.empty() && position++ < old_points(name))
      note_reference(argument, at, spelled, argument.line, measured);
    note_references(argument, at, measured);
  }
}

void Readings::note_references(const Expression& expression, const Scope& at,
                               std::set<const Declaration*>& measured) {
  const std::string name = expression.kind == Kind::kCall ? expression.name.text() : "";
  note_references(name, name, expression.parts, at, measured);
}

void Readings::note_reference(const Expression& point, const Scope& at, const std::string& by,
                              int line, std::set<const Declaration*>& measured) {
  const auto named = meaning_.find(root_of(point)->name, at);
  if (named) measured.insert(named->declaration);
  for (const Scope* scope : meaning_.scopes_of(at.module, at.routine)) {
    const Told<std::vector<Data>> all = meaning_.data_of(point, *scope);
    for (const Data& data : all ? *all : std::vector<Data>{}) {
      references_.try_emplace(
          {data.scope->module, data.node->begin},
          Reference{data.node->end, fmt::format("a displacement is measured from it ({}, {})",
                                                shown(by), meaning_.place_of(at.module, line))});
    }
  }
}

void Readings::note_readings(std::size_t m) {
  const Module& module = modules_[m];
  for (const Assignment& assignment : module.assignments) {
    const std::string by = root_text(assignment.target, m);
    note_readings(m, {assignment.begin, assignment.end}, assignment.routine, assignment.line, by);
  }
  for (const Condition& condition : module.conditions)
    note_readings(m, {condition.begin, condition.end}, condition.routine, condition.line, "");
  for (const Instruction& instruction : module.instructions) {
    const bool motion = is_motion(instruction.name) && !meaning_.find_routine(instruction.name, m);
    const bool calls =
        std::any_of(instruction.arguments.begin(), instruction.arguments.end(),
                    [](const Expression& argument) { return argument.kind == Kind::kCall; });
    if (motion && !calls) continue;
    calls_routine_ = !motion && meaning_.find_routine(instruction.name, m).has_value();
    if (!motion && !calls_routine_) note_unknown(m, instruction);
    moves_ = motion;
    note_readings(m, {instruction.begin, instruction.end}, instruction.routine, instruction.line,
                  "");
    calls_routine_ = moves_ = false;
  }
}

/// The whole that a field or an element is a part of; another expression itself.
const Expression* Readings::root_of(const Expression& target) {
  const Expression* root = &target;
  while ((root->kind == Kind::kField || root->kind == Kind::kElement) && !root->parts.empty())
    root = &root->parts[0];
  return root;
}

std::string Readings::root_text(const Expression& target, std::size_t m) {
  return meaning_.text_of(*root_of(target), own(m));
}

void Readings::note_readings(std::size_t m, const Span& span, int routine, int line,
                             const std::string& by) {
  if (span.end <= span.begin) return;
  const std::string_view text =
      std::string_view(program_.files[m].text).substr(span.begin, span.end - span.begin);
  const Tokens tokens = tokens_of(text, kLexis);
  for (std::size_t k = 0; k < tokens.size(); ++k) {
    if (!tokens[k].is_word() || tokens[k + 1].is("(")) continue;
    if (tokens[k - 1].is(".") || tokens[k - 1].is("\\")) continue;
    std::size_t behind = k + 1;
    if (tokens[behind].is("{")) behind = tokens.find("}", behind) + 1;
    const bool has_field = tokens[behind].is(".");
    const int dots = (has_field ? 1 : 0) + (has_field && tokens[behind + 2].is(".") ? 1 : 0);
    note_reading({m, routine}, std::string(tokens[k].text), dots, line, by);
  }
}

void Readings::note_reading(const Scope& at, const std::string& spelled, int dots, int line,
                            const std::string& by) {
  Expression name;
  name.kind = Kind::kName;
  name.name = lower(spelled);
  const auto found = meaning_.find(name.name, at);
  if (!found || found->declaration->type == "num") return;
  const bool is_parameter = found->declaration->storage == Storage::kParameter;
  const std::vector<const Scope*> ways =
      is_parameter ? meaning_.scopes_of(at.module, at.routine) : std::vector<const Scope*>{&at};
  for (const Scope* scope : ways) {
    const Told<std::vector<Data>> all = meaning_.data_of(name, *scope);
    if (!all) continue;
    for (const Data& data : *all) {
      if (data.declared != nullptr && data.declared->value)
        add_reading(data, at, spelled, dots, line, by);
    }
  }
}

void Readings::add_reading(const Data& data, const Scope& at, const std::string& spelled, int dots,
                           int line, const std::string& by) {
  const Expression& value = *data.declared->value;
  const std::size_t file = data.scope->module;
  const auto place = places_.lower_bound({file, value.begin});
  if (place == places_.end() || place->first != file || place->second >= value.end) return;
  const bool is_target = data.declared->type == "robtarget" || data.declared->type == "jointtarget";
  const bool numbers = dots > (is_target ? 0 : 1);
  if (numbers && !moves_) {
    read_.emplace(data.declared, fmt::format("its numbers are read elsewhere too ({})",
                                             meaning_.place_of(at.module, line)));
    return;
  }
  if (calls_routine_) return;  // a reading by a called routine is treated there
  program_.readings.push_back(
      {file, {value.begin, value.end}, spelled, at.module, line, by, moves_});
}

/// `FCPressL p10,v50,...`, and procedures of modules that are not there, may be motions.
void Readings::note_unknown(std::size_t m, const Instruction& instruction) {
  static const std::set<std::string> kTakeTargets = {"wzhomejointdef", "wzlimjointdef",
                                                     "mtooltcpcalib",  "mtoolrotcalib",
                                                     "stooltcpcalib",  "stoolrotcalib"};
  if (is_still(instruction.name) || kTakeTargets.contains(instruction.name)) return;
  for (const Expression& argument : instruction.arguments) {
    for (const Scope* scope : meaning_.scopes_of(m, instruction.routine)) {
      const Told<std::vector<Data>> all = meaning_.data_of(*root_of(argument), *scope);
      for (const Data& data : all ? *all : std::vector<Data>{})
        unknown_.emplace(data.declared, &instruction);
    }
  }
}

}  // namespace trammel::cam::rapid
