#include "clients/cam/flow.h"

#include <algorithm>
#include <map>

namespace trammel::cam {

namespace {

using Kind = Step::Kind;

/// A block with the first step of each part.
struct Block {
  std::size_t head = 0, end = 0;
  std::vector<std::size_t> branches;  ///< steps kCase and kElse
  bool has_else = false;
};

bool is_routine(Kind kind) { return kind == Kind::kRoutine || kind == Kind::kInterrupt; }
bool opens(Kind kind) {
  return kind == Kind::kIf || kind == Kind::kSwitch || kind == Kind::kWhile ||
         kind == Kind::kRepeat || is_routine(kind);
}
bool is_loop(Kind kind) { return kind == Kind::kWhile || kind == Kind::kRepeat; }

std::set<std::string> called_in(const std::vector<Step>& steps) {
  std::set<std::string> called;
  for (const Step& step : steps) {
    if (step.kind == Kind::kCall) called.insert(step.label);
  }
  return called;
}

class Order {
 public:
  Order(const std::vector<Step>& steps, bool in_any_order)
      : steps_(steps),
        in_any_order_(in_any_order),
        called_(called_in(steps)),
        in_(steps.size(), kNone),
        next_(steps.size()) {
    find_blocks();
  }

  Flow flow() {
    for (std::size_t s = 0; s < steps_.size(); ++s) follow(s);
    Flow made;
    made.asides = asides();
    if (std::any_of(made.asides.begin(), made.asides.end(), [](const Aside& aside) {
          return aside.at_failures && !aside.goes_back.empty();
        }))
      end_where_they_fail(made.asides);
    made.next = std::move(next_);
    made.entries = {0};
    for (std::size_t s = 0; s < steps_.size(); ++s) {
      if (steps_[s].kind == Kind::kRoutine && !called_.contains(steps_[s].label))
        made.entries.push_back(s + 1);
      made.never_fails.push_back(steps_[s].never_fails);
    }
    return made;
  }

 private:
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);

  void find_blocks() {
    std::vector<std::size_t> open;
    for (std::size_t s = 0; s < steps_.size(); ++s) {
      const Kind kind = steps_[s].kind;
      in_[s] = open.empty() ? kNone : open.back();
      if (kind == Kind::kLabel) labels_[steps_[s].label].push_back(s);
      if (opens(kind)) {
        outer_.push_back(in_[s]);
        blocks_.push_back({s, steps_.size(), {}, false});
        open.push_back(blocks_.size() - 1);
        opened_[s] = open.back();
        if (kind == Kind::kRoutine) routines_.emplace(steps_[s].label, open.back());
      } else if ((kind == Kind::kCase || kind == Kind::kElse) && !open.empty()) {
        blocks_[open.back()].branches.push_back(s);
        blocks_[open.back()].has_else |= kind == Kind::kElse;
      } else if (kind == Kind::kEnd && !open.empty()) {
        blocks_[open.back()].end = s;
        open.pop_back();
      }
    }
  }

  void add(std::size_t from, std::size_t to) { next_[from].push_back(std::min(to, steps_.size())); }
  [[nodiscard]] Kind kind_of(std::size_t block) const { return steps_[blocks_[block].head].kind; }
  [[nodiscard]] std::size_t behind(std::size_t block) const { return blocks_[block].end + 1; }

  /// The innermost block around a step for which `wanted` is true.
  template <typename Wanted>
  [[nodiscard]] std::size_t around(std::size_t step, const Wanted& wanted) const {
    std::size_t block = in_[step];
    while (block != kNone && !wanted(kind_of(block))) block = outer_[block];
    return block;
  }

  void follow(std::size_t s) {
    const Step& step = steps_[s];
    const auto loop = [&] { return around(s, is_loop); };
    switch (step.kind) {
      case Kind::kPlain:
      case Kind::kLabel:
      case Kind::kRepeat:
        return add(s, s + 1);
      case Kind::kIf:
      case Kind::kSwitch:
      case Kind::kWhile:
      case Kind::kRoutine:
      case Kind::kInterrupt:
        return enter(s);
      case Kind::kCase:
      case Kind::kElse:
        // The first case is reached only from the head of its block.
        if (in_[s] != kNone && kind_of(in_[s]) == Kind::kSwitch &&
            blocks_[in_[s]].branches.front() == s)
          return add(s, s + 1);
        return add(s, in_[s] == kNone ? s + 1 : blocks_[in_[s]].end);
      case Kind::kEnd:
        return leave(s);
      case Kind::kExit:
        return add(s, loop() == kNone ? s + 1 : behind(loop()));
      case Kind::kContinue:
        return add(s, loop() == kNone ? s + 1 : blocks_[loop()].head);
      case Kind::kReturn:
      case Kind::kHandler: {
        const std::size_t routine = around(s, is_routine);
        return add(s, routine == kNone ? steps_.size() : blocks_[routine].end);
      }
      case Kind::kGoBack:
        return;
      case Kind::kJumpMaybe:
        add(s, s + 1);
        return jump(s);
      case Kind::kJump:
        return jump(s);
      case Kind::kCall:
        return call(s);
    }
  }

  void enter(std::size_t s) {
    const Block& block = blocks_[opened_.at(s)];
    const Kind kind = steps_[s].kind;
    if (kind == Kind::kInterrupt) return add(s, block.end + 1);
    if (kind != Kind::kSwitch && (kind != Kind::kRoutine || !called_.contains(steps_[s].label)))
      add(s, s + 1);
    for (const std::size_t branch : block.branches) {
      if (kind == Kind::kIf || kind == Kind::kSwitch) add(s, branch + 1);
    }
    if (kind == Kind::kWhile || kind == Kind::kRoutine || !block.has_else) add(s, block.end + 1);
  }

