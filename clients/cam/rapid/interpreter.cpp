#include "clients/cam/rapid/interpreter.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "clients/cam/rapid/expressions.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"

namespace trammel::cam::rapid {

namespace {

using Kind = Expression::Kind;

constexpr int kDeepestCall = 60;           // names that stand for names
constexpr std::size_t kMostWaysIn = 2000;  // into one routine

struct BuiltIn {
  const char* field;
  const char* type;
};
const std::map<std::string, std::vector<BuiltIn>>& built_in() {
  static const std::map<std::string, std::vector<BuiltIn>> kTypes = {
      {"robtarget",
       {{"trans", "pos"}, {"rot", "orient"}, {"robconf", "confdata"}, {"extax", "extjoint"}}},
      {"jointtarget", {{"robax", "robjoint"}, {"extax", "extjoint"}}},
      {"pos", {{"x", "num"}, {"y", "num"}, {"z", "num"}}},
      {"orient", {{"q1", "num"}, {"q2", "num"}, {"q3", "num"}, {"q4", "num"}}},
      {"confdata", {{"cf1", "num"}, {"cf4", "num"}, {"cf6", "num"}, {"cfx", "num"}}},
      {"robjoint",
       {{"rax_1", "num"},
        {"rax_2", "num"},
        {"rax_3", "num"},
        {"rax_4", "num"},
        {"rax_5", "num"},
        {"rax_6", "num"}}},
      {"extjoint",
       {{"eax_a", "num"},
        {"eax_b", "num"},
        {"eax_c", "num"},
        {"eax_d", "num"},
        {"eax_e", "num"},
        {"eax_f", "num"}}},
      {"pose", {{"trans", "pos"}, {"rot", "orient"}}},
      {"tooldata", {{"robhold", "bool"}, {"tframe", "pose"}, {"tload", "loaddata"}}},
      {"loaddata",
       {{"mass", "num"},
        {"cog", "pos"},
        {"aom", "orient"},
        {"ix", "num"},
        {"iy", "num"},
        {"iz", "num"}}},
      {"wobjdata",
       {{"robhold", "bool"},
        {"ufprog", "bool"},
        {"ufmec", "string"},
        {"uframe", "pose"},
        {"oframe", "pose"}}},
  };
  return kTypes;
}

/// `TASK2`, the folder of a backup in which a module stands. Empty if the file belongs to no
/// backup.
std::string task_of(const std::string& file) {
  const std::size_t at = file.find("TASK");
  const std::size_t end = at == std::string::npos ? at : file.find('/', at);
  return end == std::string::npos || (at > 0 && file[at - 1] != '/') ? ""
                                                                     : file.substr(at, end - at);
}

}  // namespace

const Expression* name_in(const Expression& expression) {
  const Expression* root = &expression;
  while ((root->kind == Kind::kField || root->kind == Kind::kElement) && !root->parts.empty())
    root = &root->parts[0];
  return root->kind == Kind::kName ? root : nullptr;
}

bool is_still(const std::string& instruction) {
  static const std::set<std::string> kReaders = {
      "set",          "reset",      "setdo",       "setgo",       "setao",        "pulsedo",
      "waittime",     "waituntil",  "waitdi",      "waitdo",      "tpwrite",      "tperase",
      "write",        "errwrite",   "stop",        "gripload",    "pdispset",     "pdispon",
      "eoffsset",     "eoffson",    "actunit",     "confl",       "confj",        "singarea",
      "accset",       "velset",     "softact",     "waitrob",     "speedrefresh", "stopmove",
      "startmove",    "return",     "triggio",     "triggequip",  "triggint",     "mechunitload",
      "waitsynctask", "syncmoveon", "syncmoveoff", "exit",        "raise",        "connect",
      "isignaldi",    "deactunit",  "corron",      "worldacclim", "invertdo",     "tpshow",
      "uishow"};
  return kReaders.contains(instruction);
}

Interpreter::Interpreter(const std::vector<SourceFile>& files, const std::vector<Module>& modules,
                         std::map<std::string, std::string> set_elsewhere)
    : files_(files),
      modules_(modules),
      by_name_(modules.size()),
      set_elsewhere_(std::move(set_elsewhere)) {
  for (const SourceFile& file : files_) tasks_.push_back(task_of(file.name));
  for (std::size_t m = 0; m < modules_.size(); ++m) {
    static_cast<void>(own_scope(m, -1));
    for (std::size_t r = 0; r < modules_[m].routines.size(); ++r)
      routines_[modules_[m].routines[r].name].emplace_back(m, static_cast<int>(r));
    for (const Declaration& declared : modules_[m].declarations) {
      const auto [known, fresh] =
          by_name_[m].emplace(std::pair(declared.routine, declared.name), &declared);
      if (!fresh && declared.storage != Storage::kLoop) note_twice(m, *known->second, declared);
      if (declared.routine < 0 && !declared.local) global_[declared.name].push_back({&declared, m});
    }
  }
  note_changes();
}

/// Records a name declared twice, in a file of several modules or one that no controller accepts:
/// the meaning of the name is not followed.
void Interpreter::note_twice(std::size_t module, const Declaration& one, const Declaration& other) {
  const std::string why = fmt::format("{} is declared twice ({} line {}, line {})",
                                      shown(other.spelled.empty() ? other.name : other.spelled),
                                      files_[module].name, one.line, other.line);
  for (const Declaration* declared : {&one, &other}) changed_.emplace(declared, why);
}

std::string Interpreter::place_of(std::size_t module, int line) const {
  return fmt::format("{} line {}", files_[module].name, line);
}

std::string Interpreter::text_of(const Expression& expression, const Scope& scope) const {
  const std::string& text = files_[scope.module].text;
  const std::string_view bytes =
      std::string_view(text).substr(expression.begin, expression.end - expression.begin);
  if (bytes.find_first_of(" \t\r\n\f!\"") == std::string_view::npos &&
      bytes.find('\0') == std::string_view::npos)
    return std::string(bytes);
  std::string shown;
  for (const Token token : tokens_of(bytes, kLexis)) shown += token.text;
  return shown;
}

std::optional<Interpreter::Found> Interpreter::find(const std::string& name,
                                                    const Scope& scope) const {
  const auto& own = by_name_[scope.module];
  if (scope.routine >= 0) {
    if (const auto it = own.find({scope.routine, name}); it != own.end())
      return Found{it->second, scope.module};
  }
  if (const auto it = own.find({-1, name}); it != own.end()) return Found{it->second, scope.module};
  return find_global(name, scope.module);
}

std::optional<Interpreter::Found> Interpreter::find_global(const std::string& name,
                                                           std::size_t module) const {
  const auto known = global_.find(name);
  if (known == global_.end()) return std::nullopt;
  const auto own =
      std::find_if(known->second.begin(), known->second.end(),
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
  if (scope == nullptr)
    scope = scopes_.emplace_back(std::make_unique<Scope>(Scope{module, routine})).get();
  return scope;
}

const std::vector<const Scope*>& Interpreter::scopes_of(std::size_t module, int routine) {
  const auto [entry, is_new] =
      ways_in_.emplace(std::pair(module, routine), std::vector<const Scope*>{});
  std::vector<const Scope*>& ways = entry->second;
  if (!is_new && !ways.empty()) return ways;
  const Scope* own = own_scope(module, routine);
  bool has_parameters = false;
  for (const Declaration& declared : modules_[module].declarations) {
    has_parameters |=
        declared.routine == routine && routine >= 0 && declared.storage == Storage::kParameter;
  }
  // During the search for paths into a routine, a recursive routine sees only its own.
  ways.push_back(own);
  if (!has_parameters) return ways;
  const std::string& name = modules_[module].routines[static_cast<std::size_t>(routine)].name;
  std::vector<const Scope*> found;
  for (std::size_t m = 0; m < modules_.size(); ++m) {
    for (const Instruction& call : modules_[m].instructions) {
      if (call.name != name || find_routine(name, m) != std::pair(module, routine)) continue;
      for (const Scope* caller : std::vector<const Scope*>(scopes_of(m, call.routine))) {
        if (found.size() >= kMostWaysIn || (m == module && call.routine == routine)) break;
        found.push_back(
            scopes_.emplace_back(std::make_unique<Scope>(Scope{module, routine, &call, caller}))
                .get());
      }
    }
  }
  std::vector<const Scope*>& result = ways_in_[{module, routine}];
  if (!found.empty()) result = std::move(found);
  return result;
}

std::optional<std::vector<std::size_t>> Interpreter::fields_of(const Expression& target,
                                                               const std::string& type,
                                                               std::size_t module) const {
  if (target.kind == Kind::kName) return std::vector<std::size_t>{};
  if (target.kind != Kind::kField) return std::nullopt;
  std::optional<std::vector<std::size_t>> fields = fields_of(target.parts[0], type, module);
  std::string inner = type;
  for (std::size_t k = 0; fields && k < fields->size(); ++k)
    inner = built_in().at(inner)[(*fields)[k]].type;
  const auto known = fields ? field(inner, target.name, module) : std::nullopt;
  if (!known || !built_in().contains(inner)) return std::nullopt;
  fields->push_back(known->index);
  return fields;
}

Told<const Expression*> Interpreter::bound(const Declaration& parameter, const Scope& scope) const {
  const std::string of =
      modules_[scope.module].routines[static_cast<std::size_t>(scope.routine)].name;
  if (scope.call == nullptr)
    return because(fmt::format("{} is handed over by whoever calls {}", parameter.name, of));
  if (const std::string why = changed(&parameter); !why.empty()) return because(why);
  const auto& order =
      modules_[scope.module].routines[static_cast<std::size_t>(scope.routine)].parameters;
  std::size_t position = 0;
  for (const Expression& argument : scope.call->arguments) {
    const bool is_it = argument.label.empty()
                           ? position < order.size() && order[position] == parameter.name
                           : argument.label == parameter.name;
    if (is_it) return &argument;
    if (argument.label.empty()) ++position;
  }
  return because(fmt::format("{} is not handed over to {}", parameter.name, of));
}

Told<std::pair<const Expression*, const Scope*>> Interpreter::handed_over(
    const Expression& expression, const Scope& scope) const {
  const Expression* now = &expression;
  const Scope* where = &scope;
  for (int depth = 0; now->kind == Kind::kName && depth < kDeepestCall; ++depth) {
    const auto found = find(now->name, *where);
    if (!found || found->declaration->storage != Storage::kParameter) break;
    const Told<const Expression*> argument = bound(*found->declaration, *where);
    if (!argument) return because(argument.error());
    now = *argument;
    where = where->caller;
  }
  return std::pair(now, where);
}

std::optional<Interpreter::Field> Interpreter::field(const std::string& type,
                                                     const std::string& name,
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

std::string Interpreter::type_of(const Expression& expression, const Scope& scope,
                                 int depth) const {
  if (depth > kDeepestCall) return "";
  switch (expression.kind) {
    case Kind::kName: {
      const auto found = find(expression.name, scope);
      return found ? found->declaration->type : "";
    }
    case Kind::kField: {
      const auto known =
          field(type_of(expression.parts[0], scope, depth + 1), expression.name, scope.module);
      return known ? known->type : "";
    }
    case Kind::kElement:
      return type_of(expression.parts[0], scope, depth + 1);
    case Kind::kCall:
      return expression.name == "offs" || expression.name == "reltool" ? "robtarget" : "";
    case Kind::kAggregate:
      if (expression.parts.size() == 4 && expression.parts[0].kind != Kind::kNumber)
        return "robtarget";
      return expression.parts.size() == 2 ? "jointtarget" : "";
    case Kind::kNumber:
      return "num";
    default:
      return "";
  }
}

Told<std::vector<Data>> Interpreter::data_of(const Expression& expression, const Scope& scope,
                                             int depth) const {
  if (depth > kDeepestCall) return because("it stands for itself");
  switch (expression.kind) {
    case Kind::kName: {
      const auto found = find(expression.name, scope);
      if (!found)
        return because(
            fmt::format("{} is not in the files handed over", shown(text_of(expression, scope))));
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
      // The value of a declaration is looked up where it stands.
      const Scope* where = declared.routine >= 0 ? &scope : own_.at({found->module, -1});
      if (set_in_order_.contains(&declared)) {
        const Told<const Expression*> now = as_set(declared);
        if (!now) return because(now.error());
        return std::vector<Data>{{*now, where, declared.type, &declared}};
      }
      if (!declared.value)
        return because(fmt::format("{} has no value in the file", shown(declared.spelled)));
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

Told<std::vector<Data>> Interpreter::field_of(const Expression& expression, const Scope& scope,
                                              int depth) const {
  const Told<std::vector<Data>> of = data_of(expression.parts[0], scope, depth + 1);
  if (!of) return of;
  std::vector<Data> all;
  for (const Data& data : *of) {
    const auto known = field(data.type, expression.name, data.scope->module);
    if (!known)
      return because(
          fmt::format("{} of a {} is not known", shown(expression.name.text()), shown(data.type)));
    const Expression* node = data.node;
    if (node->kind != Kind::kAggregate) {
      const Told<std::vector<Data>> inner = data_of(*node, *data.scope, depth + 1);
      if (!inner || inner->size() != 1 || (*inner)[0].node->kind != Kind::kAggregate)
        return because(fmt::format("{} is not constant", shown(text_of(*node, *data.scope))));
      node = (*inner)[0].node;
    }
    if (known->index >= node->parts.size())
      return because(fmt::format("a {} is incomplete", shown(data.type)));
    all.push_back({&node->parts[known->index], data.scope, known->type, data.declared});
  }
  return all;
}

Told<std::vector<Data>> Interpreter::element_of(const Expression& expression, const Scope& scope,
                                                int depth) const {
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

}  // namespace trammel::cam::rapid
