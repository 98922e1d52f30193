#include "clients/cam/urscript/urscript.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <set>

#include "clients/cam/flow.h"
#include "clients/cam/keep.h"
#include "clients/cam/nominal_targets.h"
#include "clients/cam/sites.h"
#include "clients/cam/urscript/steps.h"
#include "clients/cam/urscript/tools.h"
#include "clients/cam/urscript/values.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"

namespace trammel::cam {

namespace {

using urscript::is_function_of_poses;
using urscript::is_motion;
using urscript::is_of_axes;
using urscript::kUndecided;
using urscript::numbers_in;
using urscript::Settings;
using urscript::Statement;
using urscript::Told;
using urscript::Value;

constexpr Lexis kLexis = {"#", "\"'"};
constexpr int kScriptDecimals = 6;  // for a place that the script did not write

/// A pair of functions between which the tool is moved away from its programmed motions.
struct Superposed {
  std::set<std::string_view> begins, ends;
  const char* why;
};
constexpr std::size_t kSuperposed = 4;
const std::array<Superposed, kSuperposed>& superposed() {
  static const std::array<Superposed, kSuperposed> kAll = {
      {{{"track_conveyor_linear", "track_conveyor_circular"},
        {"stop_conveyor_tracking"},
        "it is seen from a conveyor that moves"},
       {{"path_offset_enable"}, {"path_offset_disable"}, "an offset is added to the path"},
       {{"force_mode"}, {"end_force_mode"}, "a force decides where the tool goes"},
       {{"freedrive_mode", "teach_mode"},
        {"end_freedrive_mode", "end_teach_mode"},
        "the arm gives way to whoever leads it"}}};
  return kAll;
}

/// The settings when a motion comes.
struct State {
  std::size_t tool = 0, load = 0;             ///< load 0: not said
  std::array<int, kSuperposed> superposed{};  ///< the line that begins each; 0: it does not hold
  Settings settings = {};
  bool operator==(const State&) const = default;
};

class Script {
 public:
  Script(std::size_t index, Program& program, Sites& sites, const ReadOptions& options)
      : index_(index),
        program_(program),
        sites_(sites),
        options_(options),
        text_(program.files[index].text),
        tokens_(tokens_of(text_, kLexis)),
        tools_(program, options) {}

  void read() {
    program_.mark_places.push_back({first_byte(text_), "# "});
    const std::size_t tool = tools_.not_set();
    if (auto cut = urscript::cut_in(tokens_, index_)) program_.cuts.push_back(std::move(*cut));
    statements_ = urscript::statements_of(tokens_, values_of_);
    std::vector<Step> steps;
    for (const Statement& statement : statements_) steps.push_back(statement.step);
    Flow flow = flow_of(steps);
    flow.entries = {0};
    begin_threads(flow);
    const std::vector<State> states = states_before(
        flow, State{tool, 0, {}, {}}, [&](std::size_t s, State& state) { set(s, state); },
        [&](State& state, const State& other, const std::string& by) { join(state, other, by); });
    for (std::size_t s = 0; s < statements_.size(); ++s) {
      if (statements_[s].sets == nullptr) reach(s, states[s]);
    }
    values_of_.assume(nullptr);
    note_order(flow);
    for (std::size_t at = 0; at < tokens_.size(); ++at) note_reading(at);
  }

  std::string describe(const Site& site, ProgramTarget& target) const {
    const Value& value = values_.at(site.begin);
    target.line = value.line;
    if (const auto read = read_.find(site.begin); read != read_.end()) return read->second;
    if (value.kind == Value::Kind::kJoints) {
      if (options_.keep_joints) return "joint targets are kept (--keep-joints)";
      target.coordinates = Coordinates::kJointRadians;
      return keep(value.numbers, 6, target);
    }
    target.coordinates = Coordinates::kRotationVector;
    if (value.kind == Value::Kind::kPose) return keep(value.numbers, 6, target);
    const Told<Pose>& pose = poses_.at(site.begin);
    if (!pose) return pose.error();
    target.numbers = numbers_of(Coordinates::kRotationVector, *pose, std::vector<double>(6, 0.0));
    fold(value, target);
    return "";
  }

