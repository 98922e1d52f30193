#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

/// The possible orders of a program's statements, and the settings before each of them. Every
/// dialect describes its statements; loops, jumps, calls, interrupts and error handlers are
/// followed here, in the same way for all dialects.
namespace trammel::cam {

/// The effect of a statement on the order.
struct Step {
  enum class Kind {
    kPlain,
    kIf,       ///< opens a block that may be passed over
    kSwitch,   ///< opens a block of kCase and kElse
    kCase,     ///< another branch of the block, `ELSEIF` too
    kElse,     ///< the last branch of the block, without a condition
    kWhile,    ///< opens a block that repeats, or is passed over
    kRepeat,   ///< opens a block that repeats and is entered
    kRoutine,  ///< opens a block that calls enter; a block without calls is entered by the user who
               ///< runs the program
    kInterrupt,  ///< opens a block that comes in before any other statement, and goes back there
    kEnd,        ///< of the innermost block
    kExit,       ///< to behind the innermost loop
    kContinue,   ///< to the head of the innermost loop
    kReturn,     ///< from the routine
    kHandler,    ///< ends the statements above it in the routine; entered when one of these fails
    kGoBack,     ///< from a handler back to the place where it was entered
    kLabel,      ///< target of jumps
    kJump,       ///< to the labels of that name
    kJumpMaybe,  ///< there, or on
    kCall        ///< of the routine of that name; without one it has no effect
  };
  Kind kind = Kind::kPlain;
  std::string label =
      {};  ///< of a label, jump, routine or call; for an interrupt or handler, the name in reasons
  bool never_fails = false;  ///< no error handler is entered at it
};

/// Statements that come in before others and may go back there: an interrupt routine, an error
/// handler.
struct Aside {
  std::string name;
  std::size_t first = 0, end = 0;  ///< its statements; on the way back, control does not leave it
                                   ///< beyond `end`
  std::vector<std::size_t> goes_back;  ///< the steps that lead back
  std::size_t from = 0, to = 0;  ///< it may be entered before the steps [from, to), which are not
                                 ///< its own
  bool at_failures = false;      ///< true: not before steps that never fail
  std::vector<bool> begun = {};  ///< of each step: it may have begun there; empty: anywhere
};

/// The possible paths of a program.
struct Flow {
  std::vector<std::vector<std::size_t>>
      next;                          ///< statements that may come behind each; their number: none
  std::vector<std::size_t> entries;  ///< the first statement, and the routines that nothing calls
  std::vector<Aside> asides;
  std::vector<bool> never_fails;  ///< of each statement
};

/// `in_any_order`: routines that nothing calls are entered again and again, behind one another.
[[nodiscard]] Flow flow_of(const std::vector<Step>& steps, bool in_any_order = false);

/// The statements that may come behind `steps`, by their number.
[[nodiscard]] std::vector<bool> behind(const Flow& flow, const std::vector<std::size_t>& steps);

/// The state before each statement; see states_before().
template <typename State, typename Apply, typename Join>
class StatesBefore {
 public:
  StatesBefore(const Flow& flow, const Apply& apply, const Join& join,
               const std::function<void(State&)>& also)
      : flow_(flow),
        apply_(apply),
        join_(join),
        also_(also),
        before_(flow.next.size() + 1),
        reached_(flow.next.size() + 1) {}

  std::vector<State> find(const State& entry) {
    for (const std::size_t step : flow_.entries) reach(step, entry);
    settle();
    for (std::size_t step = 0; step <= flow_.next.size(); ++step) {
      if (before_[step]) continue;
      State state = entry;
      if (step > 0) {
        state = *before_[step - 1];
        apply_(step - 1, state);
      }
      reach(step, state);
      settle();
    }
    std::vector<State> all;
    all.reserve(before_.size());
    for (std::optional<State>& state : before_) all.push_back(std::move(*state));
    return all;
  }

 private:
  using States = std::vector<std::optional<State>>;

  void reach(std::size_t step, const State& state) {
    if (!grow(reached_[step], state)) return;
    State now = *reached_[step];
    if (step < flow_.next.size()) come_in(step, now);
    if (grow(before_[step], now)) open_.insert(step);
  }

