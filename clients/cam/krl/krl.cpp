#include "clients/cam/krl/krl.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <tl/expected.hpp>

#include "clients/cam/flow.h"
#include "clients/cam/krl/calls.h"
#include "clients/cam/krl/lines.h"
#include "clients/cam/krl/state.h"
#include "clients/cam/krl/stated.h"
#include "clients/cam/krl/targets.h"
#include "clients/cam/krl/tools.h"
#include "clients/cam/krl/variables.h"
#include "clients/cam/sites.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"

namespace trammel::cam {

namespace {

using krl::Assigned;
using krl::done_later;
using krl::is_motion;
using krl::is_relative;
using krl::kAxes;
using krl::Line;
using krl::Routine;
using krl::State;
using krl::Token;
using krl::TokenKind;
using krl::Told;
using krl::Value;

constexpr int kDeepest = 20;  // calls within calls

/// `PTP`, `SPTP`, `PTP_REL`
bool is_by_axes(const std::string& word) { return word.find("PTP") != std::string::npos; }

/// `PTP $AXIS_ACT` goes to where the axes are: it has no target.
bool stands_still(const std::vector<Token>& tokens) {
  const bool alone =
      tokens.size() == 2 || (tokens.size() > 2 && tokens[2].kind == TokenKind::kWord);
  return alone && tokens[1].text == "$AXIS_ACT";
}

class Reader {
 public:
  Reader(std::vector<SourceFile> files, const ReadOptions& options) : options_(options) {
    program_.dialect = "krl";
    program_.files = std::move(files);
    program_.frames.push_back({"$BASE", Pose::Identity(), "no $BASE is set before it"});
    program_.frames.push_back({"$NULLFRAME", Pose::Identity(), ""});
    program_.tools.push_back(
        {"$TOOL", "", 0, std::nullopt, std::nullopt, 0, "no $TOOL is set before it"});
  }

  Program read() {
    for (std::size_t f = 0; f < program_.files.size(); ++f) collect(f);
    elsewhere_ = krl::note_handed_over(lines_, routines_, names_);
    names_.join_globals();
    krl::read_stated(lines_, options_, names_, program_);
    std::set<std::string> called;
    for (std::size_t r = 0; r < routines_.size(); ++r) by_name_.emplace(routines_[r].name, r);
    find_interrupts(called);
    for (const Routine& routine : routines_) note_calls(routine, called);
    for (std::size_t r = 0; r < routines_.size(); ++r) {
      if (!called.contains(routines_[r].name)) run(r, {}, 0);
    }
    for (std::size_t r = 0; r < routines_.size(); ++r) {
      if (!ran_.contains(r)) run(r, {}, 0);
    }
    for (std::size_t f = 0; f < lines_.size(); ++f) targets_.note_readings(f);
    sites_.finish(program_, [this](const Site& site, ProgramTarget& target) {
      return targets_.describe(site, target);
    });
    find_order();
    targets_.list_unused();
    note_elsewhere();
    note_angles();
    return std::move(program_);
  }

 private:
  // First pass: lines, routines, names.

  void collect(std::size_t f) {
    lines_.push_back(krl::lines_of(program_.files[f].text));
    int open = -1;  // the routine that the line is in
    MarkPlace mark{program_.files[f].text.starts_with("\xEF\xBB\xBF") ? std::size_t{3} : 0, "; "};
    const std::vector<Line>& lines = lines_[f];
    if (is_controllers_bas(f)) return program_.mark_places.push_back(mark);
    std::size_t spline =
        lines.size();  // the head of the block that the line is in; their number: none
    bool any = false;
    for (std::size_t k = 0; k < lines.size(); ++k) {
      tools_.note_tool_name(lines[k]);
      const std::vector<Token>& tokens = lines[k].tokens;
      const std::size_t first = !tokens.empty() && tokens[0].text == "GLOBAL" ? 1 : 0;
      const std::string word = tokens.empty() ? "" : tokens[0].text;
      if (word == "ENDSPLINE") spline = lines.size();
      if (spline < lines.size()) spline_heads_[{f, k}] = spline;
      if (word == "SPLINE" || word == "PTP_SPLINE") spline = k;
      if (tokens.size() > first + 1 &&
          (tokens[first].text == "DEF" || tokens[first].text == "DEFFCT" ||
           tokens[first].text == "DEFDAT")) {
        const std::size_t name =
            first + (tokens[first].text == "DEFFCT" && tokens.size() > first + 2 ? 2 : 1);
        if (!any) mark.at = k + 1 < lines.size() ? lines[k + 1].begin : mark.at;
        any = true;
        if (tokens[first].text == "DEFDAT") continue;
        names_.note_parameters(f, k, name + 1);
        routines_.push_back({tokens[name].text, f, k + 1, lines.size()});
        open = static_cast<int>(routines_.size()) - 1;
      } else if (!tokens.empty() && (tokens[0].text == "END" || tokens[0].text == "ENDFCT") &&
                 open >= 0) {
        routines_[static_cast<std::size_t>(open)].last = k;
        open = -1;
      } else {
        names_.note_value(f, k);
        note_moved_axes(tokens);
      }
    }
    if (!any) routines_.push_back({"", f, 0, lines.size()});
    program_.mark_places.push_back(mark);
  }

