#include "clients/cam/rapid/rapid.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <tuple>

#include "clients/cam/flow.h"
#include "clients/cam/rapid/interpreter.h"
#include "clients/cam/rapid/tools.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"

namespace trammel::cam {

namespace {

using namespace rapid;
using Kind = Expression::Kind;

constexpr const char* kToolArgument = "tool";  // `\Tool:=`

bool is_search(const std::string& name) { return name.starts_with("search"); }

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

/// Instructions of the controller that move the tool to the targets which they are given. What is merely called alike,
/// `MoveLOffset`, is a procedure of somebody's.
bool is_motion(const std::string& name) {
  static const std::set<std::string> kNames = names_of_motions();
  return kNames.contains(name);
}

/// Whether the tool goes to the target on a line or an arc.
bool is_linear(const std::string& name) { return name.find('j') == std::string::npos; }

/// The label of a routine that is named at run time.
constexpr const char* kAnyRoutine = "any";

/// From an instruction to another one the arm does not go where motions say.
struct GiveWay {
  const char *begins, *label;  ///< empty label: with any
  const char* ends;            ///< as names of instructions begin
  const char* why;
};
const std::array<GiveWay, 4>& give_ways() {
  static const std::array<GiveWay, 4> kAll = {
      {{"singarea", "lockaxis4", "singarea",
        "SingArea\\LockAxis4 holds axis 4, so that the orientation is not reached"},
       {"fcact", "", "fcdeact", "FCAct: a force decides where the tool goes"},
       {"softact", "", "softdeact", "SoftAct: a soft axis gives way, and the model knows stiff ones"},
       {"cssact", "", "cssdeact", "CSSAct: the arm gives way, and the model knows a stiff one"}}};
  return kAll;
}

/// A motion goes to this place with this tool in this frame.
struct Use {
  std::size_t tool = 0, frame = 0;
  const Instruction* motion = nullptr;
  std::size_t module = 0;
  std::size_t move = 0;  ///< of Program::moves
  Data data;
  std::string external_displaced = {};  ///< why external axes are not where the target has them; empty: they are
};

/// Bytes that hold a target, and what uses them.
struct Site {
  std::size_t module = 0;
  std::size_t statement = 0;  ///< first byte of the statement that it stands in
  std::string name;
  std::vector<Use> uses;
  bool joints = false;
  bool in_motion = false;  ///< stands in the motion itself
};

class Reader {
 public:
  Reader(std::vector<SourceFile> files, const ReadOptions& options) : options_(options) {
    program_.dialect = "rapid";
    program_.files = std::move(files);
    for (const SourceFile& file : program_.files) {
      modules_.push_back(parse(file.text));
      for (const Unbalanced& found : modules_.back().unbalanced)
        program_.cuts.push_back({modules_.size() - 1, found.line, found.what});
      program_.mark_places.push_back(mark_place(file.text, modules_.back().head_end));
    }
    meaning_.emplace(program_.files, modules_, set_by(options.beside));
    tools_.emplace(*meaning_, options_, program_);
  }

  RapidData data() {
    RapidData found;
    for (std::size_t m = 0; m < modules_.size(); ++m) {
      for (const Declaration& declared : modules_[m].declarations) {
        if (declared.routine >= 0 || !declared.value || declared.is_array) continue;
        const Data data{&*declared.value, &own(m), declared.type, &declared};
        if (declared.type == "tooldata") found.tools.push_back(tools_->declared_tool(data));
        const std::string where = fmt::format("{} line {}", program_.files[m].name, declared.line);
        if (declared.type == "wobjdata") found.frames.push_back({tools_->declared_frame(data), where});
        const auto load = declared.type == "loaddata" ? tools_->load_of(data) : std::nullopt;
        if (load) found.loads.push_back({declared.spelled, *load, where});
      }
    }
    return found;
  }

  Program read() {
    note_displacements();
    read_motions();
    note_references();
    for (std::size_t m = 0; m < modules_.size(); ++m) note_readings(m);
    program_.targets.reserve(sites_.size());
    for (auto& [place, site] : sites_) {
      finish(site, why_kept(place, site));
      site = {};
    }
    list_unused();
    return std::move(program_);
  }

 private:
  /// What other tasks of the controller set.
  static std::map<std::string, std::string> set_by(const std::vector<SourceFile>& beside) {
    if (beside.empty()) return {};
    std::vector<Module> modules;
    for (const SourceFile& file : beside) modules.push_back(parse(file.text));
    return Interpreter(beside, modules).set_for_all_tasks();
  }

  /// Below the head of the module, else at the top.
  static MarkPlace mark_place(const std::string& text, std::size_t head_end) {
    const std::size_t end = head_end == 0 ? std::string::npos : text.find('\n', head_end);
    const std::size_t top = text.starts_with("\xEF\xBB\xBF") ? 3 : 0;
    return {end == std::string::npos ? top : end + 1, "  ! "};
  }

  // Motions.

  void leave(std::size_t module, const Instruction& motion, const std::string& name, const std::string& why) {
    for (std::size_t k = program_.moves.size(); k-- > 0;) {
      if (program_.moves[k].file != module || program_.moves[k].line != motion.line) continue;
      program_.moves[k].left_some = true;
      break;
    }
    if (left_.emplace(module, motion.line, name).second)
      program_.left.push_back({name, module, motion.line, motion.spelled, why});
  }

