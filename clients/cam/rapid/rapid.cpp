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
#include "clients/cam/rapid/motions.h"
#include "clients/cam/rapid/order.h"
#include "clients/cam/rapid/parser.h"
#include "clients/cam/rapid/readings.h"
#include "clients/cam/rapid/state.h"
#include "clients/cam/rapid/targets.h"
#include "clients/cam/rapid/tools.h"
#include "clients/cam/scan.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"

namespace trammel::cam {

namespace {

using namespace rapid;
using Kind = Expression::Kind;

constexpr const char* kToolArgument = "tool";  // `\Tool:=`

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
    setting_.emplace(modules_, *meaning_, *tools_);
    readings_.emplace(modules_, *meaning_, program_);
    targets_.emplace(*meaning_, options_, program_);
  }

  RapidData data() {
    RapidData found;
    for (std::size_t m = 0; m < modules_.size(); ++m) {
      for (const Declaration& declared : modules_[m].declarations) {
        if (declared.routine >= 0 || !declared.value || declared.is_array) continue;
        const Data data{&*declared.value, &own(m), declared.type, &declared};
        if (declared.type == "tooldata") found.tools.push_back(tools_->declared_tool(data));
        const std::string where = fmt::format("{} line {}", program_.files[m].name, declared.line);
        if (declared.type == "wobjdata")
          found.frames.push_back({tools_->declared_frame(data), where});
        const auto load = declared.type == "loaddata" ? tools_->load_of(data) : std::nullopt;
        if (load) found.loads.push_back({declared.spelled, *load, where});
      }
    }
    return found;
  }

  Program read() {
    setting_->note_displacements();
    read_motions();
    for (const auto& [place, site] : sites_) readings_->add_place(place.first, place.second);
    readings_->find();
    program_.targets.reserve(sites_.size());
    for (auto& [place, site] : sites_) {
      finish(site, readings_->why_kept(place, site.uses.front().data.declared));
      site = {};
    }
    readings_->list_unused();
    note_soft_axes();
    return std::move(program_);
  }

 private:
  /// The persistents that other tasks of the controller set.
  static std::map<std::string, std::string> set_by(const std::vector<SourceFile>& beside) {
    if (beside.empty()) return {};
    std::vector<Module> modules;
    for (const SourceFile& file : beside) modules.push_back(parse(file.text));
    return Interpreter(beside, modules).set_for_all_tasks();
  }

  /// Below the head of the module, else at the top.
  static MarkPlace mark_place(const std::string& text, std::size_t head_end) {
    const std::size_t end = head_end == 0 ? std::string::npos : text.find('\n', head_end);
    const std::size_t top = first_byte(text);
    return {end == std::string::npos ? top : end + 1, "  ! "};
  }

  // Motions.

  void leave(std::size_t module, const Instruction& motion, const std::string& name,
             const std::string& why) {
    for (std::size_t k = program_.moves.size(); k-- > 0;) {
      if (program_.moves[k].file != module || program_.moves[k].line != motion.line) continue;
      program_.moves[k].left_some = true;
      break;
    }
    if (left_.emplace(module, motion.line, name).second)
      program_.left.push_back({name, module, motion.line, motion.spelled, why});
  }

