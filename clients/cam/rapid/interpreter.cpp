#include "clients/cam/rapid/interpreter.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "server/base/plain_text.h"
#include "server/base/units.h"

namespace trammel::cam::rapid {

namespace {

using Kind = Expression::Kind;

constexpr int kDeepest = 60;               // names that stand for names
constexpr std::size_t kMostWaysIn = 2000;  // into one routine

struct BuiltIn {
  const char* field;
  const char* type;
};
const std::map<std::string, std::vector<BuiltIn>>& built_in() {
  static const std::map<std::string, std::vector<BuiltIn>> kTypes = {
      {"robtarget", {{"trans", "pos"}, {"rot", "orient"}, {"robconf", "confdata"}, {"extax", "extjoint"}}},
      {"jointtarget", {{"robax", "robjoint"}, {"extax", "extjoint"}}},
      {"pos", {{"x", "num"}, {"y", "num"}, {"z", "num"}}},
      {"orient", {{"q1", "num"}, {"q2", "num"}, {"q3", "num"}, {"q4", "num"}}},
      {"confdata", {{"cf1", "num"}, {"cf4", "num"}, {"cf6", "num"}, {"cfx", "num"}}},
      {"robjoint",
       {{"rax_1", "num"}, {"rax_2", "num"}, {"rax_3", "num"}, {"rax_4", "num"}, {"rax_5", "num"}, {"rax_6", "num"}}},
      {"extjoint",
       {{"eax_a", "num"}, {"eax_b", "num"}, {"eax_c", "num"}, {"eax_d", "num"}, {"eax_e", "num"}, {"eax_f", "num"}}},
      {"pose", {{"trans", "pos"}, {"rot", "orient"}}},
      {"tooldata", {{"robhold", "bool"}, {"tframe", "pose"}, {"tload", "loaddata"}}},
      {"loaddata", {{"mass", "num"}, {"cog", "pos"}, {"aom", "orient"}, {"ix", "num"}, {"iy", "num"}, {"iz", "num"}}},
      {"wobjdata",
       {{"robhold", "bool"}, {"ufprog", "bool"}, {"ufmec", "string"}, {"uframe", "pose"}, {"oframe", "pose"}}},
  };
  return kTypes;
}

/// Instructions that leave the data which they are given as they are.
bool only_reads(const std::string& name) {
  static const std::set<std::string> kMotions = {"move", "trig", "arc", "spot", "disp", "pain", "capl", "capc"};
  if (is_still(name)) return true;
  for (const std::string& beginning : kMotions) {
    if (name.starts_with(beginning)) return true;
  }
  return false;
}

constexpr const char* kFindsLoads = "loadid";

/// Which argument of an instruction is the tool that it measures: `MToolTCPCalib jos1,jos2,jos3,jos4,tGun,max,mean;`.
std::size_t tool_found_by(const std::string& instruction) {
  static const std::map<std::string, std::size_t> kFound = {
      {"mtooltcpcalib", 4}, {"stooltcpcalib", 4}, {"mtoolrotcalib", 2}, {"stoolrotcalib", 3}, {kFindsLoads, 2}};
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

/// `TASK2`, the folder of a backup that a module stands in; empty: it is of no backup.
std::string task_of(const std::string& file) {
  const std::size_t at = file.find("TASK");
  const std::size_t end = at == std::string::npos ? at : file.find('/', at);
  return end == std::string::npos || (at > 0 && file[at - 1] != '/') ? "" : file.substr(at, end - at);
}

/// The name whose value an expression is a part of.
const Expression* root_of(const Expression& expression) {
  const Expression* root = &expression;
  while ((root->kind == Kind::kField || root->kind == Kind::kElement) && !root->parts.empty()) root = &root->parts[0];
  return root->kind == Kind::kName ? root : nullptr;
}

}  // namespace

bool is_still(const std::string& instruction) {
  static const std::set<std::string> kReaders = {
      "set",          "reset",        "setdo",      "setgo",       "setao",    "pulsedo",    "waittime",
      "waituntil",    "waitdi",       "waitdo",     "tpwrite",     "tperase",  "write",      "errwrite",
      "stop",         "gripload",     "pdispset",   "pdispon",     "eoffsset", "eoffson",    "actunit",
      "confl",        "confj",        "singarea",   "accset",      "velset",   "softact",    "waitrob",
      "speedrefresh", "stopmove",     "startmove",  "return",      "triggio",  "triggequip", "triggint",
      "mechunitload", "waitsynctask", "syncmoveon", "syncmoveoff", "exit",     "raise",      "connect",
      "isignaldi",    "deactunit",    "corron",     "worldacclim", "invertdo", "tpshow",     "uishow"};
  return kReaders.contains(instruction);
}

Interpreter::Interpreter(const std::vector<SourceFile>& files, const std::vector<Module>& modules,
                         std::map<std::string, std::string> set_elsewhere)
    : files_(files), modules_(modules), by_name_(modules.size()), set_elsewhere_(std::move(set_elsewhere)) {
  for (const SourceFile& file : files_) tasks_.push_back(task_of(file.name));
  for (std::size_t m = 0; m < modules_.size(); ++m) {
    static_cast<void>(own_scope(m, -1));
    for (std::size_t r = 0; r < modules_[m].routines.size(); ++r)
      routines_[modules_[m].routines[r].name].emplace_back(m, static_cast<int>(r));
    for (const Declaration& declared : modules_[m].declarations) {
      const auto [known, fresh] = by_name_[m].emplace(std::pair(declared.routine, declared.name), &declared);
      if (!fresh && declared.storage != Storage::kLoop) note_twice(m, *known->second, declared);
      if (declared.routine < 0 && !declared.local) global_[declared.name].push_back({&declared, m});
    }
  }
  note_changes();
}

/// A file of several modules, or one that no controller takes: which of them a name means is not followed.
void Interpreter::note_twice(std::size_t module, const Declaration& one, const Declaration& other) {
  const std::string why =
      fmt::format("{} is declared twice ({} line {}, line {})",
                  shown(other.spelled.empty() ? other.name : other.spelled), files_[module].name, one.line, other.line);
  for (const Declaration* declared : {&one, &other}) changed_.emplace(declared, why);
}

std::string Interpreter::place_of(std::size_t module, int line) const {
  return fmt::format("{} line {}", files_[module].name, line);
}

std::string Interpreter::text_of(const Expression& expression, const Scope& scope) const {
  const std::string& text = files_[scope.module].text;
  const std::string_view bytes = std::string_view(text).substr(expression.begin, expression.end - expression.begin);
  if (bytes.find_first_of(" \t\r\n\f!\"") == std::string_view::npos && bytes.find('\0') == std::string_view::npos)
    return std::string(bytes);
  std::string shown;
  for (const Token& token : tokens_of(bytes)) {
    shown += text.substr(expression.begin + token.begin, token.end - token.begin);
  }
  return shown;
}

std::optional<Interpreter::Found> Interpreter::find(const std::string& name, const Scope& scope) const {
  const auto& own = by_name_[scope.module];
  if (scope.routine >= 0) {
    if (const auto it = own.find({scope.routine, name}); it != own.end()) return Found{it->second, scope.module};
  }
  if (const auto it = own.find({-1, name}); it != own.end()) return Found{it->second, scope.module};
  return find_global(name, scope.module);
}

std::optional<Interpreter::Found> Interpreter::find_global(const std::string& name, std::size_t module) const {
  const auto known = global_.find(name);
  if (known == global_.end()) return std::nullopt;
  const auto own = std::find_if(known->second.begin(), known->second.end(),
                                [&](const Found& found) { return tasks_[found.module] == tasks_[module]; });
  return own == known->second.end() ? known->second.front() : *own;
}

std::optional<std::pair<std::size_t, int>> Interpreter::find_routine(const std::string& name,
                                                                     std::size_t module) const {
  const auto known = routines_.find(name);
  if (known == routines_.end()) return std::nullopt;
  std::optional<std::pair<std::size_t, int>> of_another_task;
  for (const bool own : {true, false}) {
    for (const auto& [m, r] : known->second) {
      const bool is_local = modules_[m].routines[static_cast<std::size_t>(r)].local;
      if ((m == module) != own || (!own && is_local)) continue;
      if (tasks_[m] == tasks_[module]) return std::pair(m, r);
      if (!of_another_task) of_another_task = std::pair(m, r);
    }
  }
  return of_another_task;
}

const Scope* Interpreter::own_scope(std::size_t module, int routine) {
  const Scope*& scope = own_[{module, routine}];
  if (scope == nullptr) scope = scopes_.emplace_back(std::make_unique<Scope>(Scope{module, routine})).get();
  return scope;
}

const std::vector<const Scope*>& Interpreter::scopes_of(std::size_t module, int routine) {
  const auto [entry, is_new] = ways_in_.emplace(std::pair(module, routine), std::vector<const Scope*>{});
  std::vector<const Scope*>& ways = entry->second;
  if (!is_new && !ways.empty()) return ways;
  const Scope* own = own_scope(module, routine);
  bool has_parameters = false;
  for (const Declaration& declared : modules_[module].declarations) {
    has_parameters |= declared.routine == routine && routine >= 0 && declared.storage == Storage::kParameter;
  }
  // While the ways into a routine are looked for, a routine that calls itself sees none but its own.
  ways.push_back(own);
  if (!has_parameters) return ways;
  const std::string& name = modules_[module].routines[static_cast<std::size_t>(routine)].name;
  std::vector<const Scope*> found;
  for (std::size_t m = 0; m < modules_.size(); ++m) {
    for (const Instruction& call : modules_[m].instructions) {
      if (call.name != name || find_routine(name, m) != std::pair(module, routine)) continue;
      for (const Scope* caller : std::vector<const Scope*>(scopes_of(m, call.routine))) {
        if (found.size() >= kMostWaysIn || (m == module && call.routine == routine)) break;
        found.push_back(scopes_.emplace_back(std::make_unique<Scope>(Scope{module, routine, &call, caller})).get());
      }
    }
  }
  std::vector<const Scope*>& result = ways_in_[{module, routine}];
  if (!found.empty()) result = std::move(found);
  return result;
}

// What changes at run time.

std::string Interpreter::changed(const Declaration* declaration) const {
  const auto it = changed_.find(declaration);
  return it == changed_.end() ? "" : it->second;
}

void Interpreter::note_change(const Expression& target, const Scope& scope, const std::string& why) {
  const Expression* root = root_of(target);
  if (root == nullptr) return;
  const auto found = find(root->name, scope);
  if (found && found->declaration->storage != Storage::kConst) changed_.emplace(found->declaration, why);
}

void Interpreter::note_changes() {
  for (std::size_t m = 0; m < modules_.size(); ++m) {
    for (const Assignment& assignment : modules_[m].assignments) {
      const Expression* root = root_of(assignment.target);
      if (root == nullptr) continue;
      const std::string why = fmt::format("{} is set at run time ({})", text_of(*root, {m, assignment.routine}),
                                          place_of(m, assignment.line));
      if (auto part = constant_part(assignment, m)) {
        set_in_order_.emplace(part->of, why);
        parts_.emplace(&assignment, std::move(*part));
      } else {
        note_change(assignment.target, *own_scope(m, assignment.routine), why);
      }
    }
  }
  // A change of a parameter changes what is handed over, through any number of calls.
  std::size_t before = 0;
  do {
    before = changed_.size();
    for (std::size_t m = 0; m < modules_.size(); ++m) {
      for (const Instruction& instruction : modules_[m].instructions) note_changes_by(m, instruction);
    }
    note_changes_by_tasks();
  } while (changed_.size() > before);
}

/// A persistent that tasks share is one: what one of them sets, another one has.
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
      if (const auto elsewhere = set_elsewhere_.find(declared.name); elsewhere != set_elsewhere_.end())
        changed_.emplace(&declared, elsewhere->second);
      if (tasks_[m].empty()) continue;
      Shared& shared = by_name[declared.name];
      shared.tasks.insert(tasks_[m]);
      shared.declared.push_back(&declared);
      for (const auto* changes : {&changed_, &set_in_order_}) {
        if (const auto change = changes->find(&declared); change != changes->end()) shared.why = change->second;
      }
    }
  }
  for (const auto& [name, shared] : by_name) {
    if (shared.tasks.size() < 2 || shared.why.empty()) continue;
    for (const Declaration* declared : shared.declared) changed_.emplace(declared, shared.why);
  }
}

