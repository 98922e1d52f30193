#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

/// In which order the statements of a program may come, and what holds before each of them. Every
/// dialect says what its statements do; loops, jumps, calls, interrupts and error handlers are
/// followed here, for all of them alike.
namespace trammel::cam {

/// The effect of a statement on the order.
struct Step {
  enum class Kind {
    kPlain,
    kIf,         ///< opens a block that may be passed over
    kSwitch,     ///< opens a block of kCase and kElse
    kCase,       ///< another branch of the block, `ELSEIF` too
    kElse,       ///< the last branch of the block, without a condition
    kWhile,      ///< opens a block that repeats, or is passed over
    kRepeat,     ///< opens a block that repeats and is entered
    kRoutine,    ///< opens a block that calls enter; one that nothing calls is entered by whoever
                 ///< runs the program
    kInterrupt,  ///< opens a block that comes in before any other statement, and goes back there
    kEnd,        ///< of the innermost block
    kExit,       ///< to behind the innermost loop
    kContinue,   ///< to the head of the innermost loop
    kReturn,     ///< from the routine
    kHandler,    ///< ends what stands above it in the routine; comes in where a statement of that
                 ///< fails
    kGoBack,     ///< from a handler to where it came in
    kLabel,      ///< where jumps go
    kJump,       ///< to the labels of that name
    kJumpMaybe,  ///< there, or on
    kCall        ///< of the routine of that name; of one that is not there: nothing
  };
  Kind kind = Kind::kPlain;
  std::string label =
      {};  ///< of a label, jump, routine or call; of an interrupt or handler: as reasons call it
  bool never_fails = false;  ///< no error handler comes in at it
};

/// Statements that come in before others and may go back there: an interrupt routine, an error
/// handler.
struct Aside {
  std::string name;
  std::size_t first = 0, end = 0;  ///< its statements; it is not left beyond `end` on the way back
  std::vector<std::size_t> goes_back;  ///< the steps that lead back
  std::size_t from = 0, to = 0;  ///< it comes in before the steps [from, to) that are not its own
  bool at_failures = false;      ///< not before steps that never fail
};

/// Where a program may go.
struct Flow {
  std::vector<std::vector<std::size_t>>
      next;                          ///< statements that may come behind each; their number: none
  std::vector<std::size_t> entries;  ///< the first statement, and the routines that nothing calls
  std::vector<Aside> asides;
  std::vector<bool> never_fails;  ///< of each statement
};

/// `in_any_order`: routines that nothing calls are entered again and again, behind one another.
[[nodiscard]] Flow flow_of(const std::vector<Step>& steps, bool in_any_order = false);

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

  /// Adds what asides make of a state before a step, until they change it no more.
  void come_in(std::size_t step, State& state) {
    for (bool more = true; more;) {
      more = false;
      for (std::size_t a = 0; a < flow_.asides.size(); ++a) {
        const Aside& aside = flow_.asides[a];
        const bool own = step >= aside.first && step <= aside.end;
        if (own || step < aside.from || step >= aside.to ||
            (aside.at_failures && flow_.never_fails[step]))
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

  /// The state with which an aside leads back that comes in where `state` holds; empty: it does not
  /// go back.
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
  States before_;               ///< with what asides make of it
  States reached_;              ///< as the statements above lead to it
  std::set<std::size_t> open_;  ///< in the order of the text
  std::vector<std::vector<std::pair<State, std::optional<State>>>> made_;  ///< by each aside
};

/// The state before each statement, and at last behind all, where `entry` holds at the entries of
/// the flow. `apply(step, state)` makes what holds behind a statement. `join(state, other, by)`
/// makes of a state one that holds for both, where ways come together; `by` names the aside that
/// one of them leads through, empty: none. What it makes must come to rest. `also(state)` adds what
/// comes in before every statement from elsewhere. A statement that nothing leads to follows the
/// one above it.
template <typename State, typename Apply, typename Join>
[[nodiscard]] std::vector<State> states_before(
    const Flow& flow, const State& entry, const Apply& apply, const Join& join,
    const std::type_identity_t<std::function<void(State&)>>& also = {}) {
  return StatesBefore<State, Apply, Join>(flow, apply, join, also).find(entry);
}

/// The motions that may be the last before each statement, as `moves(step)` numbers them;
/// kNoMotion where none comes before, or what moved the arm is no motion. `moves` is empty for a
/// statement that does not move the arm.
constexpr std::size_t kNoMotion = static_cast<std::size_t>(-1);
[[nodiscard]] std::vector<std::set<std::size_t>> motions_before(
    const Flow& flow, const std::function<std::optional<std::size_t>(std::size_t step)>& moves);

}  // namespace trammel::cam