  /// `PTP {E1 90}`, `ASYPTP {E1 90}`: an external axis moves, and no target says it.
  void note_moved_axes(const std::vector<Token>& tokens) {
    if (tokens.empty() ||
        !(is_motion(tokens[0].text) || is_relative(tokens[0].text) || tokens[0].text == "ASYPTP"))
      return;
    std::size_t end = 0;
    const std::vector<Value> target = krl::operands_at(tokens, 1, &end);
    if (target.size() != 1 || target[0].kind != Value::Kind::kAggregate) return;
    const bool whole = target[0].field("X") != nullptr || target[0].field("A1") != nullptr;
    const bool relative = is_relative(tokens[0].text);
    for (int axis = 0; axis < 6 && (!whole || relative); ++axis) {
      const Value* to = target[0].field(fmt::format("E{}", axis + 1));
      const bool stands =
          relative && to != nullptr && to->kind == Value::Kind::kNumber && to->number == 0;
      if (to != nullptr && !stands) program_.moved_axes.insert(axis);
    }
  }

  /// The controller's own `bas.src`: BAS( ) means the same with it among the files as without.
  [[nodiscard]] bool is_controllers_bas(std::size_t f) const {
    const std::string& name = program_.files[f].name;
    if (upper(name.substr(name.find_last_of("/\\") + 1)) != "BAS.SRC") return false;
    return std::any_of(lines_[f].begin(), lines_[f].end(), [](const Line& line) {
      const std::size_t first = !line.tokens.empty() && line.tokens[0].text == "GLOBAL" ? 1 : 0;
      return line.tokens.size() > first + 1 && line.tokens[first].text == "DEF" &&
             line.tokens[first + 1].text == "BAS";
    });
  }

  /// Routines that the files lack may do more than they seem to.
  void note_elsewhere() {
    static const std::set<std::string> kOfTheController = {
        "PULSE",  "COPEN", "CCLOSE", "CREAD", "CWRITE",
        "SWRITE", "SREAD", "P00",    "CLEAR", "DELETE_BACKWARD_BUFFER"};
    for (const std::string& name : kOfTheController) elsewhere_.erase(name);
    if (elsewhere_.empty() || !setting_.by_hand()) return;
    constexpr std::size_t kMost = 5;
    const std::vector<std::string> all(elsewhere_.begin(), elsewhere_.end());
    const std::size_t shown_here = std::min(all.size(), kMost);
    program_.notes.push_back(fmt::format(
        "{}{}: not in the files handed over, taken to leave $TOOL, $BASE and $LOAD as they are",
        fmt::join(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(shown_here), ", "),
        all.size() > kMost ? fmt::format(" and {} more", all.size() - kMost) : ""));
  }

  // What `$machine.dat` says of the robot.

  // Tools and bases.

  // Second pass: what happens, in the order of the text.

  void note_calls(const Routine& routine, std::set<std::string>& called) const {
    for (std::size_t k = routine.first; k < routine.last; ++k) {
      const std::vector<Token>& tokens = lines_[routine.file][k].tokens;
      for (const std::size_t r : called_by(tokens)) called.insert(routines_[r].name);
    }
  }

  /// The routines that come in between.
  void find_interrupts(std::set<std::string>& called) {
    for (std::size_t f = 0; f < lines_.size(); ++f) {
      for (const Line& line : lines_[f]) {
        const std::size_t at = done_later(line.tokens);
        const auto routine = at == 0 ? by_name_.end() : by_name_.find(line.tokens[at].text);
        resumes_ |= !line.tokens.empty() && line.tokens[0].text == "RESUME";
        const auto known = [&] {
          return std::find(interrupts_.begin(), interrupts_.end(), routine->second);
        };
        if (routine == by_name_.end() || known() != interrupts_.end()) continue;
        called.insert(routine->first);
        interrupts_.push_back(routine->second);
      }
    }
  }
  static std::uint64_t bit_of(std::size_t interrupt) {
    return std::uint64_t{1} << std::min<std::size_t>(interrupt, 63);
  }