  /// Where a routine leaves targets displaced, all motions may be.
  void note_displacements() {
    for (std::size_t m = 0; m < modules_.size(); ++m) {
      std::map<int, std::string> open;
      for (const Instruction& instruction : modules_[m].instructions) {
        if (displaces(instruction)) open[instruction.routine] = displacement(m, instruction);
        if (instruction.name == "pdispoff") open.erase(instruction.routine);
      }
      for (const auto& [routine, why] : open) open_displacement_ = why + ", and is not switched off where it stands";
    }
  }
  static bool displaces(const Instruction& instruction) {
    return instruction.name == "pdispon" || instruction.name == "pdispset";
  }
  static bool displaces_external(const Instruction& instruction) {
    return instruction.name == "eoffson" || instruction.name == "eoffsset";
  }
  std::string displacement(std::size_t module, const Instruction& instruction) const {
    const char* what = displaces_external(instruction) ? "its external axes" : "it";
    return fmt::format("{} displaces {} ({})", instruction.spelled, what, meaning_->place_of(module, instruction.line));
  }
  std::size_t known_displacement(const std::string& why) {
    const auto known = std::find(displacements_.begin(), displacements_.end(), why);
    if (known != displacements_.end()) return static_cast<std::size_t>(known - displacements_.begin());
    displacements_.push_back(why);
    return displacements_.size() - 1;
  }

  /// An instruction, or a word that decides the order.
  struct Place {
    std::size_t module = 0;
    const Instruction* instruction = nullptr;  ///< nullptr: a word, or an assignment
    const Assignment* assignment = nullptr;
  };

  /// The statements of all modules in a row.
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
            if (meaning_->sets(assignments[assigned]))
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

  /// What a call may mean whose routine is named at run time: a routine that nothing calls by its name.
  std::vector<Step> late_routines() const {
    std::set<std::pair<std::size_t, int>> by_name;  // and those that call so: one that calls itself has no beginning
    bool any = false;
    for (std::size_t m = 0; m < modules_.size(); ++m) {
      for (const Instruction& instruction : modules_[m].instructions) {
        if (const auto routine = meaning_->find_routine(instruction.name, m)) by_name.insert(*routine);
        if (!is_late(instruction) || meaning_->find_routine(named_late(m, instruction), m)) continue;
        by_name.emplace(m, instruction.routine);
        any = true;
      }
    }
    if (!any) return {};
    std::vector<Step> steps = {{Step::Kind::kRoutine, kAnyRoutine}, {Step::Kind::kSwitch}};
    for (std::size_t m = 0; m < modules_.size(); ++m) {
      for (std::size_t r = 0; r < modules_[m].routines.size(); ++r) {
        const Routine& routine = modules_[m].routines[r];
        if (routine.is_function || routine.name == "main" || by_name.contains({m, static_cast<int>(r)})) continue;
        steps.push_back({Step::Kind::kCase});
        steps.push_back({Step::Kind::kCall, fmt::format("{}:{}", m, r)});
      }
    }
    steps.push_back({Step::Kind::kEnd});
    steps.push_back({Step::Kind::kEnd});
    return steps;
  }
  static bool is_late(const Instruction& instruction) {
    return (instruction.name == kLateCall || instruction.name == "callbyvar") && !instruction.arguments.empty();
  }
  /// The name that a late call spells out; empty: it is not known.
  std::string named_late(std::size_t module, const Instruction& instruction) const {
    const Expression& name = instruction.arguments[0];
    if (instruction.name != kLateCall || name.kind != Kind::kText) return "";
    const std::string& text = program_.files[module].text;
    return in_lower_case(text.substr(name.begin + 1, name.end - std::min(name.end, name.begin + 2)));
  }

  Step step_of(std::size_t module, const Instruction& instruction) const {
    static const std::set<std::string> kReturns = {"return", "raise", "exit", "exitcycle"};
    static const std::set<std::string> kGoesBack = {"retry", "trynext", "startmoveretry"};
    if (is_motion(instruction.name)) return {};
    if (kGoesBack.contains(instruction.name)) return {Step::Kind::kGoBack};
    if (instruction.name == "gripload" || instruction.name == "pdispoff") return {Step::Kind::kPlain, "", true};
    if (kReturns.contains(instruction.name)) return {Step::Kind::kReturn};
    if (instruction.name == "goto" && !instruction.arguments.empty())
      return {Step::Kind::kJump, instruction.arguments[0].name};
    const bool late = is_late(instruction);
    const auto routine = meaning_->find_routine(late ? named_late(module, instruction) : instruction.name, module);
    if (late && !routine) return {Step::Kind::kCall, kAnyRoutine};
    if (!routine) return {};
    return {Step::Kind::kCall, fmt::format("{}:{}", routine->first, routine->second)};
  }

  /// Whether the controller goes to the configuration of a target, or stays as near as it can.
  enum class Confs { kOn, kOff, kUndecided };

  /// What holds where a motion begins.
  struct State {
    std::size_t load = 0;                         ///< as tools_ numbers them; 0: the tool's own
    std::size_t displaced = 0;                    ///< of displacements_; 0: none
    std::size_t external_displaced = 0;           ///< the same
    std::array<std::size_t, 4> given_way{};       ///< the same, of give_ways()
    std::size_t settings = 0;                     ///< of settings_
    Confs lines = Confs::kOn, axes = Confs::kOn;  ///< ConfL, ConfJ
    bool operator==(const State&) const = default;
  };

