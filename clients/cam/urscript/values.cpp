#include "clients/cam/urscript/values.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "server/base/plain_text.h"

namespace trammel::cam::urscript {

namespace {

constexpr int kDeepest = 20;

}  // namespace

bool is_function_of_poses(const std::string& name) {
  return name == "pose_trans" || name == "pose_inv" || name == "pose_add" ||
         name == "interpolate_pose";
}

bool defines(const Token& token) {
  return token.is("def") || token.is("thread") || token.is("sec");
}

bool opens(const Token& token) { return defines(token) || token.is("if") || token.is("while"); }

std::vector<double> numbers_in(const Value& value) {
  std::vector<double> numbers;
  for (const Token& token : value.numbers) numbers.push_back(value_in(token));
  return numbers;
}

Values::Values(const Tokens& tokens, std::string file) : tokens_(tokens), file_(std::move(file)) {
  for (std::size_t at = 0; at < tokens_.size(); ++at) {
    note_block(at);
    note_assignment(at);
  }
  for (std::size_t at = 0; at < tokens_.size(); ++at) note_parameters(at);
  for (auto& [name, variable] : variables_) find_order(variable);
}

/// The blocks that are open at a token, one after the other.
void Values::note_block(std::size_t at) {
  if (!tokens_[at].is_word()) return;
  if (opens(tokens_[at])) open_.push_back(at);
  if (tokens_[at].is("end") && !open_.empty()) open_.pop_back();
}

/// The token of the open `def` or `thread`; a number beyond all tokens if none is open.
std::size_t Values::function_here() const {
  const auto own = std::find_if(open_.rbegin(), open_.rend(),
                                [&](std::size_t block) { return defines(tokens_[block]); });
  return own == open_.rend() ? tokens_.size() : *own;
}

/// `global p1 = p[...]`; a partial assignment is decided at run time.
void Values::note_assignment(std::size_t at) {
  if (!tokens_[at].is_word()) return;
  const bool first = at == 0 || tokens_[at - 1].line != tokens_[at].line ||
                     tokens_[at - 1].is("global") || tokens_[at - 1].is("local");
  if (!first) return;
  const std::string name(tokens_[at].text);
  std::size_t equals = at + 1;
  if (tokens_[equals].is("[")) {
    while (equals < tokens_.size() && !tokens_[equals].is("=") &&
           tokens_[equals].line == tokens_[at].line)
      ++equals;
  }
  if (equals + 1 >= tokens_.size() || !tokens_[equals].is("=") || tokens_[equals + 1].is("="))
    return;
  Variable& variable = variables_[name];
  const bool again = variable.value.end > 0, in_part = equals != at + 1;
  const std::string why =
      fmt::format("{} is set at run time ({} line {})", shown(name), file_, tokens_[at].line);
  std::size_t next = equals + 1;
  const Value value = value_at(next);
  if (in_part) variable.changed = why;
  if (again) variable.set_again = why;
  variable.value = value;
  if (!ends_here(next, value.line)) variable.value.kind = Value::Kind::kOther;
  variable.is_global |= tokens_[at - 1].is("global");
  variable.is_local |= tokens_[at - 1].is("local");
  variable.functions.insert(function_here());
  assignments_.emplace(next, Assignment{name, variable.in_order.size()});
  variable.in_order.push_back(variable.value);
}

/// `def drill(hole, depth=0.01):` hides variables of the same names elsewhere.
void Values::note_parameters(std::size_t at) {
  if (!tokens_[at].is("def") || !tokens_[at + 2].is("(")) return;
  for (std::size_t next = at + 3; next < tokens_.size() && !tokens_[next].is(")"); ++next) {
    const bool begins = tokens_[next - 1].is("(") || tokens_[next - 1].is(",");
    if (!begins || !tokens_[next].is_word()) continue;
    variables_[std::string(tokens_[next].text)].changed =
        fmt::format("{} is a parameter of {} ({} line {})", shown(std::string(tokens_[next].text)),
                    shown(std::string(tokens_[at + 1].text)), file_, tokens_[at].line);
  }
}

/// A variable that only gets constants has each of them until its next assignment. This needs all
/// its assignments to mean one variable: none is local, and they are in one function or the
/// variable is global.
void Values::find_order(Variable& variable) {
  if (variable.in_order.size() < 2) return variable.in_order.clear();
  const bool is_one = !variable.is_local && (variable.is_global || variable.functions.size() < 2);
  const bool constant =
      std::all_of(variable.in_order.begin(), variable.in_order.end(), [](const Value& value) {
        return value.kind == Value::Kind::kPose || value.kind == Value::Kind::kJoints;
      });
  if (variable.changed.empty() && is_one && constant) return;
  if (variable.changed.empty()) variable.changed = variable.set_again;
  variable.in_order.clear();
}

Value Values::value_at(std::size_t& at, int depth) const {
  Value value;
  if (at >= tokens_.size() || depth > kDeepest) return value;
  value.begin = tokens_[at].begin;
  value.line = tokens_[at].line;
  const bool pose = tokens_[at].is("p") && tokens_[at + 1].is("[");
  if (pose || tokens_[at].is("[")) {
    at += pose ? 2 : 1;
    value.kind = pose ? Value::Kind::kPose : Value::Kind::kJoints;
    read_list(at, value);
  } else if (tokens_[at].is_word()) {
    value.kind = Value::Kind::kName;
    value.name = std::string(tokens_[at++].text);
    if (tokens_[at].is("(")) read_call(++at, value, depth);
  } else {
    if (tokens_[at].is_number()) {
      value.kind = Value::Kind::kNumber;
      value.numbers.push_back(tokens_[at]);
    }
    ++at;
  }
  value.end = tokens_[at - 1].end;
  return value;
}

/// `1, 2, 3, 4, 5, 6]`
void Values::read_list(std::size_t& at, Value& value) const {
  bool is_number_due = true;
  for (; at < tokens_.size() && !tokens_[at].is("]"); ++at) {
    const bool is_number = tokens_[at].is_number();
    if (is_number != is_number_due || (!is_number && !tokens_[at].is(",")))
      value.kind = Value::Kind::kOther;
    if (is_number) value.numbers.push_back(tokens_[at]);
    is_number_due = !is_number_due;
  }
  if (value.numbers.size() != 6) value.kind = Value::Kind::kOther;
  if (at < tokens_.size()) ++at;
}

/// `p1, qnear=q1)`
void Values::read_call(std::size_t& at, Value& value, int depth) const {
  value.kind = Value::Kind::kCall;
  while (at < tokens_.size() && !tokens_[at].is(")")) {
    if (tokens_[at].is(",")) {
      ++at;
      continue;
    }
    const std::size_t before = at;
    const bool labelled = tokens_[at].is_word() && tokens_[at + 1].is("=") &&
                          at + 2 < tokens_.size() && !tokens_[at + 2].is("=");
    if (labelled) at += 2;
    value.arguments.push_back(value_at(at, depth + 1));
    if (labelled) value.arguments.back().label = std::string(tokens_[before].text);
    if (at == before) ++at;
  }
  if (at < tokens_.size()) ++at;
}

bool Values::ends_here(std::size_t at, int line) const {
  return at >= tokens_.size() || tokens_[at].line != line || tokens_[at].is(",") ||
         tokens_[at].is(")");
}

Told<Value> Values::resolved(const Value& value, bool stored) const {
  Value now = value;
  for (int depth = 0; now.kind == Value::Kind::kName && depth < kDeepest; ++depth) {
    const auto variable = variables_.find(now.name);
    if (variable == variables_.end())
      return because(fmt::format("{} is not in the script", shown(now.name)));
    if (!variable->second.changed.empty()) return because(variable->second.changed);
    if (variable->second.in_order.empty()) {
      now = variable->second.value;
      continue;
    }
    const auto set = now_ == nullptr ? Settings::const_iterator() : now_->find(now.name);
    const bool decided = now_ != nullptr && set != now_->end() && set->second != kUndecided;
    if (!decided || stored || depth > 0) return because(variable->second.set_again);
    now = variable->second.in_order[set->second];
  }
  return now;
}

Told<Pose> Values::pose_of_value(const Value& value, int depth, bool stored) const {
  const Told<Value> now = resolved(value, stored);
  const bool inner = stored || value.kind == Value::Kind::kName;
  if (!now) return because(now.error());
  if (now->kind == Value::Kind::kPose)
    return pose_of(Coordinates::kRotationVector, numbers_in(*now));
  if (now->kind != Value::Kind::kCall) return because("it is not constant");
  if (now->name == "interpolate_pose") return between(*now, depth, inner);
  const std::size_t due = now->name == "pose_inv" ? 1 : 2;
  if (!is_function_of_poses(now->name) || now->arguments.size() != due || depth > kDeepest)
    return because(fmt::format("the function {} decides it", shown(now->name)));
  const Told<Pose> left = pose_of_value(now->arguments[0], depth + 1, inner);
  if (!left) return left;
  if (due == 1) return left->inverse();
  const Told<Pose> right = pose_of_value(now->arguments[1], depth + 1, inner);
  if (!right) return right;
  if (now->name == "pose_trans") return *left * *right;
  return make_pose(left->linear() * right->linear(), left->translation() + right->translation());
}

/// `interpolate_pose(p_from, p_to, 0.5)`: a share of the straight way, and of the one turn that
/// leads from the first rotation to the second. Half a turn may go either way and is refused.
Told<Pose> Values::between(const Value& call, int depth, bool stored) const {
  constexpr double kLargestTurn = 3.14;  // rad
  const std::vector<Value>& given = call.arguments;
  const bool named = std::any_of(given.begin(), given.end(),
                                 [](const Value& value) { return !value.label.empty(); });
  if (given.size() != 3 || named || depth > kDeepest)
    return because(fmt::format("the function {} decides it", shown(call.name)));
  const Told<Pose> from = pose_of_value(given[0], depth + 1, stored);
  if (!from) return from;
  const Told<Pose> to = pose_of_value(given[1], depth + 1, stored);
  if (!to) return to;
  const Told<Value> number = resolved(given[2], stored);
  if (!number) return because(number.error());
  if (number->kind != Value::Kind::kNumber)
    return because(fmt::format("the share that {} takes is not constant", shown(call.name)));
  const double share = value_in(number->numbers[0]);
  const Eigen::AngleAxisd turn(Matrix3(from->linear().transpose() * to->linear()));
  if (turn.angle() > kLargestTurn)
    return because(
        fmt::format("{} turns by half a turn, which may go either way", shown(call.name)));
  const Matrix3 part = Eigen::AngleAxisd(share * turn.angle(), turn.axis()).toRotationMatrix();
  return make_pose(from->linear() * part,
                   from->translation() + share * (to->translation() - from->translation()));
}

}  // namespace trammel::cam::urscript
