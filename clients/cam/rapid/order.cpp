#include "clients/cam/rapid/order.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <string>

#include "clients/cam/rapid/motions.h"
#include "server/base/letters.h"

namespace trammel::cam::rapid {

namespace {

using Kind = Expression::Kind;

/// The label of a routine that is named at run time.
constexpr const char* kAnyRoutine = "any";

class Order {
 public:
  Order(const std::vector<SourceFile>& files, const std::vector<Module>& modules,
        const Interpreter& meaning)
      : files_(files), modules_(modules), meaning_(meaning) {}

  std::pair<std::vector<Step>, std::vector<Place>> steps() const {
    std::pair<std::vector<Step>, std::vector<Place>> all;
    const auto add = [&](Step step, Place place) {
      all.first.push_back(std::move(step));
      all.second.push_back(place);
    };
    for (std::size_t m = 0; m < modules_.size(); ++m) {
      std::size_t turn = 0, assigned = 0;
      const std::vector<Turn>& turns = modules_[m].turns;
      const std::vector<Assignment>& assignments = modules_[m].assignments;
      const auto add_turns = [&](std::size_t before) {
        for (;;) {
          if (assigned < assignments.size() && assignments[assigned].before <= before &&
              assignments[assigned].turns <= turn) {
            if (meaning_.sets(assignments[assigned]))
              add({Step::Kind::kPlain, "", true}, {m, nullptr, &assignments[assigned]});
            ++assigned;
          } else if (turn < turns.size() && turns[turn].before <= before) {
            Step step = turns[turn++].step;
            if (step.kind == Step::Kind::kRoutine) step.label = fmt::format("{}:{}", m, step.label);
            add(std::move(step), {m});
          } else {
            return;
          }
        }
      };
      const std::vector<Instruction>& instructions = modules_[m].instructions;
      for (std::size_t i = 0; i < instructions.size(); ++i) {
        add_turns(i);
        add(step_of(m, instructions[i]), {m, &instructions[i], nullptr});
      }
      add_turns(instructions.size());
    }
    for (Step& step : late_routines()) add(std::move(step), {});
    return all;
  }

 private:
  /// The routines that a late-bound call may mean: those that no statement calls by name.
  std::vector<Step> late_routines() const {
    std::set<std::pair<std::size_t, int>>
        by_name;  // and the late-bound callers: a routine that calls itself has no beginning
    bool any = false;
    for (std::size_t m = 0; m < modules_.size(); ++m) {
      for (const Instruction& instruction : modules_[m].instructions) {
        if (const auto routine = meaning_.find_routine(instruction.name, m))
          by_name.insert(*routine);
        if (!is_late(instruction) || meaning_.find_routine(named_late(m, instruction), m)) continue;
        by_name.emplace(m, instruction.routine);
        any = true;
      }
    }
    if (!any) return {};
    std::vector<Step> steps = {{Step::Kind::kRoutine, kAnyRoutine}, {Step::Kind::kSwitch}};
    for (std::size_t m = 0; m < modules_.size(); ++m) {
      for (std::size_t r = 0; r < modules_[m].routines.size(); ++r) {
        const Routine& routine = modules_[m].routines[r];
        if (routine.is_function || routine.name == "main" ||
            by_name.contains({m, static_cast<int>(r)}))
          continue;
        steps.push_back({Step::Kind::kCase});
        steps.push_back({Step::Kind::kCall, fmt::format("{}:{}", m, r)});
      }
    }
    steps.push_back({Step::Kind::kEnd});
    steps.push_back({Step::Kind::kEnd});
    return steps;
  }

  static bool is_late(const Instruction& instruction) {
    return (instruction.name == kLateCall || instruction.name == "callbyvar") &&
           !instruction.arguments.empty();
  }

  /// The name that a late call spells out; empty: it is not known.
  std::string named_late(std::size_t module, const Instruction& instruction) const {
    const Expression& name = instruction.arguments[0];
    if (instruction.name != kLateCall || name.kind != Kind::kText) return "";
    const std::string& text = files_[module].text;
    return lower(text.substr(name.begin + 1, name.end - std::min(name.end, name.begin + 2)));
  }

  Step step_of(std::size_t module, const Instruction& instruction) const {
    static const std::set<std::string> kReturns = {"return", "raise", "exit", "exitcycle"};
    static const std::set<std::string> kGoesBack = {"retry", "trynext", "startmoveretry"};
    if (is_motion(instruction.name)) return {};
    if (kGoesBack.contains(instruction.name)) return {Step::Kind::kGoBack};
    if (instruction.name == "gripload" || instruction.name == "pdispoff")
      return {Step::Kind::kPlain, "", true};
    if (kReturns.contains(instruction.name)) return {Step::Kind::kReturn};
    if (instruction.name == "goto" && !instruction.arguments.empty())
      return {Step::Kind::kJump, instruction.arguments[0].name};
    const bool late = is_late(instruction);
    const auto routine =
        meaning_.find_routine(late ? named_late(module, instruction) : instruction.name, module);
    if (late && !routine) return {Step::Kind::kCall, kAnyRoutine};
    if (!routine) return {};
    return {Step::Kind::kCall, fmt::format("{}:{}", routine->first, routine->second)};
  }

  const std::vector<SourceFile>& files_;
  const std::vector<Module>& modules_;
  const Interpreter& meaning_;
};

}  // namespace

std::pair<std::vector<Step>, std::vector<Place>> steps_of(const std::vector<SourceFile>& files,
                                                          const std::vector<Module>& modules,
                                                          const Interpreter& meaning) {
  return Order(files, modules, meaning).steps();
}

}  // namespace trammel::cam::rapid