  void set(const Place& place, State& state) {
    if (place.assignment != nullptr) {
      Settings settings = *settings_[state.settings];
      meaning_->set(*place.assignment, settings);
      state.settings = known_settings(std::move(settings));
    }
    if (place.instruction == nullptr) return;
    const Instruction& instruction = *place.instruction;
    if (instruction.name == "gripload") state.load = tools_->load_set(place.module, instruction);
    if (instruction.name == "pdispoff") state.displaced = 0;
    if (instruction.name == "eoffsoff") state.external_displaced = 0;
    for (std::size_t k = 0; k < state.given_way.size(); ++k) {
      const GiveWay& way = give_ways()[k];
      if (instruction.name.starts_with(way.ends)) state.given_way[k] = 0;
      if (instruction.name != way.begins || (*way.label != '\0' && !has_label(instruction, way.label))) continue;
      state.given_way[k] =
          known_displacement(fmt::format("{} ({})", way.why, meaning_->place_of(place.module, instruction.line)));
    }
    if (instruction.name == "confl") state.lines = confs_of(instruction);
    if (instruction.name == "confj") state.axes = confs_of(instruction);
    if (displaces(instruction)) state.displaced = known_displacement(displacement(place.module, instruction));
    if (displaces_external(instruction))
      state.external_displaced = known_displacement(displacement(place.module, instruction));
  }
  std::size_t known_settings(Settings settings) {
    const auto [known, fresh] = settings_at_.emplace(std::move(settings), settings_.size());
    if (fresh) settings_.push_back(&known->first);
    return known->second;
  }
  /// What holds on both ways; nullptr where they differ.
  static Settings on_both_ways(const Settings& one, const Settings& other) {
    Settings both;
    for (const Settings* settings : {&one, &other}) {
      const Settings& beside = settings == &one ? other : one;
      for (const auto& [of, parts] : *settings) {
        const auto there = beside.find(of);
        for (const auto& [fields, assignment] : parts) {
          const auto same = there == beside.end() ? parts.end() : there->second.find(fields);
          const bool agrees = there != beside.end() && same != there->second.end() && same->second == assignment;
          both[of][fields] = agrees ? assignment : nullptr;
        }
      }
    }
    return both;
  }
  static Confs confs_of(const Instruction& instruction) {
    return has_label(instruction, "off") ? Confs::kOff : Confs::kOn;
  }
  static bool has_label(const Instruction& instruction, std::string_view label) {
    return std::any_of(instruction.arguments.begin(), instruction.arguments.end(),
                       [&](const Expression& argument) { return argument.label == label; });
  }
  void join(State& state, const State& other, const std::string& by) {
    state.displaced = std::max(state.displaced, other.displaced);
    state.external_displaced = std::max(state.external_displaced, other.external_displaced);
    for (std::size_t k = 0; k < state.given_way.size(); ++k)
      state.given_way[k] = std::max(state.given_way[k], other.given_way[k]);
    if (state.settings != other.settings)
      state.settings = known_settings(on_both_ways(*settings_[state.settings], *settings_[other.settings]));
    if (state.lines != other.lines) state.lines = Confs::kUndecided;
    if (state.axes != other.axes) state.axes = Confs::kUndecided;
    if (state.load == other.load) return;
    state.load = tools_->undecided_load(
        state.load, by.empty() ? "GripLoad: a branch, a loop or a caller decides what the robot carries"
                               : fmt::format("GripLoad: {} may change what the robot carries", by));
  }

  void read_motions() {
    const auto found = this->steps();
    const auto& steps = std::get<0>(found);
    const auto& places = std::get<1>(found);
    std::map<std::size_t, std::size_t> move_of;  // by the step
    const Flow flow = flow_of(steps, true);
    const std::vector<State> states = states_before(
        flow, State{}, [&](std::size_t s, State& state) { set(places[s], state); },
        [&](State& state, const State& other, const std::string& by) { join(state, other, by); });
    for (std::size_t s = 0; s < steps.size(); ++s) {
      const Instruction* motion = places[s].instruction;
      const std::size_t module = places[s].module;
      if (motion == nullptr || !is_motion(motion->name) || meaning_->find_routine(motion->name, module)) continue;
      move_of.emplace(s, program_.moves.size());
      program_.moves.push_back({module, motion->line, {}, is_arc(motion->name)});
      state_ = states[s];
      meaning_->assume(*settings_[state_.settings]);
      note_confs(module, *motion);
      read_motion(module, *motion);
    }
    if (!goes_by_joints_before_) return;
    const auto before = motions_before(flow, [&](std::size_t s) -> std::optional<std::size_t> {
      const auto move = move_of.find(s);
      return move == move_of.end() ? std::nullopt : std::optional<std::size_t>(move->second);
    });
    for (const auto& [step, move] : move_of) program_.moves[move].before = before[step];
  }

  /// `ConfL\Off`: the controller stays in the posture before.
  void note_confs(std::size_t module, const Instruction& motion) {
    const bool on_a_line = is_linear(motion.name);
    const Confs confs = on_a_line ? state_.lines : state_.axes;
    if (confs == Confs::kOn) return;
    if (confs == Confs::kOff) {
      program_.moves.back().choice = on_a_line ? JointChoice::kOnALine : JointChoice::kNearest;
      goes_by_joints_before_ = true;
      return;
    }
    if (undecided_confs_) return;
    undecided_confs_ = true;
    program_.notes.push_back(
        fmt::format("{} ({}): on some ways to it {}\\Off holds, on others not; it is taken to go to its configuration",
                    motion.spelled, meaning_->place_of(module, motion.line), on_a_line ? "ConfL" : "ConfJ"));
  }