  /// What interrupts that are declared make of a state before a line.
  void come_in(State& state, int depth) {
    if (inside_interrupt_ || state.armed == 0) return;
    for (bool more = true; more;) {
      more = false;
      for (std::size_t i = 0; i < interrupts_.size(); ++i) {
        if ((state.armed & bit_of(i)) == 0) continue;
        inside_interrupt_ = true;
        const State back = end_of(interrupts_[i], state, depth + 1);
        inside_interrupt_ = false;
        const State was = state;
        setting_.join(
            state, back,
            fmt::format("the interrupt routine {}", shown(routines_[interrupts_[i]].name)));
        more |= !(state == was);
      }
    }
  }

  /// Before each line of a routine, and at its end.
  std::vector<State> states_in(std::size_t r, const State& begin, int depth) {
    const Routine& routine = routines_[r];
    const auto [order, is_new] = orders_.try_emplace(r);
    if (is_new) {
      std::vector<Step> steps;
      for (std::size_t k = routine.first; k < routine.last; ++k)
        steps.push_back(krl::step_of(lines_[routine.file][k].tokens));
      order->second = flow_of(steps);
      // RESUME ends what was interrupted, wherever it was.
      for (std::vector<std::size_t>& next : order->second.next) {
        if (resumes_) next.push_back(steps.size());
      }
    }
    return states_before(
        order->second, begin,
        [&](std::size_t step, State& state) {
          set(routine.file, routine.first + step, state, depth);
        },
        [&](State& state, const State& other, const std::string& by) {
          setting_.join(state, other, by);
        },
        [&](State& state) { come_in(state, depth); });
  }

  State end_of(std::size_t r, const State& begin, int depth) {
    const auto key = std::tuple(r, begin, inside_interrupt_);
    if (const auto known = ends_.find(key); known != ends_.end()) return known->second;
    ends_[key] = begin;
    return ends_[key] = states_in(r, begin, depth).back();
  }

  /// Its motions, and those of what it calls.
  void run(std::size_t r, const State& begin, int depth) {
    if (!run_.emplace(r, begin, inside_interrupt_).second) return;
    ran_.insert(r);
    const Routine routine = routines_[r];
    const std::vector<State> states = states_in(r, begin, depth);
    for (std::size_t k = routine.first; k < routine.last; ++k) {
      const std::vector<Token>& tokens = lines_[routine.file][k].tokens;
      if (tokens.empty()) continue;
      const State& state = states[k - routine.first];
      if (is_motion(tokens[0].text) || is_relative(tokens[0].text)) motion(routine.file, k, state);
      if (depth >= kDeepest) continue;
      for (const std::size_t called : called_by(tokens)) run(called, state, depth + 1);
      run_interrupts(state, depth);
    }
    run_interrupts(states.back(), depth);
  }

  void run_interrupts(const State& state, int depth) {
    for (std::size_t i = 0; i < interrupts_.size() && !inside_interrupt_; ++i) {
      if ((state.armed & bit_of(i)) == 0) continue;
      inside_interrupt_ = true;
      run(interrupts_[i], state, depth + 1);
      inside_interrupt_ = false;
    }
  }

  /// Procedures and functions, in their order.
  [[nodiscard]] std::vector<std::size_t> called_by(const std::vector<Token>& tokens) const {
    std::vector<std::size_t> called;
    if (done_later(tokens) > 0) return called;
    for (std::size_t at = 0; at + 1 < tokens.size(); ++at) {
      if (tokens[at].kind != TokenKind::kWord || tokens[at + 1].text != "(") continue;
      if (const auto routine = by_name_.find(tokens[at].text); routine != by_name_.end())
        called.push_back(routine->second);
    }
    return called;
  }

  /// What a line sets, and what it calls.
  void set(std::size_t f, std::size_t k, State& state, int depth) {
    const std::vector<Token>& tokens = lines_[f][k].tokens;
    setting_.set(f, k, state);
    const std::size_t later = done_later(tokens);
    for (std::size_t i = 0; i < interrupts_.size() && later > 0; ++i) {
      if (routines_[interrupts_[i]].name == tokens[later].text) state.armed |= bit_of(i);
    }
    if (depth >= kDeepest) return;
    for (const std::size_t called : called_by(tokens)) state = end_of(called, state, depth + 1);
  }

  void leave(std::size_t f, std::size_t k, const std::string& name, const std::string& why) {
    const Line& line = lines_[f][k];
    program_.moves[move_at(f, k)].left_some = true;
    if (left_.emplace(f, line.number, name).second)
      program_.left.push_back({name, f, line.number, line.tokens[0].text, why});
  }

