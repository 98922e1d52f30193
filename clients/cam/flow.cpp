#include "clients/cam/flow.h"

#include <algorithm>
#include <map>

namespace trammel::cam {

namespace {

using Kind = Step::Kind;

/// A block with the places that its parts begin at.
struct Block {
  std::size_t head = 0, end = 0;
  std::vector<std::size_t> branches;  ///< steps kCase and kElse
  bool has_else = false;
};

bool opens(Kind kind) {
  return kind == Kind::kIf || kind == Kind::kSwitch || kind == Kind::kWhile || kind == Kind::kRepeat ||
         kind == Kind::kRoutine;
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

  std::vector<std::vector<std::size_t>> next() {
    for (std::size_t s = 0; s < steps_.size(); ++s) follow(s);
    return std::move(next_);
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

  /// The innermost block around a step that `wanted` is true of.
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
        return enter(s);
      case Kind::kCase:
      case Kind::kElse:
        return add(s, in_[s] == kNone ? s + 1 : blocks_[in_[s]].end);
      case Kind::kEnd:
        return leave(s);
      case Kind::kExit:
        return add(s, loop() == kNone ? s + 1 : behind(loop()));
      case Kind::kContinue:
        return add(s, loop() == kNone ? s + 1 : blocks_[loop()].head);
      case Kind::kReturn: {
        const std::size_t routine = around(s, [](Kind kind) { return kind == Kind::kRoutine; });
        return add(s, routine == kNone ? steps_.size() : blocks_[routine].end);
      }
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
    if (kind != Kind::kSwitch && (kind != Kind::kRoutine || !called_.contains(steps_[s].label))) add(s, s + 1);
    for (const std::size_t branch : block.branches) {
      if (kind == Kind::kIf || kind == Kind::kSwitch) add(s, branch + 1);
    }
    if (kind == Kind::kWhile || kind == Kind::kRoutine || !block.has_else) add(s, block.end + 1);
  }

  void leave(std::size_t s) {
    const std::size_t block = in_[s];
    if (block == kNone || blocks_[block].end != s) return add(s, s + 1);
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
    const auto is_routine = [](Kind kind) { return kind == Kind::kRoutine; };
    for (const std::size_t label : labels->second) {
      // A label is known in its routine alone.
      if (around(label, is_routine) == around(s, is_routine)) add(s, label);
    }
  }

  void call(std::size_t s) {
    const auto routine = routines_.find(steps_[s].label);
    add(s, routine == routines_.end() ? s + 1 : blocks_[routine->second].head + 1);
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

std::vector<std::vector<std::size_t>> next_of(const std::vector<Step>& steps, bool in_any_order) {
  return Order(steps, in_any_order).next();
}

std::vector<std::size_t> entries_of(const std::vector<Step>& steps) {
  const std::set<std::string> called = called_in(steps);
  std::vector<std::size_t> entries = {0};
  for (std::size_t s = 0; s < steps.size(); ++s) {
    if (steps[s].kind == Step::Kind::kRoutine && !called.contains(steps[s].label)) entries.push_back(s + 1);
  }
  return entries;
}

}  // namespace trammel::cam