  void read_motion(std::size_t module, const Instruction& motion) {
    std::vector<const Expression*> positional;
    const Expression* frame = nullptr;
    const Expression* tool = nullptr;
    for (const Expression& argument : motion.arguments) {
      if (argument.label.empty()) positional.push_back(&argument);
      if (argument.label == "wobj") frame = &argument;
      if (argument.label == kToolArgument) tool = &argument;
    }
    if (positional.empty()) return;
    for (const Expression* argument : positional) note_names(*argument);
    note_speed(module, motion);
    const auto leave_it = [&](const std::string& why) {
      leave(module, motion, meaning_->text_of(*positional[0], *meaning_->scopes_of(module, motion.routine)[0]), why);
    };
    if (is_search(motion.name)) return leave(module, motion, "", "a sensor decides where the motion ends");
    if (has_label(motion, "corr")) return leave_it("a sensor corrects the path (\\Corr)");
    if (has_label(motion, "track")) return leave_it("a sensor corrects the path (\\Track)");
    for (const std::size_t way : state_.given_way) {
      if (way != 0) return leave_it(displacements_[way]);
    }
    if (state_.displaced != 0) return leave_it(displacements_[state_.displaced]);
    if (!open_displacement_.empty()) return leave_it(open_displacement_);
    for (const Scope* scope : meaning_->scopes_of(module, motion.routine)) {
      const Expression* with = tool != nullptr ? tool : tool_argument(motion, positional, *scope);
      if (with == nullptr) {
        leave_it("it has no tool");
        continue;
      }
      const bool joints = motion.name.starts_with("moveabsj");
      const std::size_t targets = is_arc(motion.name) ? 2 : 1;
      for (std::size_t k = 0; k < std::min(targets, positional.size()); ++k) {
        use(module, motion, *positional[k], joints,
            tools_->tool_carrying(tools_->tool_of(*with, *scope), state_.load, motion, *scope),
            tools_->frame_of(frame, *scope), *scope);
      }
    }
  }

  /// The fastest that its callers hand over; `\V:=60` decides it.
  void note_speed(std::size_t module, const Instruction& motion) {
    if (!is_linear(motion.name)) return;
    std::optional<double>& speed = program_.moves.back().speed_mm_s;
    for (const Scope* scope : meaning_->scopes_of(module, motion.routine)) {
      for (const Expression& argument : motion.arguments) {
        if (!argument.label.empty()) continue;
        if (const auto one = speed_of(argument, *scope)) speed = std::max(speed.value_or(0), *one);
      }
      for (const Expression& argument : motion.arguments) {
        if (argument.label != "v") continue;
        const Told<double> own = meaning_->number_of(argument, *scope);
        speed = own ? std::optional<double>(*own) : std::nullopt;
      }
    }
  }

  /// `[100,500,5000,1000]`, and no target.
  static bool is_speed(const Expression& aggregate) {
    return !aggregate.parts.empty() && aggregate.parts.front().kind != Kind::kAggregate;
  }

  /// mm/s, of the tool: what `v100`, which a controller predefines, or a constant speeddata says.
  std::optional<double> speed_of(const Expression& argument, const Scope& scope) const {
    const auto handed = meaning_->handed_over(argument, scope);
    if (!handed) return std::nullopt;
    const auto& [expression, where] = *handed;
    if (expression->kind == Kind::kName && !meaning_->find(expression->name, *where)) {
      const std::string& name = expression->name;
      if (!name.starts_with('v') || name.find_first_not_of("0123456789", 1) != std::string::npos) return std::nullopt;
      const auto number = read_number(std::string_view(name).substr(1));
      return number ? std::optional<double>(number->value) : std::nullopt;
    }
    const bool written_here = expression->kind == Kind::kAggregate;
    if (written_here && !is_speed(*expression)) return std::nullopt;
    if (!written_here && meaning_->type_of(*expression, *where) != "speeddata") return std::nullopt;
    int ignored = 0;
    const Told<std::vector<double>> numbers = meaning_->numbers_of(*expression, 4, *where, &ignored);
    return numbers ? std::optional<double>(numbers->front()) : std::nullopt;
  }

  /// `MoveC`, `TriggC`, `ArcC1Start`: the letter behind the kind of motion.
  static bool is_arc(const std::string& name) {
    for (const char* kind : {"movec", "triggc", "arcc", "dispc", "paintc", "capc"}) {
      if (name.starts_with(kind)) return true;
    }
    return false;
  }

  /// The argument that is a tool: one that is declared as such, or the last.
  const Expression* tool_argument(const Instruction& motion, const std::vector<const Expression*>& positional,
                                  const Scope& scope) const {
    for (const Expression* argument : positional) {
      const auto handed = meaning_->handed_over(*argument, scope);
      if (!handed) {
        if (meaning_->type_of(*argument, scope) == "tooldata") return argument;
        continue;
      }
      if (meaning_->type_of(*handed->first, *handed->second) == "tooldata") return argument;
      if (argument->kind == Kind::kName && argument->name == "tool0") return argument;
    }
    // `MoveLDO p10,v100,fine,tool1,do1,1`: the tool stands behind the zone.
    const bool more_behind = motion.name.ends_with("do") || motion.name.ends_with("ao") ||
                             motion.name.ends_with("go") || motion.name.ends_with("sync");
    if (positional.size() < 3 || (more_behind && !motion.name.starts_with("move"))) return nullptr;
    const std::size_t at = !more_behind ? positional.size() - 1 : is_arc(motion.name) ? 4 : 3;
    return at < positional.size() && positional[at]->kind == Kind::kName ? positional[at] : nullptr;
  }