  void leave(std::size_t s) {
    const std::size_t block = in_[s];
    if (block == kNone || blocks_[block].end != s) return add(s, s + 1);
    if (kind_of(block) == Kind::kInterrupt) return;
    if (is_loop(kind_of(block))) add(s, blocks_[block].head);
    if (kind_of(block) != Kind::kRoutine) return add(s, s + 1);
    const std::string& name = steps_[blocks_[block].head].label;
    for (std::size_t k = 0; k < steps_.size() && called_.contains(name); ++k) {
      if (steps_[k].kind == Kind::kCall && steps_[k].label == name) add(s, k + 1);
    }
    if (called_.contains(name)) return;
    add(s, steps_.size());
    for (const auto& [other, again] : routines_) {
      if (in_any_order_ && !called_.contains(other)) add(s, blocks_[again].head + 1);
    }
  }

  void jump(std::size_t s) {
    const auto labels = labels_.find(steps_[s].label);
    if (labels == labels_.end()) return add(s, steps_.size());
    for (const std::size_t label : labels->second) {
      // A label is known in its routine alone.
      if (around(label, is_routine) == around(s, is_routine)) add(s, label);
    }
  }

  void call(std::size_t s) {
    const auto routine = routines_.find(steps_[s].label);
    add(s, routine == routines_.end() ? s + 1 : blocks_[routine->second].head + 1);
  }

  // Asides that come in between.

  [[nodiscard]] std::vector<Aside> asides() const {
    std::vector<Aside> all;
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
      const Block& block = blocks_[b];
      if (kind_of(b) == Kind::kInterrupt)
        all.push_back({steps_[block.head].label,
                       block.head + 1,
                       block.end,
                       {block.end},
                       0,
                       steps_.size(),
                       false});
      if (is_routine(kind_of(b))) add_handlers(block, all);
    }
    return all;
  }

  /// `ERROR`, `UNDO`: each up to the next, or to the end of its routine.
  void add_handlers(const Block& routine, std::vector<Aside>& all) const {
    std::vector<std::size_t> begins;
    for (std::size_t s = routine.head + 1; s < routine.end; ++s) {
      if (steps_[s].kind == Kind::kHandler) begins.push_back(s);
    }
    for (std::size_t k = 0; k < begins.size(); ++k) {
      const std::size_t end = k + 1 < begins.size() ? begins[k + 1] : routine.end;
      Aside aside{steps_[begins[k]].label, begins[k] + 1, end, {},
                  routine.head + 1,        begins[0],     true};
      for (std::size_t s = aside.first; s < end; ++s) {
        if (steps_[s].kind == Kind::kGoBack) aside.goes_back.push_back(s);
      }
      all.push_back(std::move(aside));
    }
  }

  /// A routine without a handler of its own ends at the failing statement, if a handler of one of
  /// its callers goes on from there.
  void end_where_they_fail(const std::vector<Aside>& asides) {
    std::vector<bool> handles(blocks_.size(), false), ends(blocks_.size(), false);
    std::vector<std::size_t> open;
    const auto note_calls = [&](std::size_t from, std::size_t to) {
      for (std::size_t s = from; s < to; ++s) {
        const auto called =
            steps_[s].kind == Kind::kCall ? routines_.find(steps_[s].label) : routines_.end();
        if (called == routines_.end() || handles[called->second] || ends[called->second]) continue;
        ends[called->second] = true;
        open.push_back(called->second);
      }
    };
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
      for (const Aside& aside : asides)
        handles[b] = handles[b] || (aside.at_failures && aside.from == blocks_[b].head + 1);
    }
    for (const Aside& aside : asides) {
      if (aside.at_failures && !aside.goes_back.empty()) note_calls(aside.from, aside.to);
    }
    while (!open.empty()) {
      const Block block = blocks_[open.back()];
      open.pop_back();
      for (std::size_t s = block.head + 1; s < block.end; ++s) add(s, block.end);
      note_calls(block.head + 1, block.end);
    }
  }

  const std::vector<Step>& steps_;
  bool in_any_order_;
  std::set<std::string> called_;
  std::vector<Block> blocks_;
  std::vector<std::size_t> outer_;             // of each block
  std::vector<std::size_t> in_;                // the innermost block of each step
  std::map<std::size_t, std::size_t> opened_;  // blocks by their head
  std::map<std::string, std::size_t> routines_;
  std::map<std::string, std::vector<std::size_t>> labels_;
  std::vector<std::vector<std::size_t>> next_;
};

}  // namespace

Flow flow_of(const std::vector<Step>& steps, bool in_any_order) {
  return Order(steps, in_any_order).flow();
}

std::vector<bool> behind(const Flow& flow, const std::vector<std::size_t>& steps) {
  std::vector<bool> found(flow.next.size(), false);
  std::vector<std::size_t> open = steps;
  while (!open.empty()) {
    const std::size_t step = open.back();
    open.pop_back();
    if (step >= flow.next.size()) continue;  // the end of a program, or an empty one
    for (const std::size_t after : flow.next[step]) {
      if (after >= found.size() || found[after]) continue;
      found[after] = true;
      open.push_back(after);
    }
  }
  return found;
}

std::vector<std::set<std::size_t>> motions_before(
    const Flow& flow, const std::function<std::optional<std::size_t>(std::size_t step)>& moves) {
  using Last = std::set<std::size_t>;
  return states_before(
      flow, Last{kNoMotion},
      [&](std::size_t step, Last& last) {
        if (const auto motion = moves(step)) last = {*motion};
      },
      [](Last& last, const Last& other, const std::string&) {
        last.insert(other.begin(), other.end());
      });
}

}  // namespace trammel::cam