bool Interpreter::is_shared(const Declaration& declared) {
  return declared.storage == Storage::kPers && declared.routine < 0 && !declared.local && !declared.of_task;
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

/// `SetDataVal "p10",pNew;`: the name is a text, so that any data of the type may be meant. `SetAllDataVal` sets all.
void Interpreter::note_changes_by_name(std::size_t module, const Instruction& instruction) {
  std::vector<const Expression*> positional;
  for (const Expression& argument : instruction.arguments) {
    if (argument.label.empty()) positional.push_back(&argument);
  }
  if (positional.size() < 2) return;
  const Scope& scope = *own_scope(module, instruction.routine);
  const std::string why = fmt::format("{} may set it ({})", instruction.spelled, place_of(module, instruction.line));
  const std::string text = positional[0]->kind == Kind::kText ? text_of(*positional[0], scope) : "";
  if (instruction.name == "setdataval" && text.size() > 2) {
    const auto found = find(in_lower_case(text.substr(1, text.size() - 2)), scope);
    if (found && found->declaration->storage != Storage::kConst) changed_.emplace(found->declaration, why);
    return;
  }
  const std::string type = type_of(*positional[1], scope);
  for (const Module& any : modules_) {
    for (const Declaration& declared : any.declarations) {
      const bool may_be_set = declared.storage == Storage::kPers || declared.storage == Storage::kVar;
      if (may_be_set && (type.empty() || declared.type == type)) changed_.emplace(&declared, why);
    }
  }
}

std::optional<std::vector<std::size_t>> Interpreter::fields_of(const Expression& target, const std::string& type,
                                                               std::size_t module) const {
  if (target.kind == Kind::kName) return std::vector<std::size_t>{};
  if (target.kind != Kind::kField) return std::nullopt;
  std::optional<std::vector<std::size_t>> fields = fields_of(target.parts[0], type, module);
  std::string inner = type;
  for (std::size_t k = 0; fields && k < fields->size(); ++k) inner = built_in().at(inner)[(*fields)[k]].type;
  const auto known = fields ? field(inner, target.name, module) : std::nullopt;
  if (!known || !built_in().contains(inner)) return std::nullopt;
  fields->push_back(known->index);
  return fields;
}

std::optional<Interpreter::Part> Interpreter::constant_part(const Assignment& assignment, std::size_t module) const {
  const Expression* root = root_of(assignment.target);
  const auto found = root == nullptr ? std::nullopt : find(root->name, {module, assignment.routine});
  if (!found || found->module != module || !is_literal(assignment.value)) return std::nullopt;
  const Declaration& declared = *found->declaration;
  const bool is_setting = declared.type == "tooldata" || declared.type == "wobjdata";
  // A function comes in within expressions, whose order is not followed.
  if (assignment.routine >= 0 && modules_[module].routines[static_cast<std::size_t>(assignment.routine)].is_function)
    return std::nullopt;
  if (!is_setting || declared.is_array || (declared.storage != Storage::kPers && declared.storage != Storage::kVar))
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
    return set.first.size() >= fields.size() && std::equal(fields.begin(), fields.end(), set.first.begin());
  });
  of[fields] = &assignment;
}