  void use(std::size_t module, const Instruction& motion, const Expression& argument, bool joints, std::size_t tool,
           std::size_t frame, const Scope& scope) {
    const auto handed = meaning_->handed_over(argument, scope);
    if (!handed) return leave(module, motion, meaning_->text_of(argument, scope), handed.error());
    const auto& [expression, where] = *handed;
    const bool written_here = expression->kind == Kind::kAggregate || expression->kind == Kind::kCall;
    const Told<std::vector<Data>> all =
        written_here
            ? Told<std::vector<Data>>(std::vector<Data>{{expression, where, joints ? "jointtarget" : "robtarget"}})
            : meaning_->data_of(*expression, *where);
    if (!all) return leave(module, motion, meaning_->text_of(argument, scope), all.error());
    for (const Data& data : *all) {
      const std::size_t of = data.scope->module;
      Site& site = sites_[{of, data.node->begin}];
      if (site.uses.empty()) {
        site.module = of;
        site.joints = joints;
        site.in_motion = written_here;
        site.statement = statement_of(data, where, motion, expression, &argument);
        site.name = all->size() > 1 ? meaning_->text_of(argument, scope) : meaning_->text_of(*expression, *where);
      }
      site.uses.push_back(
          {tool, frame, &motion, module, program_.moves.size() - 1, data, displacements_[state_.external_displaced]});
    }
  }

  static std::size_t statement_of(const Data& data, const Scope* where, const Instruction& motion,
                                  const Expression* expression, const Expression* argument) {
    if (data.declared != nullptr) return data.declared->begin;
    if (expression == argument) return motion.begin;
    for (const Scope* scope = where; scope != nullptr; scope = scope->caller) {
      if (scope->call != nullptr && scope->call->begin <= data.node->begin && data.node->end <= scope->call->end)
        return scope->call->begin;
    }
    return data.node->begin;
  }

  // Places.

  /// Why the bytes at a place must stay as they are; empty: they need not.
  [[nodiscard]] std::string why_kept(const std::pair<std::size_t, std::size_t>& place, const Site& site) const {
    const auto behind = references_.upper_bound(place);
    if (behind != references_.begin()) {
      const auto& [begin, reference] = *std::prev(behind);
      if (begin.first == place.first && place.second < reference.end) return reference.why;
    }
    const auto read = read_.find(site.uses.front().data.declared);
    return read == read_.end() ? "" : read->second;
  }

  void finish(const Site& site, const std::string& kept) {
    std::vector<std::vector<const Use*>> groups;
    for (const Use& use : site.uses) {
      const auto same = std::find_if(groups.begin(), groups.end(), [&](const auto& group) {
        return group[0]->tool == use.tool && group[0]->frame == use.frame;
      });
      if (same == groups.end())
        groups.push_back({&use});
      else
        same->push_back(&use);
    }
    const bool is_read = !kept.empty();
    if ((groups.size() > 1 || is_read) && !options_.split) {
      for (const Use& use : site.uses) program_.moves[use.move].left_some = true;
    }
    if (groups.size() > 1 && !options_.split) return leave_ambiguous(site, groups);
    if (is_read && !options_.split) return leave_read(site, kept);
    for (std::size_t k = 0; k < groups.size(); ++k) {
      if (k == 0 && !is_read)
        add_target(site, groups[k], site.uses.front().data);
      else
        split_off(site, groups[k]);
    }
  }

  void leave_read(const Site& site, const std::string& why) {
    const Use& first = site.uses.front();
    program_.left.push_back({site.name, site.module, first.data.node->line, first.motion->spelled,
                             why + "; --split makes a target of each motion"});
  }

  void leave_ambiguous(const Site& site, const std::vector<std::vector<const Use*>>& groups) {
    std::vector<std::string> ways;
    for (const auto& group : groups) {
      ways.push_back(fmt::format("tool {} in {} ({})", called(program_.tools[group[0]->tool]),
                                 shown(program_.frames[group[0]->frame].name),
                                 meaning_->place_of(group[0]->module, group[0]->motion->line)));
    }
    const Use& first = site.uses.front();
    program_.left.push_back(
        {site.name, site.module, first.data.node->line, first.motion->spelled,
         fmt::format("it is used in different ways: {}; --split makes a target of each", fmt::join(ways, ", "))});
  }

  /// The argument of each motion becomes a target of its own.
  void split_off(const Site& site, const std::vector<const Use*>& group) {
    std::set<const Instruction*> done;
    for (const Use* use : group) {
      if (!done.insert(use->motion).second) continue;
      const Expression* argument = nullptr;
      for (const Expression& candidate : use->motion->arguments) {
        if (candidate.label.empty() && meaning_->text_of(candidate, own(use->module)) == site.name)
          argument = &candidate;
      }
      if (argument == nullptr || argument->kind == Kind::kElement) {
        leave(use->module, *use->motion, site.name, "it is used with another tool or frame too, and cannot be split");
        continue;
      }
      Data data = use->data;
      Data place{argument, &own(use->module), data.type, nullptr};
      add_target({use->module, use->motion->begin, site.name, {}, site.joints, true}, {use}, data, &place);
    }
  }

  const Scope& own(std::size_t module) { return own_.emplace(module, Scope{module, -1}).first->second; }

  /// Writes the target at `place`, or where `data` stands.
  void add_target(const Site& site, const std::vector<const Use*>& uses, const Data& data,
                  const Data* place = nullptr) {
    const Use& first = *uses.front();
    ProgramTarget target;
    target.name = site.name;
    target.file = site.module;
    target.line = place != nullptr ? first.motion->line : data.node->line;
    target.motion = first.motion->spelled;
    target.tool = first.tool;
    target.frame = first.frame;
    target.linear = is_linear(first.motion->name);
    for (const Use* use : uses) {
      if (std::find(target.used_at.begin(), target.used_at.end(), use->motion->line) == target.used_at.end())
        target.used_at.push_back(use->motion->line);
    }
    if (site.joints) note_axes(data, uses);
    const Told<void> read = site.joints ? read_joints(data, target) : read_target(data, uses, place, target);
    std::string why = read ? "" : read.error();
    if (why.empty()) why = program_.tools[target.tool].why_not;
    if (why.empty()) why = program_.frames[target.frame].why_not;
    for (const Use* use : uses) {
      if (why.empty() && !target.external.empty()) why = use->external_displaced;
    }
    if (!why.empty()) {
      program_.left.push_back({target.name, target.file, target.line, target.motion, why});
      for (const Use* use : uses) program_.moves[use->move].left_some = true;
      return;
    }
    for (const Use* use : uses) program_.moves[use->move].targets.push_back(program_.targets.size());
    if (target.folded) note_original(site, place != nullptr ? *place : data, target);
    program_.targets.push_back(std::move(target));
  }

