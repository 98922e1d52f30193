#include "clients/cam/rapid/motions.h"

#include <algorithm>
#include <set>

#include "clients/cam/number_text.h"

namespace trammel::cam::rapid {

namespace {

using Kind = Expression::Kind;

std::set<std::string> names_of_motions() {
  struct Family {
    const char* beginning;
    std::vector<const char*> ways, ends;
  };
  const std::vector<Family> families = {
      {"move", {"l", "j", "c", "absj"}, {"", "do", "ao", "go", "sync"}},
      {"trigg", {"l", "j", "c", "absj"}, {"", "ios"}},
      {"arc", {"l", "c", "l1", "c1", "l2", "c2"}, {"", "start", "end"}},
      {"spot", {"l", "j", "ml", "mj"}, {""}},
      {"disp", {"l", "c"}, {""}},
      {"paint", {"l", "c"}, {""}},
      {"cap", {"l", "c"}, {""}},
      {"search", {"l", "c"}, {""}},
  };
  std::set<std::string> names;
  for (const Family& family : families) {
    for (const char* way : family.ways) {
      for (const char* end : family.ends) names.insert(std::string(family.beginning) + way + end);
    }
  }
  return names;
}

/// `[100,500,5000,1000]`, and no target.
bool is_speed(const Expression& aggregate) {
  return !aggregate.parts.empty() && aggregate.parts.front().kind != Kind::kAggregate;
}

/// mm/s, of the tool: the value of `v100`, which a controller predefines, or of a constant
/// speeddata.
std::optional<double> speed_by(const Interpreter& meaning, const Expression& argument,
                               const Scope& scope) {
  const auto handed = meaning.handed_over(argument, scope);
  if (!handed) return std::nullopt;
  const auto& [expression, where] = *handed;
  if (expression->kind == Kind::kName && !meaning.find(expression->name, *where)) {
    const std::string& name = expression->name;
    if (!name.starts_with('v') || name.find_first_not_of("0123456789", 1) != std::string::npos)
      return std::nullopt;
    const auto number = read_number(std::string_view(name).substr(1));
    return number ? std::optional<double>(number->value) : std::nullopt;
  }
  const bool written_here = expression->kind == Kind::kAggregate;
  if (written_here && !is_speed(*expression)) return std::nullopt;
  if (!written_here && meaning.type_of(*expression, *where) != "speeddata") return std::nullopt;
  int ignored = 0;
  const Told<std::vector<double>> numbers = meaning.numbers_of(*expression, 4, *where, &ignored);
  return numbers ? std::optional<double>(numbers->front()) : std::nullopt;
}

}  // namespace

bool is_search(const std::string& name) { return name.starts_with("search"); }

bool is_motion(const std::string& name) {
  static const std::set<std::string> kNames = names_of_motions();
  return kNames.contains(name);
}

bool is_linear(const std::string& name) { return name.find('j') == std::string::npos; }

bool is_arc(const std::string& name) {
  for (const char* kind : {"movec", "triggc", "arcc", "dispc", "paintc", "capc"}) {
    if (name.starts_with(kind)) return true;
  }
  return false;
}

bool has_label(const Instruction& instruction, std::string_view label) {
  return std::any_of(instruction.arguments.begin(), instruction.arguments.end(),
                     [&](const Expression& argument) { return argument.label == label; });
}

const Expression* tool_argument(const Interpreter& meaning, const Instruction& motion,
                                const std::vector<const Expression*>& positional,
                                const Scope& scope) {
  for (const Expression* argument : positional) {
    const auto handed = meaning.handed_over(*argument, scope);
    if (!handed) {
      if (meaning.type_of(*argument, scope) == "tooldata") return argument;
      continue;
    }
    if (meaning.type_of(*handed->first, *handed->second) == "tooldata") return argument;
    if (argument->kind == Kind::kName && argument->name == "tool0") return argument;
  }
  // `MoveLDO p10,v100,fine,tool1,do1,1`: the tool stands behind the zone.
  const bool more_behind = motion.name.ends_with("do") || motion.name.ends_with("ao") ||
                           motion.name.ends_with("go") || motion.name.ends_with("sync");
  if (positional.size() < 3 || (more_behind && !motion.name.starts_with("move"))) return nullptr;
  const std::size_t at = !more_behind ? positional.size() - 1 : is_arc(motion.name) ? 4 : 3;
  return at < positional.size() && positional[at]->kind == Kind::kName ? positional[at] : nullptr;
}

std::optional<double> speed_of(Interpreter& meaning, std::size_t module,
                               const Instruction& motion) {
  std::optional<double> speed;
  if (!is_linear(motion.name)) return speed;
  for (const Scope* scope : meaning.scopes_of(module, motion.routine)) {
    for (const Expression& argument : motion.arguments) {
      if (!argument.label.empty()) continue;
      if (const auto one = speed_by(meaning, argument, *scope))
        speed = std::max(speed.value_or(0), *one);
    }
    for (const Expression& argument : motion.arguments) {
      if (argument.label != "v") continue;
      const Told<double> own = meaning.number_of(argument, *scope);
      speed = own ? std::optional<double>(*own) : std::nullopt;
    }
  }
  return speed;
}

}  // namespace trammel::cam::rapid
