#pragma once

#include <cstddef>
#include <optional>
#include <set>
#include <string>
#include <vector>

/// In which order the statements of a program may come, and what holds before each of them. Every dialect says what its
/// statements do; loops, jumps and calls are followed here, for all of them alike.
namespace trammel::cam {

/// What a statement does to the order.
struct Step {
  enum class Kind {
    kPlain,
    kIf,         ///< opens a block that may be passed over
    kSwitch,     ///< opens a block of kCase and kElse
    kCase,       ///< another branch of the block, `ELSEIF` too
    kElse,       ///< the last branch of the block, without a condition
    kWhile,      ///< opens a block that repeats, or is passed over
    kRepeat,     ///< opens a block that repeats and is entered
    kRoutine,    ///< opens a block that calls enter; one that nothing calls is entered by whoever runs the program
    kEnd,        ///< of the innermost block
    kExit,       ///< to behind the innermost loop
    kContinue,   ///< to the head of the innermost loop
    kReturn,     ///< from the routine
    kLabel,      ///< where jumps go
    kJump,       ///< to the labels of that name
    kJumpMaybe,  ///< there, or on
    kCall        ///< of the routine of that name; of one that is not there: nothing
  };
  Kind kind = Kind::kPlain;
  std::string label = {};  ///< of a label, jump, routine or call
};

/// The statements that may come behind each; `steps.size()`: none. `in_any_order`: routines that nothing calls are
/// entered again and again, behind one another.
[[nodiscard]] std::vector<std::vector<std::size_t>> next_of(const std::vector<Step>& steps, bool in_any_order = false);

/// What holds before each statement, and at last behind all, where `entry` holds at the beginning and in front of each
/// routine that nothing calls. `apply(step, state)` makes what holds behind a statement. `join(state, other)` makes of
/// a state one that holds for both; it must come to rest. A statement that nothing leads to follows the one above it.
template <typename State, typename Apply, typename Join>
[[nodiscard]] std::vector<State> states_before(const std::vector<std::vector<std::size_t>>& next,
                                               const std::vector<std::size_t>& entries, const State& entry,
                                               const Apply& apply, const Join& join) {
  std::vector<std::optional<State>> before(next.size() + 1);
  std::set<std::size_t> open;  // in the order of the text
  const auto reach = [&](std::size_t step, const State& state) {
    std::optional<State>& known = before[step];
    State now = known.value_or(state);
    if (known) join(now, state);
    if (known && *known == now) return;
    known = std::move(now);
    open.insert(step);
  };
  const auto settle = [&] {
    while (!open.empty()) {
      const std::size_t step = *open.begin();
      open.erase(open.begin());
      if (step >= next.size()) continue;
      State state = *before[step];
      apply(step, state);
      for (const std::size_t after : next[step]) reach(after, state);
    }
  };
  for (const std::size_t step : entries) reach(step, entry);
  settle();
  for (std::size_t step = 0; step <= next.size(); ++step) {
    if (before[step]) continue;
    State state = entry;
    if (step > 0) {
      state = *before[step - 1];
      apply(step - 1, state);
    }
    reach(step, state);
    settle();
  }
  std::vector<State> all;
  all.reserve(before.size());
  for (std::optional<State>& state : before) all.push_back(std::move(*state));
  return all;
}

/// The first statement, and the routines that nothing calls.
[[nodiscard]] std::vector<std::size_t> entries_of(const std::vector<Step>& steps);

}  // namespace trammel::cam