  void settle() {
    while (!open_.empty()) {
      const std::size_t step = *open_.begin();
      open_.erase(open_.begin());
      if (step >= flow_.next.size()) continue;
      State state = *before_[step];
      apply_(step, state);
      for (const std::size_t after : flow_.next[step]) reach(after, state);
    }
  }

  /// Adds the effects of asides on the state before a step, until the state no longer changes.
  void come_in(std::size_t step, State& state) {
    for (bool more = true; more;) {
      more = false;
      for (std::size_t a = 0; a < flow_.asides.size(); ++a) {
        const Aside& aside = flow_.asides[a];
        const bool own = step >= aside.first && step <= aside.end;
        if (own || step < aside.from || step >= aside.to ||
            (aside.at_failures && flow_.never_fails[step]) ||
            (!aside.begun.empty() && !aside.begun[step]))
          continue;
        reach(aside.first, state);
        const std::optional<State> back = made_by(a, state);
        if (!back || *back == state) continue;
        const State was = state;
        join_(state, *back, aside.name);
        more |= !(state == was);
      }
    }
    if (also_) also_(state);
  }

  /// The state with which an aside returns if it is entered with `state`; empty: it does not
  /// return.
  std::optional<State> made_by(std::size_t a, const State& state) {
    made_.resize(flow_.asides.size());
    for (const auto& [before, after] : made_[a]) {
      if (before == state) return after;
    }
    const Aside& aside = flow_.asides[a];
    States inside(flow_.next.size() + 1);
    std::set<std::size_t> open = {aside.first};
    inside[aside.first] = state;
    while (!open.empty()) {
      const std::size_t step = *open.begin();
      open.erase(open.begin());
      if (step >= flow_.next.size() || step == aside.end) continue;
      State now = *inside[step];
      apply_(step, now);
      for (const std::size_t after : flow_.next[step]) {
        if (grow(inside[after], now)) open.insert(after);
      }
    }
    std::optional<State> back;
    for (const std::size_t step : aside.goes_back) {
      if (inside[step]) grow(back, *inside[step]);
    }
    made_[a].emplace_back(state, back);
    return back;
  }

  /// Makes `known` hold for `state`, too. True if it had to change.
  bool grow(std::optional<State>& known, const State& state) const {
    if (!known) {
      known = state;
      return true;
    }
    const State was = *known;
    if (!(was == state)) join_(*known, state, std::string());
    return !(*known == was);
  }

  const Flow& flow_;
  const Apply& apply_;
  const Join& join_;
  const std::function<void(State&)>& also_;
  States before_;               ///< including the effects of asides
  States reached_;              ///< reached through the statements above
  std::set<std::size_t> open_;  ///< in the order of the text
  std::vector<std::vector<std::pair<State, std::optional<State>>>> made_;  ///< by each aside
};

/// Computes the state before each statement, and the final state, from `entry` at the entries of
/// the flow. `apply(step, state)` gives the state behind a statement. `join(state, other, by)`
/// merges two states where paths meet; `by` names the aside on one of the paths (empty: none).
/// Repeated merging must converge. `also(state)` adds effects from elsewhere before every
/// statement. An unreachable statement follows the one above it.
template <typename State, typename Apply, typename Join>
[[nodiscard]] std::vector<State> states_before(
    const Flow& flow, const State& entry, const Apply& apply, const Join& join,
    const std::type_identity_t<std::function<void(State&)>>& also = {}) {
  return StatesBefore<State, Apply, Join>(flow, apply, join, also).find(entry);
}

/// The possible last motions before each statement, numbered by `moves(step)`. kNoMotion means that
/// there is none, or that the arm was moved by something other than a motion. `moves` is empty for
/// a statement that does not move the arm.
constexpr std::size_t kNoMotion = static_cast<std::size_t>(-1);
[[nodiscard]] std::vector<std::set<std::size_t>> motions_before(
    const Flow& flow, const std::function<std::optional<std::size_t>(std::size_t step)>& moves);

}  // namespace trammel::cam