  /// The line above the statement that keeps what was folded.
  void note_original(const Site& site, const Data& place, ProgramTarget& target) const {
    const std::string& text = program_.files[site.module].text;
    target.comment_at = line_begin(text, site.statement);
    const std::size_t indent = text.find_first_not_of(" \t", target.comment_at);
    std::string original = meaning_->text_of(*place.node, *place.scope);
    target.comment = text.substr(target.comment_at, indent - target.comment_at) + "! trammel: was " + original;
  }

  void note_axes(const Data& data, const std::vector<const Use*>& uses) {
    const Told<JointValue> value = meaning_->joints_of(*data.node, *data.scope);
    if (!value) return;
    for (const Use* use : uses) program_.moves[use->move].axes = value->axes;
  }

  Told<void> read_joints(const Data& data, ProgramTarget& target) {
    target.coordinates = Coordinates::kJoints;
    if (options_.keep_joints) return because("joint targets are kept (--keep-joints)");
    const Told<JointValue> value = meaning_->joints_of(*data.node, *data.scope);
    if (!value) return because(value.error());
    target.numbers = value->axes;
    note_external(value->external, target);
    rewrite(data.node->parts[0], *data.scope, 0, 6, value->decimals, target);
    return {};
  }

  static void note_external(const std::array<double, 6>& external, ProgramTarget& target) {
    for (int k = 0; k < 6; ++k) {
      if (std::abs(external[static_cast<std::size_t>(k)]) < kNoAxis)
        target.external[k] = external[static_cast<std::size_t>(k)];
    }
  }

  Told<void> read_target(const Data& data, const std::vector<const Use*>& uses, const Data* place,
                         ProgramTarget& target) const {
    const Told<TargetValue> value = meaning_->target_of(*data.node, *data.scope);
    if (!value) return because(value.error());
    // The same bytes reached through different callers must mean the same.
    for (const Use* use : uses) {
      if (use->data.node == data.node && use->data.scope == data.scope) continue;
      const Told<TargetValue> other = meaning_->target_of(*use->data.node, *use->data.scope);
      if (!other) return because(other.error());
      if (other->numbers != value->numbers) return because("its callers hand over different values");
    }
    target.coordinates = Coordinates::kQuaternion;
    target.numbers = value->numbers;
    note_external(value->external, target);
    target.configuration = configuration_of(value->conf);
    const Data& where = place != nullptr ? *place : data;
    const bool in_place = where.node->kind == Kind::kAggregate && where.node->parts.size() == 4;
    if (in_place) {
      rewrite(where.node->parts[0], *where.scope, 0, 3, value->decimals, target);
      rewrite(where.node->parts[1], *where.scope, 3, 4, value->rotation_decimals, target);
    } else {
      rewrite_whole(*where.node, *value, target);
    }
    return {};
  }

  /// cf1, cf4, cf6: quarter turns of joints 1, 4, 6; cfx: the branch.
  static Configuration configuration_of(const std::array<double, 4>& conf) {
    Configuration configuration;
    const double branch = conf[3];
    if (branch >= 0 && branch <= 7 && branch == std::floor(branch)) configuration.conf = static_cast<int>(branch);
    configuration.near.resize(6);
    constexpr std::array<std::size_t, 3> kJoints = {0, 3, 5};
    for (std::size_t k = 0; k < 3; ++k) {
      if (std::abs(conf[k]) < 100) configuration.near[kJoints[k]] = (conf[k] + 0.5) * kPi / 2;
    }
    return configuration;
  }

  /// `count` numbers from `first` on are written where the expression stands.
  void rewrite(const Expression& expression, const Scope& scope, std::size_t first, std::size_t count, int decimals,
               ProgramTarget& target) const {
    const std::string& text = program_.files[scope.module].text;
    if (expression.kind == Kind::kAggregate && expression.parts.size() == count) {
      for (std::size_t k = 0; k < count; ++k) {
        const Expression& part = expression.parts[k];
        const auto written = part.kind == Kind::kNumber
                                 ? read_number(std::string_view(text).substr(part.begin, part.end - part.begin))
                                 : std::nullopt;
        NumberStyle style;
        style.decimals = decimals;
        if (!written) target.folded = true;
        target.rewrites.push_back({{part.begin, part.end}, {}, {{first + k, written ? written->style : style}}});
      }
      return;
    }
    target.folded = true;
    Rewrite whole{{expression.begin, expression.end}, {"["}, {}};
    add_numbers(first, count, decimals, whole);
    whole.texts.back() += "]";
    target.rewrites.push_back(std::move(whole));
  }

  /// Adds numbers with commas between.
  static void add_numbers(std::size_t first, std::size_t count, int decimals, Rewrite& whole) {
    for (std::size_t k = 0; k < count; ++k) {
      NumberStyle style;
      style.decimals = decimals;
      whole.slots.push_back({first + k, style});
      whole.texts.emplace_back(k + 1 < count ? "," : "");
    }
  }