 private:
  /// A thread comes in behind the `run` that starts it. One that a thread starts, that nothing
  /// starts, or that is started where the script does not come, may come in anywhere.
  void begin_threads(Flow& flow) const {
    const std::vector<bool> script = behind(flow, flow.entries);
    std::vector<std::size_t> firsts;
    for (const Aside& aside : flow.asides) firsts.push_back(aside.first);
    const std::vector<bool> in_threads = behind(flow, firsts);
    for (Aside& aside : flow.asides) {
      const std::string_view name = tokens_[statements_[aside.first - 1].at + 1].text;
      std::vector<std::size_t> runs;
      bool certain = true;
      for (std::size_t s = 0; s < statements_.size(); ++s) {
        const std::size_t at = statements_[s].at;
        const bool starts = statements_[s].sets == nullptr && at > 0 && tokens_[at].is(name) &&
                            tokens_[at - 1].is("run");
        if (!starts) continue;
        runs.push_back(s);
        const bool first = std::find(firsts.begin(), firsts.end(), s) != firsts.end();
        certain = certain && script[s] && !in_threads[s] && !first;
      }
      if (certain && !runs.empty()) aside.begun = behind(flow, runs);
    }
  }

  void reach(std::size_t s, const State& state) {
    const std::size_t at = statements_[s].at;
    const Token word = tokens_[at];
    if (word.is("set_gravity")) note_gravity(at);
    if (is_motion(word)) {
      tool_ = tools_.carrying(state.tool, state.load);
      superposed_ = state.superposed;
      values_of_.assume(&state.settings);
      move_of_.emplace(s, program_.moves.size());
      motion(at);
    }
    if (word.is("servoj") || word.is("servoc") || word.is("speedl"))
      leave_at(word, std::string(word.text), "it follows what is computed at run time");
  }

  /// The controller takes the joints nearest to the previous ones.
  void note_order(const Flow& flow) {
    const auto before = motions_before(flow, [&](std::size_t s) -> std::optional<std::size_t> {
      if (const auto move = move_of_.find(s); move != move_of_.end()) return move->second;
      const bool follows =
          statements_[s].sets == nullptr && urscript::is_followed(tokens_[statements_[s].at]);
      return follows ? std::optional<std::size_t>(kNoMotion) : std::nullopt;
    });
    for (const auto& [step, move] : move_of_) program_.moves[move].before = before[step];
  }

  void set(std::size_t step, State& state) {
    const std::size_t at = statements_[step].at;
    if (const urscript::Assignment* assignment = statements_[step].sets; assignment != nullptr) {
      state.settings[assignment->name] = assignment->number;
      return;
    }
    values_of_.assume(&state.settings);
    const Token word = tokens_[at];
    if (!tokens_[at + 1].is("(")) return;
    for (std::size_t k = 0; k < state.superposed.size(); ++k) {
      if (superposed()[k].begins.contains(word.text)) state.superposed[k] = word.line;
      if (superposed()[k].ends.contains(word.text)) state.superposed[k] = 0;
    }
    const std::string& file = program_.files[index_].name;
    if (word.is("set_tcp")) {
      std::size_t next = at + 2;
      state.tool =
          tools_.set(values_of_.pose_of_value(values_of_.value_at(next), 0), file, word.line);
    }
    if (word.is("set_payload") || word.is("set_target_payload") || word.is("set_payload_mass") ||
        word.is("set_payload_cog"))
      state.load = tools_.loads().set(tokens_, at, state.load, file);
  }

  void join(State& state, const State& other, const std::string& by) {
    for (std::size_t k = 0; k < state.superposed.size(); ++k)
      state.superposed[k] = std::max(state.superposed[k], other.superposed[k]);
    for (auto& [name, number] : state.settings) {
      const auto there = other.settings.find(name);
      if (there == other.settings.end() || there->second != number) number = kUndecided;
    }
    for (const auto& [name, number] : other.settings) state.settings.try_emplace(name, kUndecided);
    const std::string why = by.empty() ? "a branch or a loop of the script decides it"
                                       : fmt::format("{} may change it", by);
    if (state.tool != other.tool && tools_.is_known(state.tool))
      state.tool = tools_.unknown("set_tcp: " + why);
    urscript::Loads& loads = tools_.loads();
    if (state.load != other.load && loads[state.load].why_not.empty())
      state.load = loads.add({"set_payload", std::nullopt, "set_payload: " + why});
  }

  /// Records other statements that read a rewritten target: `b = hole`, `if hole[2] > 0.5:`.
  void note_reading(std::size_t at) {
    if (!tokens_[at].is_word()) return;
    const auto variable = values_of_.variables().find(std::string(tokens_[at].text));
    if (variable == values_of_.variables().end() || !variable->second.changed.empty()) return;
    if (variable->second.in_order.empty()) return note_reading(at, variable->second.value);
    for (const Value& value : variable->second.in_order) note_reading(at, value);
  }
  void note_reading(std::size_t at, const Value& value) {
    if (!values_.contains(value.begin) || value.numbers.empty()) return;
    const bool set_here = tokens_[at + 1].is("=") && !tokens_[at + 2].is("=");
    const bool gone_to = tokens_[at - 1].is("(") && is_motion(tokens_[at - 2]);
    if (set_here || gone_to) return;
    std::size_t first = at;
    while (first > 0 && tokens_[first - 1].line == tokens_[at].line) --first;
    const bool moves = is_motion(tokens_[first]);
    if (tokens_[at + 1].is("[") && !moves) {
      read_.emplace(value.begin, fmt::format("its numbers are read elsewhere too ({} line {})",
                                             program_.files[index_].name, tokens_[at].line));
      return;
    }
    if (tokens_[first].is("global") || tokens_[first].is("local")) ++first;
    const bool assigns = first + 1 < at && tokens_[first + 1].is("=");
    program_.readings.push_back({index_,
                                 {value.begin, value.end},
                                 std::string(tokens_[at].text),
                                 index_,
                                 tokens_[at].line,
                                 assigns ? std::string(tokens_[first].text) : "",
                                 moves});
  }

