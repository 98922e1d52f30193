#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "clients/cam/rapid/interpreter.h"
#include "server/base/letters.h"
#include "server/base/plain_text.h"

// Data that change at run time.
namespace trammel::cam::rapid {

namespace {

using Kind = Expression::Kind;

/// Instructions that do not change their arguments.
bool only_reads(const std::string& name) {
  static const std::set<std::string> kMotions = {"move", "trig", "arc",  "spot",
                                                 "disp", "pain", "capl", "capc"};
  if (is_still(name)) return true;
  for (const std::string& beginning : kMotions) {
    if (name.starts_with(beginning)) return true;
  }
  return false;
}

constexpr const char* kFindsLoads = "loadid";

/// Which argument of an instruction is the tool that it measures: `MToolTCPCalib
/// jos1,jos2,jos3,jos4,tGun,max,mean;`.
std::size_t tool_found_by(const std::string& instruction) {
  static const std::map<std::string, std::size_t> kFound = {{"mtooltcpcalib", 4},
                                                            {"stooltcpcalib", 4},
                                                            {"mtoolrotcalib", 2},
                                                            {"stoolrotcalib", 3},
                                                            {kFindsLoads, 2}};
  const auto found = kFound.find(instruction);
  return found == kFound.end() ? std::string::npos : found->second;
}

bool sets_by_name(const std::string& instruction) {
  return instruction == "setdataval" || instruction == "setalldataval";
}

bool is_literal(const Expression& expression) {
  switch (expression.kind) {
    case Kind::kNumber:
    case Kind::kText:
    case Kind::kTruth:
      return true;
    case Kind::kUnary:
    case Kind::kAggregate:
      return std::all_of(expression.parts.begin(), expression.parts.end(), is_literal);
    default:
      return false;
  }
}

}  // namespace

std::string Interpreter::changed(const Declaration* declaration) const {
  const auto it = changed_.find(declaration);
  return it == changed_.end() ? "" : it->second;
}

void Interpreter::note_change(const Expression& target, const Scope& scope,
                              const std::string& why) {
  const Expression* root = name_in(target);
  if (root == nullptr) return;
  const auto found = find(root->name, scope);
  if (found && found->declaration->storage != Storage::kConst)
    changed_.emplace(found->declaration, why);
}

void Interpreter::note_changes() {
  for (std::size_t m = 0; m < modules_.size(); ++m) {
    for (const Assignment& assignment : modules_[m].assignments) {
      const Expression* root = name_in(assignment.target);
      if (root == nullptr) continue;
      const std::string why =
          fmt::format("{} is set at run time ({})", text_of(*root, {m, assignment.routine}),
                      place_of(m, assignment.line));
      if (auto part = constant_part(assignment, m)) {
        set_in_order_.emplace(part->of, why);
        parts_.emplace(&assignment, std::move(*part));
      } else {
        note_change(assignment.target, *own_scope(m, assignment.routine), why);
      }
    }
  }
  // A change of a parameter changes the caller's argument, through any number of calls.
  std::size_t before = 0;
  do {
    before = changed_.size();
    for (std::size_t m = 0; m < modules_.size(); ++m) {
      for (const Instruction& instruction : modules_[m].instructions)
        note_changes_by(m, instruction);
    }
    note_changes_by_tasks();
  } while (changed_.size() > before);
}

/// A persistent that tasks share is one variable: a value set by one task is seen by the others.
void Interpreter::note_changes_by_tasks() {
  struct Shared {
    std::set<std::string> tasks;
    std::vector<const Declaration*> declared;
    std::string why;
  };
  std::map<std::string, Shared> by_name;
  for (std::size_t m = 0; m < modules_.size(); ++m) {
    for (const Declaration& declared : modules_[m].declarations) {
      if (!is_shared(declared)) continue;
      if (const auto elsewhere = set_elsewhere_.find(declared.name);
          elsewhere != set_elsewhere_.end())
        changed_.emplace(&declared, elsewhere->second);
      if (tasks_[m].empty()) continue;
      Shared& shared = by_name[declared.name];
      shared.tasks.insert(tasks_[m]);
      shared.declared.push_back(&declared);
      for (const auto* changes : {&changed_, &set_in_order_}) {
        if (const auto change = changes->find(&declared); change != changes->end())
          shared.why = change->second;
      }
    }
  }
  for (const auto& [name, shared] : by_name) {
    if (shared.tasks.size() < 2 || shared.why.empty()) continue;
    for (const Declaration* declared : shared.declared) changed_.emplace(declared, shared.why);
  }
}

bool Interpreter::is_shared(const Declaration& declared) {
  return declared.storage == Storage::kPers && declared.routine < 0 && !declared.local &&
         !declared.of_task;
}

std::map<std::string, std::string> Interpreter::set_for_all_tasks() const {
  std::map<std::string, std::string> set;
  for (const auto* changes : {&changed_, &set_in_order_}) {
    for (const auto& [declared, why] : *changes) {
      if (is_shared(*declared)) set.emplace(declared->name, why);
    }
  }
  return set;
}

std::string Interpreter::load_found(const Declaration* tool) const {
  const auto found = load_found_.find(tool);
  return found == load_found_.end() ? "" : found->second;
}

/// `SetDataVal "p10",pNew;`: the name is a text, so that any data of the type may be meant.
/// `SetAllDataVal` sets all.
void Interpreter::note_changes_by_name(std::size_t module, const Instruction& instruction) {
  std::vector<const Expression*> positional;
  for (const Expression& argument : instruction.arguments) {
    if (argument.label.empty()) positional.push_back(&argument);
  }
  if (positional.size() < 2) return;
  const Scope& scope = *own_scope(module, instruction.routine);
  const std::string why =
      fmt::format("{} may set it ({})", instruction.spelled, place_of(module, instruction.line));
  const std::string text = positional[0]->kind == Kind::kText ? text_of(*positional[0], scope) : "";
  if (instruction.name == "setdataval" && text.size() > 2) {
    const auto found = find(lower(text.substr(1, text.size() - 2)), scope);
    if (found && found->declaration->storage != Storage::kConst)
      changed_.emplace(found->declaration, why);
    return;
  }
  const std::string type = type_of(*positional[1], scope);
  for (const Module& any : modules_) {
    for (const Declaration& declared : any.declarations) {
      const bool may_be_set =
          declared.storage == Storage::kPers || declared.storage == Storage::kVar;
      if (may_be_set && (type.empty() || declared.type == type)) changed_.emplace(&declared, why);
    }
  }
}

std::optional<Interpreter::Part> Interpreter::constant_part(const Assignment& assignment,
                                                            std::size_t module) const {
  const Expression* root = name_in(assignment.target);
  const auto found =
      root == nullptr ? std::nullopt : find(root->name, {module, assignment.routine});
  if (!found || found->module != module || !is_literal(assignment.value)) return std::nullopt;
  const Declaration& declared = *found->declaration;
  const bool is_setting = declared.type == "tooldata" || declared.type == "wobjdata";
  // Expressions call functions, and the reader does not follow the order within expressions.
  if (assignment.routine >= 0 &&
      modules_[module].routines[static_cast<std::size_t>(assignment.routine)].is_function)
    return std::nullopt;
  if (!is_setting || declared.is_array ||
      (declared.storage != Storage::kPers && declared.storage != Storage::kVar))
    return std::nullopt;
  auto fields = fields_of(assignment.target, declared.type, module);
  if (!fields) return std::nullopt;
  return Part{&declared, std::move(*fields)};
}

void Interpreter::set(const Assignment& assignment, Settings& settings) const {
  const Part& part = parts_.at(&assignment);
  auto& of = settings[part.of];
  const std::vector<std::size_t>& fields = part.fields;
  std::erase_if(of, [&](const auto& set) {
    return set.first.size() >= fields.size() &&
           std::equal(fields.begin(), fields.end(), set.first.begin());
  });
  of[fields] = &assignment;
}

/// The value that holds now, as if the declaration had it.
Told<const Expression*> Interpreter::as_set(const Declaration& declared) const {
  const std::string& where = set_in_order_.at(&declared);
  if (now_ == nullptr) return because(where);
  const auto settings = now_->find(&declared);
  if (settings == now_->end()) {
    if (!declared.value)
      return because(fmt::format("{} has no value in the file", shown(declared.spelled)));
    return &*declared.value;
  }
  const auto known = as_set_.find({&declared, settings->second});
  if (known != as_set_.end()) return known->second.get();
  auto made = std::make_unique<Expression>(declared.value.value_or(Expression{}));
  for (const auto& [fields, assignment] : settings->second) {
    if (assignment == nullptr) return because(where + ": a branch, a loop or a caller decides it");
    Expression* part = made.get();
    for (const std::size_t field : fields) {
      if (part->kind != Kind::kAggregate || field >= part->parts.size()) return because(where);
      part = &part->parts[field];
    }
    const int line = std::max(made->line, assignment->line);
    *part = assignment->value;
    made->line = line;
  }
  return as_set_.emplace(std::pair(&declared, settings->second), std::move(made))
      .first->second.get();
}

void Interpreter::note_changes_by(std::size_t module, const Instruction& instruction) {
  const Scope& scope = *own_scope(module, instruction.routine);
  const auto routine = find_routine(instruction.name, module);
  if (!routine && only_reads(instruction.name)) return;
  if (!routine && sets_by_name(instruction.name)) return note_changes_by_name(module, instruction);
  std::size_t position = 0;
  for (const Expression& argument : instruction.arguments) {
    const std::size_t at = argument.label.empty() ? position++ : position;
    const Expression* root = name_in(argument);
    if (root == nullptr) continue;
    const auto change = [&] {
      note_change(argument, scope,
                  fmt::format("{} may be changed by {} ({})", text_of(*root, scope),
                              shown(instruction.spelled), place_of(module, instruction.line)));
    };
    if (routine) {
      const Routine& called =
          modules_[routine->first].routines[static_cast<std::size_t>(routine->second)];
      const std::string& parameter = !argument.label.empty()         ? argument.label.text()
                                     : at < called.parameters.size() ? called.parameters[at]
                                                                     : root->name.text();
      const auto found = by_name_[routine->first].find({routine->second, parameter});
      if (found == by_name_[routine->first].end() || !found->second->may_be_changed) continue;
      if (changed_.contains(found->second)) change();
      continue;
    }
    const bool is_found_point =
        instruction.name.starts_with("search") && at == 1 && argument.label.empty();
    if (instruction.name.starts_with("search") && !is_found_point) continue;
    const std::string type = type_of(argument, scope);
    // Tools and work objects are arguments of many instructions; only assignments and few
    // instructions change them.
    const bool is_found = argument.label.empty() && at == tool_found_by(instruction.name);
    if (is_found && instruction.name == kFindsLoads) {
      if (const auto found = find(root->name, scope))
        load_found_.emplace(found->declaration, place_of(module, instruction.line));
      continue;
    }
    if ((type == "tooldata" || type == "wobjdata") && !is_found) continue;
    change();
  }
}

}  // namespace trammel::cam::rapid