  static void rewrite_whole(const Expression& expression, const TargetValue& value, ProgramTarget& target) {
    target.folded = true;
    Rewrite whole{{expression.begin, expression.end}, {"[["}, {}};
    add_numbers(0, 3, value.decimals, whole);
    whole.texts.back() += "],[";
    add_numbers(3, 4, std::max(value.rotation_decimals, 6), whole);
    std::vector<std::string> external;
    for (const double axis : value.external)
      external.push_back(std::abs(axis) >= kNoAxis ? "9E+09" : fmt::format("{}", axis));
    whole.texts.back() += fmt::format("],[{}],[{}]]", fmt::join(value.conf, ","), fmt::join(external, ","));
    target.rewrites.push_back(std::move(whole));
  }

  // Displacements are measured from some points: a correction of these would displace what follows the wrong way.

  /// `PDispOn\ExeP:=pFound,pRef,tGun`: how many of the first arguments are such.
  static std::size_t old_points(const std::string& name) {
    static const std::map<std::string, std::size_t> kOldPoints = {{"pdispon", 1}, {"defdframe", 3}, {"defaccframe", 1}};
    const auto known = kOldPoints.find(name);
    return known == kOldPoints.end() ? 0 : known->second;
  }

  void note_references() {
    std::set<const Declaration*> measured;  // `pRef:=p10;` hands on
    for (bool grows = true; grows;) {
      const std::size_t before = measured.size();
      for (std::size_t m = 0; m < modules_.size(); ++m) {
        for (const Instruction& instruction : modules_[m].instructions)
          note_references(instruction.name, instruction.spelled, instruction.arguments, {m, instruction.routine},
                          measured);
        for (const Assignment& assignment : modules_[m].assignments) {
          const Scope at{m, assignment.routine};
          note_references(assignment.value, at, measured);
          const auto to = meaning_->find(root_of(assignment.target)->name, at);
          if (to && measured.contains(to->declaration))
            note_reference(assignment.value, at, root_text(assignment.target, m), assignment.line, measured);
        }
      }
      grows = measured.size() > before;
    }
  }

  void note_references(const std::string& name, const std::string& spelled, const std::vector<Expression>& arguments,
                       const Scope& at, std::set<const Declaration*>& measured) {
    std::size_t position = 0;
    for (const Expression& argument : arguments) {
      if (argument.label.empty() && position++ < old_points(name))
        note_reference(argument, at, spelled, argument.line, measured);
      note_references(argument, at, measured);
    }
  }
  void note_references(const Expression& expression, const Scope& at, std::set<const Declaration*>& measured) {
    const std::string name = expression.kind == Kind::kCall ? expression.name.text() : "";
    note_references(name, name, expression.parts, at, measured);
  }

  void note_reference(const Expression& point, const Scope& at, const std::string& by, int line,
                      std::set<const Declaration*>& measured) {
    const auto named = meaning_->find(root_of(point)->name, at);
    if (named) measured.insert(named->declaration);
    for (const Scope* scope : meaning_->scopes_of(at.module, at.routine)) {
      const Told<std::vector<Data>> all = meaning_->data_of(point, *scope);
      for (const Data& data : all ? *all : std::vector<Data>{}) {
        references_.try_emplace({data.scope->module, data.node->begin},
                                Reference{data.node->end, fmt::format("a displacement is measured from it ({}, {})",
                                                                      shown(by), meaning_->place_of(at.module, line))});
      }
    }
  }

  // What else reads the targets that are written anew.

  void note_readings(std::size_t m) {
    const Module& module = modules_[m];
    for (const Assignment& assignment : module.assignments) {
      const std::string by = root_text(assignment.target, m);
      note_readings(m, {assignment.begin, assignment.end}, assignment.routine, assignment.line, by);
    }
    for (const Condition& condition : module.conditions)
      note_readings(m, {condition.begin, condition.end}, condition.routine, condition.line, "");
    for (const Instruction& instruction : module.instructions) {
      const bool motion = is_motion(instruction.name) && !meaning_->find_routine(instruction.name, m);
      const bool calls = std::any_of(instruction.arguments.begin(), instruction.arguments.end(),
                                     [](const Expression& argument) { return argument.kind == Kind::kCall; });
      if (motion && !calls) continue;
      calls_routine_ = !motion && meaning_->find_routine(instruction.name, m).has_value();
      if (!motion && !calls_routine_) note_unknown(m, instruction);
      moves_ = motion;
      note_readings(m, {instruction.begin, instruction.end}, instruction.routine, instruction.line, "");
      calls_routine_ = moves_ = false;
    }
  }

  /// The whole that a field or an element is a part of; another expression itself.
  static const Expression* root_of(const Expression& target) {
    const Expression* root = &target;
    while ((root->kind == Kind::kField || root->kind == Kind::kElement) && !root->parts.empty()) root = &root->parts[0];
    return root;
  }
  std::string root_text(const Expression& target, std::size_t m) { return meaning_->text_of(*root_of(target), own(m)); }

  void note_readings(std::size_t m, const Span& span, int routine, int line, const std::string& by) {
    if (span.end <= span.begin) return;
    const std::string_view text = std::string_view(program_.files[m].text).substr(span.begin, span.end - span.begin);
    const std::vector<Token> tokens = tokens_of(text);
    const auto word = [&](std::size_t k) {
      return k < tokens.size() ? text.substr(tokens[k].begin, tokens[k].end - tokens[k].begin) : std::string_view();
    };
    for (std::size_t k = 0; k < tokens.size(); ++k) {
      if (tokens[k].kind != TokenKind::kWord || word(k + 1) == "(") continue;
      if (k > 0 && (word(k - 1) == "." || word(k - 1) == "\\")) continue;
      std::size_t behind = k + 1;
      if (word(behind) == "{") {
        while (behind < tokens.size() && word(behind) != "}") ++behind;
        ++behind;
      }
      const int dots = (word(behind) == "." ? 1 : 0) + (word(behind) == "." && word(behind + 2) == "." ? 1 : 0);
      note_reading({m, routine}, std::string(word(k)), dots, line, by);
    }
  }