  /// `set_gravity([0, 0, 9.82])`: away from the ground.
  void note_gravity(std::size_t at) {
    const std::vector<double> up = values_in(tokens_.part(at + 2, tokens_.find(")", at + 2)));
    const std::string& file = program_.files[index_].name;
    const Vector3 up_B = up.size() == 3 ? Vector3(up[0], up[1], up[2]) : Vector3(Vector3::Zero());
    if (up_B.norm() > 0)
      program_.ups.push_back({up_B.normalized(), "set_gravity", file, tokens_[at].line});
    else
      program_.notes.push_back(fmt::format(
          "set_gravity ({} line {}) is not constant: it is not compared with the cell's gravity",
          file, tokens_[at].line));
  }

  void leave_at(const Token& motion, const std::string& name, const std::string& why) {
    leave(program_, {name, index_, motion.line, std::string(motion.text), why},
          is_motion(motion) ? std::optional(program_.moves.size() - 1) : std::nullopt);
  }

  void motion(std::size_t at) {
    if (program_.frames.empty()) program_.frames.push_back({"base", Pose::Identity(), ""});
    program_.moves.push_back({index_, tokens_[at].line, {}, false});
    ProgramMove& move = program_.moves.back();
    move.is_arc = tokens_[at].is("movec");
    move.choice = is_of_axes(tokens_[at]) ? JointChoice::kNearest : JointChoice::kOnALine;
    std::size_t next = at + 2;
    const int count = tokens_[at].is("movec") ? 2 : 1;
    for (int k = 0; k < count; ++k) {
      Value value = values_of_.value_at(next);
      // The joints of a pose are those of the pose.
      std::string why;
      if (value.kind == Value::Kind::kCall && value.name == "get_inverse_kin" &&
          !value.arguments.empty())
        why = take_inverse(value, move);
      else if (!values_of_.ends_here(next, tokens_[at].line))
        value.kind = Value::Kind::kOther;
      for (std::size_t s = 0; s < superposed_.size(); ++s) {
        if (superposed_[s] != 0)
          why = fmt::format("{} (line {})", superposed()[s].why, superposed_[s]);
      }
      if (why.empty())
        use(at, value);
      else
        leave_at(tokens_[at], text_.substr(value.begin, value.end - value.begin), why);
      if (tokens_[next].is(",")) ++next;
    }
    note_speed(at, next);
  }

  /// `get_inverse_kin(p, qnear=q)`: takes its pose, and the joints that the motion should be near.
  /// Returns the reason why the value is unknown; empty: it is known.
  std::string take_inverse(Value& value, ProgramMove& move) const {
    const std::vector<Value> arguments = std::move(value.arguments);
    value = arguments[0];
    for (std::size_t k = 1; k < arguments.size(); ++k) {
      const Value& argument = arguments[k];
      if (argument.label == "tcp" || (argument.label.empty() && k == 4))
        return "get_inverse_kin is given another tool";
      if (argument.label != "qnear" && (!argument.label.empty() || k > 1)) continue;
      if (argument.kind == Value::Kind::kCall && argument.name == "get_actual_joint_positions")
        continue;
      const Told<Value> near = values_of_.resolved(argument);
      if (!near) return near.error();
      if (near->kind != Value::Kind::kJoints)
        return "the joints that it is to be near to are not constant";
      if (move.choice == JointChoice::kNearest) move.near = numbers_in(*near);
    }
    return "";
  }

  /// `v=0.1`, or the second number behind the target, m/s, of a motion of the tool.
  void note_speed(std::size_t at, std::size_t next) {
    if (is_of_axes(tokens_[at])) return;
    const std::size_t first = next;
    for (; next + 2 < tokens_.size() && tokens_[next].line == tokens_[at].line &&
           !tokens_[next].is(")");
         ++next) {
      const bool named = tokens_[next].is("v") && tokens_[next + 1].is("=");
      const bool second = next == first && tokens_[next].is_number() && tokens_[next + 1].is(",");
      if ((!named && !second) || !tokens_[next + 2].is_number()) continue;
      if (const auto speed = number_in(tokens_[next + 2]))
        program_.moves.back().speed_mm_s = to_mm(speed->value);
    }
  }