  std::size_t move_at(std::size_t f, std::size_t k) {
    const auto [entry, is_new] = moves_.emplace(std::pair(f, k), program_.moves.size());
    if (is_new) program_.moves.push_back({f, lines_[f][k].number, {}, false});
    return entry->second;
  }

  void motion(std::size_t f, std::size_t k, State state) {
    const std::vector<Token>& tokens = lines_[f][k].tokens;
    const std::string& word = tokens[0].text;
    if (stands_still(tokens)) return;
    const std::size_t move = move_at(f, k);
    program_.moves[move].is_arc = word == "CIRC" || word == "SCIRC";
    if (is_relative(word))
      return leave(f, k, text_of(f, tokens, 1), "it is relative to where the robot is");
    if (const auto head = spline_heads_.find({f, k}); head != spline_heads_.end())
      setting_.apply_with(f, head->second, state);
    setting_.apply_with(f, k, state);
    if (state.speed > program_.moves[move].speed_mm_s.value_or(0) && !is_by_axes(word))
      program_.moves[move].speed_mm_s = state.speed;
    state.tool = tools_.tool_carrying(state.tool, state.load);
    std::size_t next = 1;
    const int count = word == "CIRC" || word == "SCIRC" ? 2 : 1;
    for (int target = 0; target < count; ++target) {
      const std::vector<Value> operands = krl::operands_at(tokens, next, &next);
      if (operands.empty()) return leave(f, k, "", "it has no target");
      use(f, k, operands, state, move);
      if (next >= tokens.size() || tokens[next].text != ",") break;
      ++next;
    }
    if (count == 2 && next < tokens.size() && tokens[next].text == "CA")
      by_angle_.insert({f, lines_[f][k].number});
  }

  /// `CIRC XP1,XP2,CA 360`: the circle through the points is corrected, and the arc ends elsewhere
  /// on it.
  void note_angles() {
    if (by_angle_.empty()) return;
    const auto& [f, line] = *by_angle_.begin();
    const std::string more =
        by_angle_.size() > 1 ? fmt::format(" and {} more", by_angle_.size() - 1) : "";
    program_.notes.push_back(
        fmt::format("an arc ends by its angle CA and not at its end point ({} line {}{}): the "
                    "circle through its points is corrected, and what lies beyond them follows it",
                    program_.files[f].name, line, more));
  }

  std::string text_of(std::size_t f, const std::vector<Token>& tokens, std::size_t from) const {
    if (from >= tokens.size()) return "";
    return program_.files[f].text.substr(tokens[from].begin,
                                         tokens.back().end - tokens[from].begin);
  }

  void use(std::size_t f, std::size_t k, const std::vector<Value>& operands, const State& state,
           std::size_t move) {
    const std::string name = program_.files[f].text.substr(
        operands.front().begin, operands.back().end - operands.front().begin);
    if (!state.fixed_tool.empty()) return leave(f, k, name, state.fixed_tool);
    if (!state.sensed.empty()) return leave(f, k, name, state.sensed);
    if (!state.soft.empty()) return leave(f, k, name, state.soft);
    const SiteUse use{state.tool,
                      state.frame,
                      lines_[f][k].tokens[0].text,
                      f,
                      lines_[f][k].number,
                      move,
                      !is_by_axes(lines_[f][k].tokens[0].text)};
    if (operands.size() > 1 || operands[0].kind == Value::Kind::kAggregate) {
      targets_.add({f, k, operands});
      note_axes(operands[0], move);
      return sites_.add(f, operands[0].begin, name, use);
    }
    if (operands[0].kind != Value::Kind::kName)
      return leave(f, k, name, "an expression decides it");
    const std::string& wanted = operands[0].name;
    if (wanted.starts_with("$"))
      return leave(f, k, name, fmt::format("{} decides it", shown(wanted)));
    if (wanted.find("[*]") == std::string::npos) {
      const Told<const Assigned*> one = names_.value_of(wanted, f);
      if (one && (*one)->operands.size() == 1) note_axes((*one)->operands[0], move);
      return use_named(f, k, wanted, name, use);
    }
    const std::string beginning = wanted.substr(0, wanted.find("[*]") + 1);
    bool any = false;
    for (const auto& [key, variable] : names_.all()) {
      if (!key.second.starts_with(beginning) || key.second == wanted) continue;
      any = true;
      const Assigned* at = variable.values.empty() ? nullptr : &variable.values[0];
      use_named(f, k, key.second,
                at == nullptr ? key.second : names_.spelled(key.second, at->file, at->line), use);
    }
    if (!any) leave(f, k, name, "an index chooses it, and its elements are not in the files");
  }