  void note_reading(const Scope& at, const std::string& spelled, int dots, int line, const std::string& by) {
    Expression name;
    name.kind = Kind::kName;
    name.name = in_lower_case(spelled);
    const auto found = meaning_->find(name.name, at);
    if (!found || found->declaration->type == "num") return;
    const bool is_parameter = found->declaration->storage == Storage::kParameter;
    const std::vector<const Scope*> ways =
        is_parameter ? meaning_->scopes_of(at.module, at.routine) : std::vector<const Scope*>{&at};
    for (const Scope* scope : ways) {
      const Told<std::vector<Data>> all = meaning_->data_of(name, *scope);
      if (!all) continue;
      for (const Data& data : *all) {
        if (data.declared != nullptr && data.declared->value) add_reading(data, at, spelled, dots, line, by);
      }
    }
  }

  void add_reading(const Data& data, const Scope& at, const std::string& spelled, int dots, int line,
                   const std::string& by) {
    const Expression& value = *data.declared->value;
    const std::size_t file = data.scope->module;
    const auto site = sites_.lower_bound({file, value.begin});
    if (site == sites_.end() || site->first.first != file || site->first.second >= value.end) return;
    const bool is_target = data.declared->type == "robtarget" || data.declared->type == "jointtarget";
    const bool numbers = dots > (is_target ? 0 : 1);
    if (numbers && !moves_) {
      read_.emplace(data.declared,
                    fmt::format("its numbers are read elsewhere too ({})", meaning_->place_of(at.module, line)));
      return;
    }
    if (calls_routine_) return;  // what becomes of it is told there
    program_.readings.push_back({file, {value.begin, value.end}, spelled, at.module, line, by, moves_});
  }

  /// Declared targets that nothing moves to.
  void list_unused() {
    for (std::size_t m = 0; m < modules_.size(); ++m) {
      for (const Declaration& declared : modules_[m].declarations) {
        const bool is_target = declared.type == "robtarget" || declared.type == "jointtarget";
        if (!is_target || declared.storage == Storage::kParameter || !declared.value) continue;
        const Expression& value = *declared.value;
        const auto site = sites_.lower_bound({m, value.begin});
        const bool used = site != sites_.end() && site->first.first == m && site->first.second < value.end;
        if (used || named_.contains(declared.name)) continue;
        const auto unknown = unknown_.find(&declared);
        if (unknown == unknown_.end())
          program_.left.push_back({declared.spelled, m, declared.line, "", "no motion in these files goes to it"});
        else
          program_.left.push_back(
              {declared.spelled, m, declared.line, unknown->second->spelled,
               fmt::format("{} is not known here: it may move the robot there", shown(unknown->second->spelled))});
      }
    }
  }

  /// `FCPressL p10,v50,...`, and procedures of modules that are not there, may be motions.
  void note_unknown(std::size_t m, const Instruction& instruction) {
    static const std::set<std::string> kTakeTargets = {"wzhomejointdef", "wzlimjointdef", "mtooltcpcalib",
                                                       "mtoolrotcalib",  "stooltcpcalib", "stoolrotcalib"};
    if (is_still(instruction.name) || kTakeTargets.contains(instruction.name)) return;
    for (const Expression& argument : instruction.arguments) {
      for (const Scope* scope : meaning_->scopes_of(m, instruction.routine)) {
        const Told<std::vector<Data>> all = meaning_->data_of(*root_of(argument), *scope);
        for (const Data& data : all ? *all : std::vector<Data>{}) unknown_.emplace(data.declared, &instruction);
      }
    }
  }

  /// The names in what motions go to: what becomes of them is told there.
  void note_names(const Expression& expression) {
    if (expression.kind == Kind::kName) named_.insert(expression.name);
    for (const Expression& part : expression.parts) note_names(part);
  }

  ReadOptions options_;
  Program program_;
  std::vector<Module> modules_;
  std::optional<Interpreter> meaning_;
  std::optional<Tools> tools_;
  std::map<std::pair<std::size_t, std::size_t>, Site> sites_;
  std::map<std::size_t, Scope> own_;
  std::set<std::tuple<std::size_t, int, std::string>> left_;
  std::set<std::string> named_;
  std::string open_displacement_;
  std::vector<std::string> displacements_ = std::vector<std::string>(1);
  std::map<Settings, std::size_t> settings_at_ = {{{}, 0}};
  std::vector<const Settings*> settings_ = {&settings_at_.begin()->first};
  State state_;  ///< of the motion that is read
  bool calls_routine_ = false, moves_ = false;
  bool goes_by_joints_before_ = false, undecided_confs_ = false;
  std::map<const Declaration*, std::string> read_;            ///< why the numbers of a target must stay
  std::map<const Declaration*, const Instruction*> unknown_;  ///< that is given a target and may be a motion
  struct Reference {
    std::size_t end = 0;
    std::string why;
  };
  std::map<std::pair<std::size_t, std::size_t>, Reference> references_;  ///< the same, by module and first byte
};

}  // namespace

RapidData read_rapid_data(std::vector<SourceFile> files) {
  const ReadOptions options;
  return Reader(std::move(files), options).data();
}

Program read_rapid(std::vector<SourceFile> files, const ReadOptions& options) {
  return Reader(std::move(files), options).read();
}

}  // namespace trammel::cam