  void read_motions() {
    const auto found = steps_of(program_.files, modules_, *meaning_);
    const auto& steps = std::get<0>(found);
    const auto& places = std::get<1>(found);
    std::map<std::size_t, std::size_t> move_of;  // by the step
    const Flow flow = flow_of(steps, true);
    const std::vector<State> states = states_before(
        flow, State{}, [&](std::size_t s, State& state) { setting_->set(places[s], state); },
        [&](State& state, const State& other, const std::string& by) {
          setting_->join(state, other, by);
        });
    for (std::size_t s = 0; s < steps.size(); ++s) {
      const Instruction* motion = places[s].instruction;
      const std::size_t module = places[s].module;
      if (motion == nullptr || !is_motion(motion->name) ||
          meaning_->find_routine(motion->name, module))
        continue;
      move_of.emplace(s, program_.moves.size());
      program_.moves.push_back({module, motion->line, {}, is_arc(motion->name)});
      state_ = states[s];
      meaning_->assume(setting_->settings(state_.settings));
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
    program_.notes.push_back(fmt::format(
        "{} ({}): on some ways to it {}\\Off holds, on others not; it is taken to go to its "
        "configuration",
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
    for (const Expression* argument : positional) readings_->note_names(*argument);
    program_.moves.back().speed_mm_s = speed_of(*meaning_, module, motion);
    const auto leave_it = [&](const std::string& why) {
      leave(module, motion,
            meaning_->text_of(*positional[0], *meaning_->scopes_of(module, motion.routine)[0]),
            why);
    };
    if (is_search(motion.name))
      return leave(module, motion, "", "a sensor decides where the motion ends");
    if (has_label(motion, "corr")) return leave_it("a sensor corrects the path (\\Corr)");
    if (has_label(motion, "track")) return leave_it("a sensor corrects the path (\\Track)");
    for (const std::size_t way : state_.given_way) {
      if (way != 0) return leave_it(setting_->displacement(way));
    }
    if (state_.displaced != 0) return leave_it(setting_->displacement(state_.displaced));
    if (!setting_->open_displacement().empty()) return leave_it(setting_->open_displacement());
    for (const Scope* scope : meaning_->scopes_of(module, motion.routine)) {
      const Expression* with =
          tool != nullptr ? tool : tool_argument(*meaning_, motion, positional, *scope);
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

  void use(std::size_t module, const Instruction& motion, const Expression& argument, bool joints,
           std::size_t tool, std::size_t frame, const Scope& scope) {
    const auto handed = meaning_->handed_over(argument, scope);
    if (!handed) return leave(module, motion, meaning_->text_of(argument, scope), handed.error());
    const auto& [expression, where] = *handed;
    const bool written_here =
        expression->kind == Kind::kAggregate || expression->kind == Kind::kCall;
    const Told<std::vector<Data>> all =
        written_here ? Told<std::vector<Data>>(std::vector<Data>{
                           {expression, where, joints ? "jointtarget" : "robtarget"}})
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
        site.name = all->size() > 1 ? meaning_->text_of(argument, scope)
                                    : meaning_->text_of(*expression, *where);
      }
      site.uses.push_back({tool, frame, &motion, module, program_.moves.size() - 1, data,
                           setting_->displacement(state_.external_displaced)});
    }
  }

  static std::size_t statement_of(const Data& data, const Scope* where, const Instruction& motion,
                                  const Expression* expression, const Expression* argument) {
    if (data.declared != nullptr) return data.declared->begin;
    if (expression == argument) return motion.begin;
    for (const Scope* scope = where; scope != nullptr; scope = scope->caller) {
      if (scope->call != nullptr && scope->call->begin <= data.node->begin &&
          data.node->end <= scope->call->end)
        return scope->call->begin;
    }
    return data.node->begin;
  }

  /// Soft servo reduces an axis' stiffness; the commanded place stays the same.
  void note_soft_axes() {
    std::vector<std::string> places;
    for (std::size_t m = 0; m < modules_.size(); ++m) {
      for (const Instruction& instruction : modules_[m].instructions) {
        if (instruction.name == "softact")
          places.push_back(meaning_->place_of(m, instruction.line));
      }
    }
    if (places.empty()) return;
    program_.notes.push_back(fmt::format(
        "SoftAct ({}{}): a soft axis gives way by what the model does not know; its targets are "
        "corrected as those of a stiff one",
        places.front(), places.size() > 1 ? fmt::format(" and {} more", places.size() - 1) : ""));
  }

  // Places.

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
         fmt::format("it is used in different ways: {}; --split makes a target of each",
                     fmt::join(ways, ", "))});
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
        leave(use->module, *use->motion, site.name,
              "it is used with another tool or frame too, and cannot be split");
        continue;
      }
      Data data = use->data;
      Data place{argument, &own(use->module), data.type, nullptr};
      add_target({use->module, use->motion->begin, site.name, {}, site.joints, true}, {use}, data,
                 &place);
    }
  }

  const Scope& own(std::size_t module) {
    return own_.emplace(module, Scope{module, -1}).first->second;
  }

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
      if (std::find(target.used_at.begin(), target.used_at.end(), use->motion->line) ==
          target.used_at.end())
        target.used_at.push_back(use->motion->line);
    }
    if (site.joints) note_axes(data, uses);
    const Told<void> read = site.joints ? targets_->read_joints(data, target)
                                        : targets_->read_target(data, uses, place, target);
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
    for (const Use* use : uses) {
      program_.moves[use->move].targets.push_back(program_.targets.size());
      program_.moves[use->move].another = targets_->another(*use, site.joints);
    }
    if (target.folded) targets_->note_original(site, place != nullptr ? *place : data, target);
    program_.targets.push_back(std::move(target));
  }

  void note_axes(const Data& data, const std::vector<const Use*>& uses) {
    const Told<JointValue> value = meaning_->joints_of(*data.node, *data.scope);
    if (!value) return;
    for (const Use* use : uses) program_.moves[use->move].axes = value->axes;
  }

  ReadOptions options_;
  Program program_;
  std::vector<Module> modules_;
  std::optional<Interpreter> meaning_;
  std::optional<Tools> tools_;
  std::optional<Setting> setting_;
  std::optional<Readings> readings_;
  std::optional<Targets> targets_;
  std::map<std::pair<std::size_t, std::size_t>, Site> sites_;
  std::map<std::size_t, Scope> own_;
  std::set<std::tuple<std::size_t, int, std::string>> left_;
  State state_;  ///< at the present motion
  bool goes_by_joints_before_ = false, undecided_confs_ = false;
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