/// The value that holds now, as if the declaration had it.
Told<const Expression*> Interpreter::as_set(const Declaration& declared) const {
  const std::string& where = set_in_order_.at(&declared);
  if (now_ == nullptr) return because(where);
  const auto settings = now_->find(&declared);
  if (settings == now_->end()) {
    if (!declared.value) return because(fmt::format("{} has no value in the file", shown(declared.spelled)));
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
  return as_set_.emplace(std::pair(&declared, settings->second), std::move(made)).first->second.get();
}

void Interpreter::note_changes_by(std::size_t module, const Instruction& instruction) {
  const Scope& scope = *own_scope(module, instruction.routine);
  const auto routine = find_routine(instruction.name, module);
  if (!routine && only_reads(instruction.name)) return;
  if (!routine && sets_by_name(instruction.name)) return note_changes_by_name(module, instruction);
  std::size_t position = 0;
  for (const Expression& argument : instruction.arguments) {
    const std::size_t at = argument.label.empty() ? position++ : position;
    const Expression* root = root_of(argument);
    if (root == nullptr) continue;
    const auto change = [&] {
      note_change(argument, scope,
                  fmt::format("{} may be changed by {} ({})", text_of(*root, scope), shown(instruction.spelled),
                              place_of(module, instruction.line)));
    };
    if (routine) {
      const Routine& called = modules_[routine->first].routines[static_cast<std::size_t>(routine->second)];
      const std::string& parameter = !argument.label.empty()         ? argument.label.text()
                                     : at < called.parameters.size() ? called.parameters[at]
                                                                     : root->name.text();
      const auto found = by_name_[routine->first].find({routine->second, parameter});
      if (found == by_name_[routine->first].end() || !found->second->may_be_changed) continue;
      if (changed_.contains(found->second)) change();
      continue;
    }
    const bool is_found_point = instruction.name.starts_with("search") && at == 1 && argument.label.empty();
    if (instruction.name.starts_with("search") && !is_found_point) continue;
    const std::string type = type_of(argument, scope);
    // Tools and work objects are handed to all kinds of instructions; they are changed by assignment, and by few.
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

// What names stand for.

Told<const Expression*> Interpreter::bound(const Declaration& parameter, const Scope& scope) const {
  const std::string of = modules_[scope.module].routines[static_cast<std::size_t>(scope.routine)].name;
  if (scope.call == nullptr) return because(fmt::format("{} is handed over by whoever calls {}", parameter.name, of));
  if (const std::string why = changed(&parameter); !why.empty()) return because(why);
  const auto& order = modules_[scope.module].routines[static_cast<std::size_t>(scope.routine)].parameters;
  std::size_t position = 0;
  for (const Expression& argument : scope.call->arguments) {
    const bool is_it = argument.label.empty() ? position < order.size() && order[position] == parameter.name
                                              : argument.label == parameter.name;
    if (is_it) return &argument;
    if (argument.label.empty()) ++position;
  }
  return because(fmt::format("{} is not handed over to {}", parameter.name, of));
}

Told<std::pair<const Expression*, const Scope*>> Interpreter::handed_over(const Expression& expression,
                                                                          const Scope& scope) const {
  const Expression* now = &expression;
  const Scope* where = &scope;
  for (int depth = 0; now->kind == Kind::kName && depth < kDeepest; ++depth) {
    const auto found = find(now->name, *where);
    if (!found || found->declaration->storage != Storage::kParameter) break;
    const Told<const Expression*> argument = bound(*found->declaration, *where);
    if (!argument) return because(argument.error());
    now = *argument;
    where = where->caller;
  }
  return std::pair(now, where);
}

std::optional<Interpreter::Field> Interpreter::field(const std::string& type, const std::string& name,
                                                     std::size_t module) const {
  if (const auto known = built_in().find(type); known != built_in().end()) {
    for (std::size_t k = 0; k < known->second.size(); ++k) {
      if (known->second[k].field == name) return Field{k, known->second[k].type};
    }
    return std::nullopt;
  }
  for (const bool own : {true, false}) {
    for (std::size_t m = 0; m < modules_.size(); ++m) {
      if ((m == module) != own) continue;
      for (const Record& record : modules_[m].records) {
        if (record.name != type) continue;
        for (std::size_t k = 0; k < record.fields.size(); ++k) {
          if (record.fields[k] == name) return Field{k, record.types[k]};
        }
      }
    }
  }
  return std::nullopt;
}

std::string Interpreter::type_of(const Expression& expression, const Scope& scope, int depth) const {
  if (depth > kDeepest) return "";
  switch (expression.kind) {
    case Kind::kName: {
      const auto found = find(expression.name, scope);
      return found ? found->declaration->type : "";
    }
    case Kind::kField: {
      const auto known = field(type_of(expression.parts[0], scope, depth + 1), expression.name, scope.module);
      return known ? known->type : "";
    }
    case Kind::kElement:
      return type_of(expression.parts[0], scope, depth + 1);
    case Kind::kCall:
      return expression.name == "offs" || expression.name == "reltool" ? "robtarget" : "";
    case Kind::kAggregate:
      if (expression.parts.size() == 4 && expression.parts[0].kind != Kind::kNumber) return "robtarget";
      return expression.parts.size() == 2 ? "jointtarget" : "";
    case Kind::kNumber:
      return "num";
    default:
      return "";
  }
}

Told<std::vector<Data>> Interpreter::data_of(const Expression& expression, const Scope& scope, int depth) const {
  if (depth > kDeepest) return because("it stands for itself");
  switch (expression.kind) {
    case Kind::kName: {
      const auto found = find(expression.name, scope);
      if (!found) return because(fmt::format("{} is not in the files handed over", shown(text_of(expression, scope))));
      const Declaration& declared = *found->declaration;
      if (declared.storage == Storage::kLoop)
        return because(fmt::format("a loop counts {}", shown(text_of(expression, scope))));
      if (declared.storage == Storage::kParameter) {
        const Told<const Expression*> argument = bound(declared, scope);
        if (!argument) return because(argument.error());
        if ((*argument)->kind == Kind::kName || (*argument)->kind == Kind::kField ||
            (*argument)->kind == Kind::kElement) {
          return data_of(**argument, *scope.caller, depth + 1);
        }
        return std::vector<Data>{{*argument, scope.caller, declared.type, nullptr}};
      }
      if (const std::string why = changed(&declared); !why.empty()) return because(why);
      // What a declaration says is looked up where it stands.
      const Scope* where = declared.routine >= 0 ? &scope : own_.at({found->module, -1});
      if (set_in_order_.contains(&declared)) {
        const Told<const Expression*> now = as_set(declared);
        if (!now) return because(now.error());
        return std::vector<Data>{{*now, where, declared.type, &declared}};
      }
      if (!declared.value) return because(fmt::format("{} has no value in the file", shown(declared.spelled)));
      return std::vector<Data>{{&*declared.value, where, declared.type, &declared}};
    }
    case Kind::kField:
      return field_of(expression, scope, depth);
    case Kind::kElement:
      return element_of(expression, scope, depth);
    case Kind::kCall:
      return because(fmt::format("the function {} decides it", shown(expression.name.text())));
    default:
      return std::vector<Data>{{&expression, &scope, type_of(expression, scope), nullptr}};
  }
}

Told<std::vector<Data>> Interpreter::field_of(const Expression& expression, const Scope& scope, int depth) const {
  const Told<std::vector<Data>> of = data_of(expression.parts[0], scope, depth + 1);
  if (!of) return of;
  std::vector<Data> all;
  for (const Data& data : *of) {
    const auto known = field(data.type, expression.name, data.scope->module);
    if (!known) return because(fmt::format("{} of a {} is not known", shown(expression.name.text()), shown(data.type)));
    const Expression* node = data.node;
    if (node->kind != Kind::kAggregate) {
      const Told<std::vector<Data>> inner = data_of(*node, *data.scope, depth + 1);
      if (!inner || inner->size() != 1 || (*inner)[0].node->kind != Kind::kAggregate)
        return because(fmt::format("{} is not constant", shown(text_of(*node, *data.scope))));
      node = (*inner)[0].node;
    }
    if (known->index >= node->parts.size()) return because(fmt::format("a {} is incomplete", shown(data.type)));
    all.push_back({&node->parts[known->index], data.scope, known->type, data.declared});
  }
  return all;
}

Told<std::vector<Data>> Interpreter::element_of(const Expression& expression, const Scope& scope, int depth) const {
  const Told<std::vector<Data>> of = data_of(expression.parts[0], scope, depth + 1);
  if (!of) return of;
  std::vector<Data> all = *of;
  for (std::size_t k = 1; k < expression.parts.size(); ++k) {
    const Told<double> index = number_of(expression.parts[k], scope, depth + 1);
    std::vector<Data> chosen;
    for (const Data& data : all) {
      if (data.node->kind != Kind::kAggregate) return because("an array is not written out");
      const auto& parts = data.node->parts;
      if (index && (*index < 1 || *index > static_cast<double>(parts.size())))
        return because(fmt::format("element {} of {}", *index, parts.size()));
      for (std::size_t i = 0; i < parts.size(); ++i) {
        if (!index || i + 1 == static_cast<std::size_t>(std::lround(*index)))
          chosen.push_back({&parts[i], data.scope, data.type, data.declared});
      }
    }
    all = std::move(chosen);
  }
  if (all.empty()) return because("an array is empty");
  return all;
}

// Values.

Told<double> Interpreter::operation(const Expression& expression, const Scope& scope, int depth) const {
  const Told<double> left = number_of(expression.parts[0], scope, depth + 1);
  if (!left) return left;
  if (expression.kind == Kind::kUnary) return expression.sign == '-' ? -*left : *left;
  const Told<double> right = number_of(expression.parts[1], scope, depth + 1);
  if (!right) return right;
  double value = 0;
  switch (expression.sign) {
    case '+':
      value = *left + *right;
      break;
    case '-':
      value = *left - *right;
      break;
    case '*':
      value = *left * *right;
      break;
    default:
      value = *left / *right;
  }
  if (!std::isfinite(value)) return because("a number is not finite");
  return value;
}

Told<double> Interpreter::number_of(const Expression& expression, const Scope& scope, int depth) const {
  if (depth > kDeepest) return because("it stands for itself");
  if (expression.kind == Kind::kNumber) return expression.value;
  if (expression.kind == Kind::kUnary || expression.kind == Kind::kBinary) return operation(expression, scope, depth);
  if (expression.kind == Kind::kName && expression.name == "pi" && !find("pi", scope)) return kPi;
  if (expression.kind != Kind::kName && expression.kind != Kind::kField && expression.kind != Kind::kElement)
    return because(fmt::format("'{}' is not constant", shown_short(text_of(expression, scope))));
  const Told<std::vector<Data>> data = data_of(expression, scope, depth + 1);
  if (!data) return because(data.error());
  const Data& one = data->front();
  if (data->size() > 1) return because(fmt::format("an index chooses {}", shown_short(text_of(expression, scope))));
  if (one.declared != nullptr && one.declared->storage == Storage::kPers && one.declared->type == "num")
    return because(fmt::format("{} is persistent: it may be set at any time", shown(one.declared->name)));
  return number_of(*one.node, *one.scope, depth + 1);
}

Told<std::vector<double>> Interpreter::numbers_of(const Expression& expression, std::size_t count, const Scope& scope,
                                                  int* decimals, int depth) const {
  if (depth > kDeepest) return because("it stands for itself");
  if (expression.kind == Kind::kAggregate) {
    if (expression.parts.size() != count)
      return because(fmt::format("{} numbers where {} are due", expression.parts.size(), count));
    std::vector<double> numbers;
    for (const Expression& part : expression.parts) {
      const Told<double> number = number_of(part, scope, depth + 1);
      if (!number) return because(number.error());
      numbers.push_back(*number);
      const std::string& text = files_[scope.module].text;
      const auto written = part.kind == Kind::kNumber
                               ? read_number(std::string_view(text).substr(part.begin, part.end - part.begin))
                               : std::nullopt;
      if (written && written->style.exponent == 0) *decimals = std::max(*decimals, written->style.decimals);
    }
    return numbers;
  }
  const Told<std::vector<Data>> data = data_of(expression, scope, depth + 1);
  if (!data) return because(data.error());
  if (data->size() != 1) return because("an index chooses it");
  if (data->front().node == &expression) return because("it is not written out");
  return numbers_of(*data->front().node, count, *data->front().scope, decimals, depth + 1);
}

Told<TargetValue> Interpreter::offset_of(const Expression& call, const Scope& scope, int depth) const {
  if (call.parts.size() < 4) return because(fmt::format("{} with {} arguments", call.name.text(), call.parts.size()));
  Told<TargetValue> base = target_of(call.parts[0], scope, depth + 1);
  if (!base) return base;
  Vector3 d;
  for (std::size_t k = 0; k < 3; ++k) {
    const Told<double> number = number_of(call.parts[k + 1], scope, depth + 1);
    if (!number) return because(number.error());
    d(static_cast<Eigen::Index>(k)) = *number;
  }
  if (call.name == "offs") {
    for (std::size_t k = 0; k < 3; ++k) base->numbers[k] += d(static_cast<Eigen::Index>(k));
    return base;
  }
  // RelTool: along the tool's axes, then about x, the new y, the new z.
  Vector3 turn = Vector3::Zero();
  for (std::size_t k = 4; k < call.parts.size(); ++k) {
    const Expression& part = call.parts[k];
    const std::size_t axis = std::string("xyz").find(part.label.text().size() == 2 ? part.label.text()[1] : '?');
    if (!part.label.text().starts_with("r") || axis == std::string::npos)
      return because(fmt::format("RelTool with '{}'", shown(part.label.text())));
    const Told<double> number = number_of(part, scope, depth + 1);
    if (!number) return because(number.error());
    turn(static_cast<Eigen::Index>(axis)) = from_deg(*number);
  }
  Pose pose = pose_of(Coordinates::kQuaternion, base->numbers);
  pose.translate(d * from_mm(1));
  pose.rotate(Eigen::AngleAxisd(turn.x(), Vector3::UnitX()) * Eigen::AngleAxisd(turn.y(), Vector3::UnitY()) *
              Eigen::AngleAxisd(turn.z(), Vector3::UnitZ()));
  base->numbers = cam::numbers_of(Coordinates::kQuaternion, pose, base->numbers);
  return base;
}

Told<TargetValue> Interpreter::target_of(const Expression& expression, const Scope& scope, int depth) const {
  if (depth > kDeepest) return because("it stands for itself");
  if (expression.kind == Kind::kCall && (expression.name == "offs" || expression.name == "reltool"))
    return offset_of(expression, scope, depth);
  if (expression.kind != Kind::kAggregate) {
    const Told<std::vector<Data>> data = data_of(expression, scope, depth + 1);
    if (!data) return because(data.error());
    if (data->size() != 1) return because(fmt::format("an index chooses {}", shown_short(text_of(expression, scope))));
    if (data->front().node == &expression) return because("it is not understood");
    return target_of(*data->front().node, *data->front().scope, depth + 1);
  }
  if (expression.parts.size() != 4) return because(fmt::format("a robtarget of {} parts", expression.parts.size()));
  TargetValue value;
  const auto read = [&](std::size_t part, std::size_t count, int* decimals) {
    return numbers_of(expression.parts[part], count, scope, decimals, depth + 1);
  };
  int ignored = 0;
  const Told<std::vector<double>> position = read(0, 3, &value.decimals);
  if (!position) return because(position.error());
  const Told<std::vector<double>> rotation = read(1, 4, &value.rotation_decimals);
  if (!rotation) return because(rotation.error());
  const Told<std::vector<double>> conf = read(2, 4, &ignored);
  if (!conf) return because(conf.error());
  const Told<std::vector<double>> external = read(3, 6, &ignored);
  if (!external) return because(external.error());
  value.numbers = *position;
  value.numbers.insert(value.numbers.end(), rotation->begin(), rotation->end());
  const double length = Eigen::Vector4d((*rotation)[0], (*rotation)[1], (*rotation)[2], (*rotation)[3]).norm();
  if (std::abs(length - 1) > 0.01) return because(fmt::format("a quaternion of length {:.4f}", length));
  std::copy(conf->begin(), conf->end(), value.conf.begin());
  std::copy(external->begin(), external->end(), value.external.begin());
  return value;
}

Told<JointValue> Interpreter::joints_of(const Expression& expression, const Scope& scope) const {
  if (expression.kind != Kind::kAggregate || expression.parts.size() != 2)
    return because("a jointtarget that is not written out");
  JointValue value;
  int ignored = 0;
  const Told<std::vector<double>> axes = numbers_of(expression.parts[0], 6, scope, &value.decimals);
  if (!axes) return because(axes.error());
  const Told<std::vector<double>> external = numbers_of(expression.parts[1], 6, scope, &ignored);
  if (!external) return because(external.error());
  value.axes = *axes;
  std::copy(external->begin(), external->end(), value.external.begin());
  return value;
}

}  // namespace trammel::cam::rapid
