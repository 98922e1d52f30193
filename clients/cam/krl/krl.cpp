#include "clients/cam/krl/krl.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <deque>
#include <set>

#include "clients/cam/flow.h"
#include "clients/cam/krl/calls.h"
#include "clients/cam/krl/lines.h"
#include "clients/cam/krl/motions.h"
#include "clients/cam/krl/state.h"
#include "clients/cam/krl/stated.h"
#include "clients/cam/krl/statements.h"
#include "clients/cam/krl/targets.h"
#include "clients/cam/krl/tools.h"
#include "clients/cam/krl/variables.h"
#include "server/base/plain_text.h"

namespace trammel::cam {

namespace {

using krl::done_later;
using krl::Line;
using krl::Routine;
using krl::State;
using krl::Value;

constexpr int kDeepest = 20;  // calls within calls

class Reader {
 public:
  Reader(std::vector<SourceFile> files, const ReadOptions& options) : options_(options) {
    program_.dialect = "krl";
    program_.files = std::move(files);
    program_.frames.push_back({"$BASE", Pose::Identity(), "no $BASE is set before it"});
    program_.frames.push_back({"$NULLFRAME", Pose::Identity(), ""});
    tools_.unknown_tool("no $TOOL is set before it");
  }

  Program read() {
    for (std::size_t f = 0; f < program_.files.size(); ++f) collect(f);
    elsewhere_ = krl::note_handed_over(lines_, routines_, names_);
    names_.join_globals();
    krl::read_stated(lines_, options_, names_, program_);
    std::set<std::string> called;
    find_interrupts(called);
    for (const Routine& routine : routines_.all()) note_calls(routine, called);
    const std::size_t count = routines_.all().size();
    for (std::size_t r = 0; r < count; ++r) {
      if (!called.contains(routines_[r].name)) run(r, {}, 0);
    }
    for (std::size_t r = 0; r < count; ++r) {
      if (!ran_.contains(r)) run(r, {}, 0);
    }
    motions_.finish(resumes_);
    note_elsewhere();
    motions_.note_angles();
    return std::move(program_);
  }

 private:
  // First pass: lines, routines, names.

  void collect(std::size_t f) {
    const std::string& text = program_.files[f].text;
    lines_.push_back(krl::lines_of(text, capitals_.emplace_back(upper(text))));
    MarkPlace mark{first_byte(text), "; "};
    const std::vector<Line>& lines = lines_[f];
    if (is_controllers_bas(f)) return program_.mark_places.push_back(mark);
    constexpr std::size_t kNone = static_cast<std::size_t>(-1);
    std::size_t spline = kNone;  // the head of the block around the line
    bool any = false, open = false;
    for (std::size_t k = 0; k < lines.size(); ++k) {
      tools_.note_tool_name(lines[k]);
      const Tokens& tokens = lines[k].tokens;
      if (tokens[0].is("ENDSPLINE")) spline = kNone;
      if (spline != kNone) motions_.note_spline(f, k, spline);
      if (tokens[0].is("SPLINE") || tokens[0].is("PTP_SPLINE")) spline = k;
      if (const auto head = krl::head_of(tokens)) {
        if (!any) mark.at = k + 1 < lines.size() ? lines[k + 1].begin : mark.at;
        any = true;
        if (head->is_list) continue;
        names_.note_parameters(f, k, head->parameters);
        routines_.add({std::string(head->name), f, k + 1, lines.size()});
        open = true;
      } else if (open && (tokens[0].is("END") || tokens[0].is("ENDFCT"))) {
        routines_.last().last = k;
        open = false;
      } else {
        names_.note_value(f, k);
        note_moved_axes(tokens);
      }
    }
    if (!any) routines_.add({"", f, 0, lines.size()});
    program_.mark_places.push_back(mark);
  }

  /// `PTP {E1 90}`, `ASYPTP {E1 90}`: an external axis moves, but no target mentions the motion.
  void note_moved_axes(const Tokens& tokens) {
    const std::string_view word = tokens[0].text;
    const bool relative = krl::is_relative(word);
    if (!relative && !krl::is_motion(word) && word != "ASYPTP") return;
    const std::vector<Value> target = krl::operands_at(tokens, 1);
    if (target.size() != 1 || target[0].kind != Value::Kind::kAggregate) return;
    const bool whole = target[0].field("X") != nullptr || target[0].field("A1") != nullptr;
    for (int axis = 0; axis < 6 && (!whole || relative); ++axis) {
      const Value* to = target[0].field(fmt::format("E{}", axis + 1));
      const bool stands =
          relative && to != nullptr && to->kind == Value::Kind::kNumber && to->number == 0;
      if (to != nullptr && !stands) program_.moved_axes.insert(axis);
    }
  }

  /// The controller's own `bas.src`: BAS( ) has the same meaning with and without it.
  [[nodiscard]] bool is_controllers_bas(std::size_t f) const {
    const std::string& name = program_.files[f].name;
    if (upper(name.substr(name.find_last_of("/\\") + 1)) != "BAS.SRC") return false;
    return std::any_of(lines_[f].begin(), lines_[f].end(), [](const Line& line) {
      const auto head = krl::head_of(line.tokens);
      return head && !head->is_list && head->name == "BAS";
    });
  }