  void note_axes(const Value& value, std::size_t move) {
    if (const Told<std::vector<double>> axes = krl::Variables::numbers_of(value, kAxes))
      axes_[move] = *axes;
  }

  void use_named(std::size_t f, std::size_t k, const std::string& wanted, const std::string& name,
                 const SiteUse& use) {
    const Told<const Assigned*> assigned = names_.value_of(wanted, f);
    if (!assigned) return leave(f, k, name, assigned.error());
    const Assigned& at = **assigned;
    if (at.operands.empty()) return leave(f, k, name, "it is not constant");
    targets_.add(at);
    sites_.add(at.file, at.operands[0].begin, name, use);
  }

  // Which motions may be the last before each.

  /// Lines, arcs, and motions to positions without a status keep the posture of the motion before.
  void find_order() {
    std::vector<Step> steps;
    std::map<std::size_t, std::pair<std::size_t, std::size_t>> moves;  // file and line, by step
    for (const Routine& routine : routines_) {
      steps.push_back({Step::Kind::kRoutine, std::to_string(&routine - routines_.data())});
      for (std::size_t k = routine.first; k < routine.last; ++k) {
        const std::vector<Token>& tokens = lines_[routine.file][k].tokens;
        for (const std::size_t called : called_by(tokens))
          steps.push_back({Step::Kind::kCall, std::to_string(called)});
        const auto move = moves_.find({routine.file, k});
        // A line that is left leaves the posture as it was.
        if (move != moves_.end() &&
            (is_by_axes(tokens[0].text) || !program_.moves[move->second].targets.empty()))
          moves.emplace(steps.size(), std::pair(routine.file, k));
        steps.push_back(krl::step_of(tokens));
      }
      steps.push_back({Step::Kind::kEnd});
    }
    const auto before =
        motions_before(flow_of(steps), [&](std::size_t step) -> std::optional<std::size_t> {
          const auto move = moves.find(step);
          return move == moves.end() ? std::nullopt
                                     : std::optional<std::size_t>(moves_.at(move->second));
        });
    for (const auto& [step, place] : moves) follow(place.first, place.second, before[step]);
    for (const auto& [move, axes] : axes_) program_.moves[move].axes = axes;
  }

  /// Where the program begins, or an interrupt ends what it came in, what a target does not say is
  /// taken to be nearest to zero.
  void follow(std::size_t f, std::size_t k, const std::set<std::size_t>& before) {
    ProgramMove& move = program_.moves[moves_.at({f, k})];
    const bool by_axes = is_by_axes(lines_[f][k].tokens[0].text);
    const bool says = std::any_of(move.targets.begin(), move.targets.end(), [&](std::size_t t) {
      return program_.targets[t].configuration.said();
    });
    if (resumes_ || before.contains(kNoMotion) || (by_axes && (says || move.targets.empty())))
      return;
    move.choice = JointChoice::kOnALine;
    move.before = before;
  }

  // Targets.

  ReadOptions options_;
  Program program_;
  std::vector<std::vector<Line>> lines_;
  std::vector<Routine> routines_;
  krl::Variables names_{program_.files, lines_};
  krl::Tools tools_{lines_, names_, options_, program_};
  krl::Setting setting_{lines_, names_, tools_, program_};
  krl::Targets targets_{lines_, names_, options_, program_};
  std::map<std::pair<std::size_t, std::size_t>, std::size_t>
      spline_heads_;                            ///< of the lines in a spline block
  std::set<std::string> elsewhere_;             ///< routines that are called and not in the files
  std::map<std::string, std::size_t> by_name_;  ///< routines
  std::map<std::size_t, Flow> orders_;          ///< of the lines of each routine
  std::map<std::tuple<std::size_t, State, bool>, State> ends_;
  std::vector<std::size_t> interrupts_;  ///< routines that come in between
  bool resumes_ = false;                 ///< an interrupt may end what it came in
  bool inside_interrupt_ = false;
  std::set<std::tuple<std::size_t, State, bool>> run_;
  std::set<std::size_t> ran_;
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> moves_;
  std::set<std::tuple<std::size_t, int, std::string>> left_;
  std::set<std::pair<std::size_t, int>> by_angle_;   ///< arcs, by file and line
  std::map<std::size_t, std::vector<double>> axes_;  ///< deg, that motions command
  Sites sites_;
};

}  // namespace

Program read_krl(std::vector<SourceFile> files, const ReadOptions& options) {
  return Reader(std::move(files), options).read();
}

}  // namespace trammel::cam
