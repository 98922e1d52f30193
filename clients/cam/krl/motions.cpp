#include "clients/cam/krl/motions.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <set>
#include <string_view>

#include "clients/cam/flow.h"
#include "clients/cam/keep.h"
#include "server/base/plain_text.h"

namespace trammel::cam::krl {

namespace {

constexpr const char* kHomeElsewhere =
    "it is a home position of the controller, which is not in the files handed over";

/// `XHOME`, `XHOME2`, `$H_POS`, `$AXIS_HOME[1]`: joints that the controller keeps.
bool is_home(const std::string& name) {
  return name.starts_with("XHOME") || name.starts_with("$H_POS") || name.starts_with("$AXIS_HOME[");
}

Span span_of(const std::vector<Value>& operands) {
  return {operands.front().begin, operands.back().end};
}

}  // namespace

void Motions::reach(std::size_t f, std::size_t k, State state) {
  const Tokens& tokens = lines_[f][k].tokens;
  const std::optional<Motion> motion = motion_of(tokens);
  if (!motion) return;
  const std::size_t number = move_at(f, k);
  program_.moves[number].is_arc = motion->is_arc;
  if (is_relative(motion->word))
    return leave_at(f, k, text_of(f, {tokens[1].begin, tokens.back().end}),
                    "it is relative to where the robot is");
  if (const auto head = splines_.find({f, k}); head != splines_.end())
    settings_.apply_with(f, head->second, state);
  settings_.apply_with(f, k, state);
  std::optional<double>& speed = program_.moves[number].speed_mm_s;
  if (state.speed > speed.value_or(0) && !is_by_axes(motion->word)) speed = state.speed;
  state.tool = tools_.tool_carrying(state.tool, state.load);
  for (const std::vector<Value>& operands : motion->targets) {
    if (operands.empty()) return leave_at(f, k, "", "it has no target");
    use(f, k, operands, state);
  }
  if (motion->ends_by_angle) by_angle_.insert({f, lines_[f][k].number});
}

void Motions::finish(bool resumes) {
  for (std::size_t f = 0; f < lines_.size(); ++f) targets_.note_readings(f);
  sites_.finish(program_, [this](const Site& site, ProgramTarget& target) {
    return targets_.describe(site, target);
  });
  find_repeatable();
  find_order(resumes);
  targets_.list_unused();
}

/// Motions that stop at their only target. Status, turns and external axes are the target's own.
void Motions::find_repeatable() {
  static const std::set<std::string_view> kWords = {"LIN", "PTP", "SLIN", "SPTP"};
  for (const auto& [place, number] : moves_) {
    ProgramMove& move = program_.moves[number];
    const auto& [f, k] = place;
    const Tokens& tokens = lines_[f][k].tokens;
    if (move.targets.size() != 1 || !kWords.contains(tokens[0].text) || splines_.contains(place))
      continue;
    std::size_t next = 0;
    const std::vector<Value> operands = operands_at(tokens, 1, &next);
    if (operands.empty() || next < tokens.size()) continue;
    const bool joints = is_joints(program_.targets[move.targets[0]].coordinates);
    const std::size_t at = operands.front().begin;
    std::string begin = from_line_begin(program_.files[f].text, tokens[0].begin, at);
    if (begin.empty()) continue;
    NewText line({}, std::move(begin) + "{");
    for (std::size_t c = 0; c < kPose.size(); ++c) {
      line.text(fmt::format("{}{} ", c == 0 ? "" : ",", joints ? kAxes[c] : kPose[c]));
      line.number(c, kDecimals);
    }
    line.text(Targets::rest_of(targets_.last_of(operands, f)) + "}");
    move.another = {std::move(line).line(at)};
  }
}

void Motions::leave_at(std::size_t f, std::size_t k, const std::string& name,
                       const std::string& why) {
  const Line& line = lines_[f][k];
  const std::size_t move = move_at(f, k);
  program_.moves[move].left_some = true;
  if (left_.emplace(f, line.number, name).second)
    leave(program_, {name, f, line.number, std::string(line.word()), why}, move);
}

std::size_t Motions::move_at(std::size_t f, std::size_t k) {
  const auto [entry, is_new] = moves_.emplace(Place(f, k), program_.moves.size());
  if (is_new) program_.moves.push_back({f, lines_[f][k].number, {}, false});
  return entry->second;
}

std::string Motions::text_of(std::size_t f, const Span& span) const {
  if (span.end <= span.begin) return "";
  return program_.files[f].text.substr(span.begin, span.end - span.begin);
}

void Motions::use(std::size_t f, std::size_t k, const std::vector<Value>& operands,
                  const State& state) {
  const Line& line = lines_[f][k];
  const std::size_t move = move_at(f, k);
  const std::string name = text_of(f, span_of(operands));
  for (const std::string* why : {&state.fixed_tool, &state.sensed, &state.soft}) {
    if (!why->empty()) return leave_at(f, k, name, *why);
  }
  const SiteUse use{state.tool,  state.frame, std::string(line.word()), f,
                    line.number, move,        !is_by_axes(line.word())};
  if (operands.size() > 1 || operands[0].kind == Value::Kind::kAggregate) {
    targets_.add({f, k, operands});
    note_axes(operands[0], move);
    return sites_.add(f, operands[0].begin, name, use);
  }
  if (operands[0].kind != Value::Kind::kName)
    return leave_at(f, k, name, "an expression decides it");
  const std::string wanted = home_at(f, k, operands[0].name);
  if (wanted.starts_with("$") && !names_.is_set(wanted, f))
    return leave_at(f, k, name,
                    is_home(wanted) ? std::string(kHomeElsewhere)
                                    : fmt::format("{} decides it", shown(wanted)));
  if (is_home(wanted) && !names_.is_set(wanted, f)) return leave_at(f, k, name, kHomeElsewhere);
  if (wanted.find("[*]") != std::string::npos) return use_any(f, k, wanted, name, use);
  const Told<const Assigned*> one = names_.value_of(wanted, f);
  if (one && (*one)->operands.size() == 1) note_axes((*one)->operands[0], move);
  use_named(f, k, wanted, name, use);
}

/// The variable that a motion names: the line of an inline form, `PTP HOME Vel=100 % DEFAULT`, says
/// HOME for XHOME. `$H_POS=XHOME` makes the home of the controller that one.
std::string Motions::home_at(std::size_t f, std::size_t k, const std::string& name) const {
  const Tokens& tokens = lines_[f][k].tokens;
  if (name.starts_with("HOME") && tokens[2].is("VEL") && tokens[3].is("=")) return "X" + name;
  if (name != "$H_POS") return name;
  const Told<const Assigned*> set = names_.value_of(name, f);
  const bool by_name =
      set && (*set)->operands.size() == 1 && (*set)->operands[0].kind == Value::Kind::kName;
  return by_name ? (*set)->operands[0].name : name;
}

/// `PTP XP[i]`: any of its elements.
void Motions::use_any(std::size_t f, std::size_t k, const std::string& wanted,
                      const std::string& name, const SiteUse& use) {
  const std::string beginning = wanted.substr(0, wanted.find("[*]") + 1);
  bool any = false;
  for (const auto& [key, variable] : names_.all()) {
    if (!key.second.starts_with(beginning) || key.second == wanted) continue;
    any = true;
    const Assigned* at = variable.values.empty() ? nullptr : &variable.values[0];
    use_named(f, k, key.second,
              at == nullptr ? key.second : names_.spelled(key.second, at->file, at->line), use);
  }
  if (!any) leave_at(f, k, name, "an index chooses it, and its elements are not in the files");
}

void Motions::use_named(std::size_t f, std::size_t k, const std::string& wanted,
                        const std::string& name, const SiteUse& use) {
  const Told<const Assigned*> assigned = names_.value_of(wanted, f);
  if (!assigned) return leave_at(f, k, name, assigned.error());
  const Assigned& at = **assigned;
  if (at.operands.empty()) return leave_at(f, k, name, "it is not constant");
  targets_.add(at);
  sites_.add(at.file, at.operands[0].begin, name, use);
}

void Motions::note_axes(const Value& value, std::size_t move) {
  if (const Told<std::vector<double>> axes = Variables::numbers_of(value, kAxes))
    axes_[move] = *axes;
}

/// Lines, arcs, and motions to positions without a status keep the posture of the motion before.
void Motions::find_order(bool resumes) {
  std::vector<Step> steps;
  std::map<std::size_t, Place> moves;  // by step
  for (std::size_t r = 0; r < routines_.all().size(); ++r) {
    const Routine& routine = routines_[r];
    steps.push_back({Step::Kind::kRoutine, std::to_string(r)});
    for (std::size_t k = routine.first; k < routine.last; ++k) {
      const Line& line = lines_[routine.file][k];
      for (const std::size_t called : routines_.called_by(line.tokens))
        steps.push_back({Step::Kind::kCall, std::to_string(called)});
      const auto move = moves_.find({routine.file, k});
      // A motion that is left alone leaves the posture as it was.
      if (move != moves_.end() &&
          (is_by_axes(line.word()) || !program_.moves[move->second].targets.empty()))
        moves.emplace(steps.size(), Place(routine.file, k));
      steps.push_back(step_of(line.tokens));
    }
    steps.push_back({Step::Kind::kEnd});
  }
  const auto before =
      motions_before(flow_of(steps), [&](std::size_t step) -> std::optional<std::size_t> {
        const auto move = moves.find(step);
        return move == moves.end() ? std::nullopt
                                   : std::optional<std::size_t>(moves_.at(move->second));
      });
  for (const auto& [step, place] : moves) {
    if (!resumes) follow(place, before[step]);
  }
  for (const auto& [move, axes] : axes_) program_.moves[move].axes = axes;
}

/// At the start of the program, and where an interrupt ends the interrupted routine, unspecified
/// values of a target are taken nearest to zero.
void Motions::follow(const Place& place, const std::set<std::size_t>& before) {
  ProgramMove& move = program_.moves[moves_.at(place)];
  const bool by_axes = is_by_axes(lines_[place.first][place.second].word());
  const bool says = std::any_of(move.targets.begin(), move.targets.end(), [&](std::size_t t) {
    return program_.targets[t].configuration.said();
  });
  if (before.contains(kNoMotion) || (by_axes && (says || move.targets.empty()))) return;
  move.choice = JointChoice::kOnALine;
  move.before = before;
}

/// For `CIRC XP1,XP2,CA 360` the circle through the points is corrected, so the arc ends elsewhere
/// on it.
void Motions::note_angles() {
  if (by_angle_.empty()) return;
  const auto& [f, line] = *by_angle_.begin();
  const std::string more =
      by_angle_.size() > 1 ? fmt::format(" and {} more", by_angle_.size() - 1) : "";
  program_.notes.push_back(
      fmt::format("an arc ends by its angle CA and not at its end point ({} line {}{}): the circle "
                  "through its points is corrected, and what lies beyond them follows it",
                  program_.files[f].name, line, more));
}

}  // namespace trammel::cam::krl