  /// A routine that is not in the files may do more than its name suggests.
  void note_elsewhere() {
    static const std::set<std::string> kOfTheController = {
        "PULSE",  "COPEN", "CCLOSE", "CREAD", "CWRITE",
        "SWRITE", "SREAD", "P00",    "CLEAR", "DELETE_BACKWARD_BUFFER"};
    for (const std::string& name : kOfTheController) elsewhere_.erase(name);
    if (elsewhere_.empty() || !settings_.by_hand()) return;
    constexpr std::size_t kMost = 5;
    const std::vector<std::string> all(elsewhere_.begin(), elsewhere_.end());
    const std::size_t shown_here = std::min(all.size(), kMost);
    program_.notes.push_back(fmt::format(
        "{}{}: not in the files handed over, taken to leave $TOOL, $BASE and $LOAD as they are",
        fmt::join(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(shown_here), ", "),
        all.size() > kMost ? fmt::format(" and {} more", all.size() - kMost) : ""));
  }

  // Second pass: the effects of the lines, in the order of the text.

  void note_calls(const Routine& routine, std::set<std::string>& called) const {
    for (std::size_t k = routine.first; k < routine.last; ++k) {
      for (const std::size_t r : routines_.called_by(lines_[routine.file][k].tokens))
        called.insert(routines_[r].name);
    }
  }

  /// The routines that come in between.
  void find_interrupts(std::set<std::string>& called) {
    for (const std::vector<Line>& lines : lines_) {
      for (const Line& line : lines) {
        resumes_ |= line.tokens[0].is("RESUME");
        const std::size_t at = done_later(line.tokens);
        const Routine* routine =
            at == 0 ? nullptr : routines_.find(std::string(line.tokens[at].text));
        if (routine == nullptr) continue;
        const auto number = static_cast<std::size_t>(routine - routines_.all().data());
        if (std::find(interrupts_.begin(), interrupts_.end(), number) != interrupts_.end())
          continue;
        called.insert(routine->name);
        interrupts_.push_back(number);
      }
    }
  }
  static std::uint64_t bit_of(std::size_t interrupt) {
    return std::uint64_t{1} << std::min<std::size_t>(interrupt, 63);
  }

  /// Adds the effects of declared interrupts to the state before a line.
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
        settings_.join(
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
      // RESUME ends the interrupted routine, wherever it was.
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
          settings_.join(state, other, by);
        },
        [&](State& state) { come_in(state, depth); });
  }

  State end_of(std::size_t r, const State& begin, int depth) {
    const auto key = std::tuple(r, begin, inside_interrupt_);
    if (const auto known = ends_.find(key); known != ends_.end()) return known->second;
    ends_[key] = begin;
    return ends_[key] = states_in(r, begin, depth).back();
  }

  /// Follows its motions, and those of its calls.
  void run(std::size_t r, const State& begin, int depth) {
    if (!run_.emplace(r, begin, inside_interrupt_).second) return;
    ran_.insert(r);
    const Routine routine = routines_[r];
    const std::vector<State> states = states_in(r, begin, depth);
    for (std::size_t k = routine.first; k < routine.last; ++k) {
      const Tokens& tokens = lines_[routine.file][k].tokens;
      if (tokens.empty()) continue;
      const State& state = states[k - routine.first];
      motions_.reach(routine.file, k, state);
      if (depth >= kDeepest) continue;
      for (const std::size_t called : routines_.called_by(tokens)) run(called, state, depth + 1);
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

  /// Applies the settings and the calls of a line.
  void set(std::size_t f, std::size_t k, State& state, int depth) {
    const Tokens& tokens = lines_[f][k].tokens;
    settings_.set(f, k, state);
    const std::size_t later = done_later(tokens);
    for (std::size_t i = 0; i < interrupts_.size() && later > 0; ++i) {
      if (tokens[later].is(routines_[interrupts_[i]].name)) state.armed |= bit_of(i);
    }
    if (depth >= kDeepest) return;
    for (const std::size_t called : routines_.called_by(tokens))
      state = end_of(called, state, depth + 1);
  }

  ReadOptions options_;
  Program program_;
  std::deque<std::string> capitals_;  ///< the files, to whose texts the lines refer
  std::vector<std::vector<Line>> lines_;
  krl::Routines routines_;
  krl::Variables names_{program_.files, lines_};
  krl::Tools tools_{lines_, names_, options_, program_};
  krl::Settings settings_{lines_, names_, tools_, program_};
  krl::Targets targets_{lines_, names_, options_, program_};
  krl::Motions motions_{lines_, routines_, names_, tools_, settings_, targets_, program_};
  std::set<std::string> elsewhere_;     ///< routines that are called and not in the files
  std::map<std::size_t, Flow> orders_;  ///< of the lines of each routine
  std::map<std::tuple<std::size_t, State, bool>, State> ends_;
  std::vector<std::size_t> interrupts_;  ///< routines that come in between
  bool resumes_ = false;                 ///< an interrupt may end the routine that it interrupted
  bool inside_interrupt_ = false;
  std::set<std::tuple<std::size_t, State, bool>> run_;
  std::set<std::size_t> ran_;
};

}  // namespace

Program read_krl(std::vector<SourceFile> files, const ReadOptions& options) {
  return Reader(std::move(files), options).read();
}

}  // namespace trammel::cam