  void use(std::size_t at, const Value& value) {
    const std::string name = text_.substr(value.begin, value.end - value.begin);
    const Told<Value> now = values_of_.resolved(value);
    if (!now) return leave_at(tokens_[at], name, now.error());
    const bool readable = now->kind == Value::Kind::kPose || now->kind == Value::Kind::kJoints ||
                          (now->kind == Value::Kind::kCall && is_function_of_poses(now->name));
    if (!readable) {
      return leave_at(tokens_[at], name,
                      now->kind == Value::Kind::kCall
                          ? fmt::format("the function {} decides it", shown(now->name))
                          : std::string("an expression decides it"));
    }
    values_[now->begin] = *now;
    repeat(at, value, now->kind == Value::Kind::kJoints);
    if (now->kind == Value::Kind::kCall)
      poses_.insert_or_assign(now->begin, values_of_.pose_of_value(value, 0));
    if (now->kind == Value::Kind::kJoints)
      program_.moves.back().axes = in_degrees(Coordinates::kJointRadians, numbers_in(*now));
    sites_.add(index_, now->begin, name,
               {tool_, 0, std::string(tokens_[at].text), index_, tokens_[at].line,
                program_.moves.size() - 1, !is_of_axes(tokens_[at])});
  }

  /// Number of commas between the arguments of the call that the last bracket closes: `, qnear=[0,
  /// 1]), 1.2)` has one.
  static std::size_t commas_of_last_call(const Tokens& tokens) {
    std::size_t commas = 0;
    int depth = 0;
    for (std::size_t k = tokens.size(); k-- > 0;) {
      if (tokens[k].is(")") || tokens[k].is("]")) ++depth;
      if (tokens[k].is("(") || tokens[k].is("[")) --depth;
      if (tokens[k].is(",") && depth == 1) ++commas;
    }
    return commas;
  }

  /// `movel(hole, a=1.2, v=0.05)` stops at its target if no `r` rounds it.
  void repeat(std::size_t at, const Value& value, bool joints) {
    if (!tokens_[at].is("movel") && !tokens_[at].is("movej")) return;
    const std::size_t end = std::min(text_.find_first_of("#\r\n", value.end), text_.size());
    const std::string rest = text_.substr(value.end, end - value.end);
    const Tokens behind = tokens_of(rest, kLexis);
    constexpr std::size_t kWithoutRadius = 3;  // commas behind the place: a, v, t
    if (behind.empty() || !behind.back().is(")") || behind.has("r") ||
        commas_of_last_call(behind) > kWithoutRadius)
      return;
    std::string begin = from_line_begin(text_, tokens_[at].begin, value.begin);
    if (begin.empty()) return;
    NewText line({}, std::move(begin) + (joints ? "[" : "p["));
    line.numbers(0, 6, kScriptDecimals, ", ").text("]" + rest);
    program_.moves.back().another = {std::move(line).line(tokens_[at].begin)};
  }

  void fold(const Value& value, ProgramTarget& target) const {
    NewText whole({value.begin, value.end}, "p[");
    std::move(whole.numbers(0, 6, kScriptDecimals, ", ").text("]")).fold(target);
    keep_original(text_, value.begin, "#", text_.substr(value.begin, value.end - value.begin),
                  target);
  }

  std::size_t index_;
  Program& program_;
  Sites& sites_;
  const ReadOptions& options_;
  const std::string& text_;
  Tokens tokens_;
  urscript::Values values_of_{tokens_, program_.files[index_].name};
  std::vector<Statement> statements_;
  urscript::Tools tools_;
  std::map<std::size_t, std::string> read_;     ///< why the numbers at a place must stay
  std::size_t tool_ = 0;                        ///< at the present motion
  std::array<int, kSuperposed> superposed_{};   ///< the same
  std::map<std::size_t, std::size_t> move_of_;  ///< of Program::moves, by the step
  std::map<std::size_t, Value> values_;
  std::map<std::size_t, Told<Pose>> poses_;  ///< of values that functions compute
};

}  // namespace

Program read_urscript(std::vector<SourceFile> files, const ReadOptions& options) {
  Program program;
  program.dialect = "urscript";
  program.files = std::move(files);
  Sites sites;
  std::vector<Script> scripts;
  scripts.reserve(program.files.size());
  for (std::size_t f = 0; f < program.files.size(); ++f)
    scripts.emplace_back(f, program, sites, options).read();
  sites.finish(program, [&](const Site& site, ProgramTarget& target) {
    return scripts[site.file].describe(site, target);
  });
  return program;
}

}  // namespace trammel::cam
