#include "clients/cam/urscript/urscript.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <tl/expected.hpp>

#include "clients/cam/flow.h"
#include "clients/cam/nominal_targets.h"
#include "clients/cam/scan.h"
#include "clients/cam/sites.h"
#include "clients/cam/urscript/loads.h"
#include "clients/cam/urscript/values.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"

namespace trammel::cam {

namespace {

using urscript::Assignment;
using urscript::defines;
using urscript::is_function_of_poses;
using urscript::kUndecided;
using urscript::Load;
using urscript::Loads;
using urscript::numbers_in;
using urscript::Settings;
using urscript::Told;
using urscript::Value;
using urscript::Variable;

/// Moves the tool away from where motions say, from one function to another.
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

/// What is set when a motion comes.
struct State {
  std::size_t tool = 0, load = 0;             ///< load 0: not said
  std::array<int, kSuperposed> superposed{};  ///< the line that begins each; 0: it does not hold
  Settings settings = {};
  bool operator==(const State&) const = default;
};

/// The axes are commanded, and the tool may take any way.
bool is_of_axes(const Piece& piece) { return piece.is("movej") || piece.is("optimovej"); }
bool is_motion(const Piece& piece) {
  return is_of_axes(piece) || piece.is("movel") || piece.is("movep") || piece.is("movec") ||
         piece.is("optimovel");
}

/// Moves the arm to where no pose says.
bool is_followed(const Piece& piece) {
  static const std::set<std::string_view> kFollows = {"servoj", "servoc",         "speedl",
                                                      "speedj", "freedrive_mode", "teach_mode"};
  return kFollows.contains(piece.text);
}

class Script {
 public:
  Script(std::size_t index, Program& program, Sites& sites, const ReadOptions& options)
      : index_(index),
        program_(program),
        sites_(sites),
        options_(options),
        text_(program.files[index].text),
        pieces_(pieces_of(text_, text_.starts_with("\xEF\xBB\xBF") ? 3 : 0, text_.size(), 1,
                          {"#", "\"'"})) {}

  void read() {
    program_.mark_places.push_back({text_.starts_with("\xEF\xBB\xBF") ? std::size_t{3} : 0, "# "});
    const std::size_t tool = unknown_tool();
    note_cuts();
    find_steps();
    Flow flow = flow_of(steps_);
    flow.entries = {0};
    const std::vector<State> states = states_before(
        flow, State{tool, 0, {}}, [&](std::size_t s, State& state) { set(s, state); },
        [&](State& state, const State& other, const std::string& by) { join(state, other, by); });
    for (std::size_t s = 0; s < steps_.size(); ++s) {
      if (sets_[s] != nullptr) continue;
      const std::size_t at = step_at_[s];
      if (pieces_[at].is("set_gravity")) note_gravity(at);
      if (is_motion(pieces_[at])) {
        tool_ = tool_carrying(states[s]);
        superposed_ = states[s].superposed;
        values_of_.assume(&states[s].settings);
        move_of_.emplace(s, program_.moves.size());
        motion(at);
      }
      if (pieces_[at].is("servoj") || pieces_[at].is("servoc") || pieces_[at].is("speedl"))
        leave(pieces_[at], std::string(pieces_[at].text),
              "it follows what is computed at run time");
    }
    values_of_.assume(nullptr);
    note_order(flow);
    for (std::size_t at = 0; at < pieces_.size(); ++at) note_reading(at);
  }

  std::string describe(const Site& site, ProgramTarget& target) const {
    const Value& value = values_.at(site.begin);
    target.line = value.line;
    if (const auto read = read_.find(site.begin); read != read_.end()) return read->second;
    if (value.kind == Value::Kind::kJoints) {
      if (options_.keep_joints) return "joint targets are kept (--keep-joints)";
      target.coordinates = Coordinates::kJointRadians;
      return rewrite_numbers(value, target);
    }
    target.coordinates = Coordinates::kRotationVector;
    if (value.kind == Value::Kind::kPose) return rewrite_numbers(value, target);
    const Told<Pose>& pose = poses_.at(site.begin);
    if (!pose) return pose.error();
    target.numbers = numbers_of(Coordinates::kRotationVector, *pose, std::vector<double>(6, 0.0));
    fold(value, target);
    return "";
  }

 private:
  /// The words that decide the order, and the functions that move the robot or set something.
  void find_steps() {
    using Kind = Step::Kind;
    static const std::map<std::string_view, Kind> kWords = {{"if", Kind::kIf},
                                                            {"elif", Kind::kCase},
                                                            {"else", Kind::kElse},
                                                            {"while", Kind::kWhile},
                                                            {"end", Kind::kEnd},
                                                            {"break", Kind::kExit},
                                                            {"continue", Kind::kContinue},
                                                            {"return", Kind::kReturn},
                                                            {"halt", Kind::kReturn}};
    std::set<std::string> functions;
    for (std::size_t at = 0; at + 1 < pieces_.size(); ++at) {
      if (pieces_[at].is("def")) functions.emplace(pieces_[at + 1].text);
    }
    auto next = values_of_.assignments().begin();
    const auto add = [&](Step step, std::size_t at, const Assignment* assignment = nullptr) {
      steps_.push_back(std::move(step));
      step_at_.push_back(at);
      sets_.push_back(assignment);
    };
    for (std::size_t at = 0; at < pieces_.size(); ++at) {
      // What an assignment calls comes before it.
      for (; next != values_of_.assignments().end() && next->first <= at; ++next)
        if (values_of_.is_set_in_order(next->second.name)) add({Kind::kPlain}, at, &next->second);
      if (pieces_[at].kind != Piece::Kind::kWord) continue;
      const bool is_call = at + 1 < pieces_.size() && pieces_[at + 1].is("(");
      if (defines(pieces_[at]) && at + 1 < pieces_.size()) {
        const std::string name(pieces_[at + 1].text);
        // A thread runs beside all others.
        add(pieces_[at].is("def")
                ? Step{Kind::kRoutine, name}
                : Step{Kind::kInterrupt, fmt::format("the thread {}", shown(name))},
            at);
        ++at;  // not a call of it
      } else if (const auto word = kWords.find(pieces_[at].text); word != kWords.end()) {
        add({word->second}, at);
      } else if (is_call) {
        const std::string name(pieces_[at].text);
        const bool known = functions.contains(name);
        add({known ? Kind::kCall : Kind::kPlain, known ? name : ""}, at);
      }
    }
  }

  /// `def`, `if` and `while` have an `end` each.
  void note_cuts() {
    std::vector<const Piece*> open;
    for (const Piece& piece : pieces_) {
      if (piece.kind != Piece::Kind::kWord) continue;
      if (defines(piece) || piece.is("if") || piece.is("while")) open.push_back(&piece);
      if (!piece.is("end")) continue;
      if (open.empty())
        return program_.cuts.push_back({index_, piece.line, "an end without its beginning"});
      open.pop_back();
    }
    if (!open.empty())
      program_.cuts.push_back(
          {index_, open.back()->line, fmt::format("{} has no end", open.back()->text)});
  }

  /// The controller takes the joints nearest to those before.
  void note_order(const Flow& flow) {
    const auto before = motions_before(flow, [&](std::size_t s) -> std::optional<std::size_t> {
      if (const auto move = move_of_.find(s); move != move_of_.end()) return move->second;
      return sets_[s] == nullptr && is_followed(pieces_[step_at_[s]])
                 ? std::optional<std::size_t>(kNoMotion)
                 : std::nullopt;
    });
    for (const auto& [step, move] : move_of_) program_.moves[move].before = before[step];
  }

  void set(std::size_t step, State& state) {
    const std::size_t at = step_at_[step];
    if (const Assignment* assignment = sets_[step]; assignment != nullptr) {
      state.settings[assignment->name] = assignment->number;
      return;
    }
    values_of_.assume(&state.settings);
    if (at + 1 >= pieces_.size() || !pieces_[at + 1].is("(")) return;
    for (std::size_t k = 0; k < state.superposed.size(); ++k) {
      if (superposed()[k].begins.contains(pieces_[at].text)) state.superposed[k] = pieces_[at].line;
      if (superposed()[k].ends.contains(pieces_[at].text)) state.superposed[k] = 0;
    }
    if (pieces_[at].is("set_tcp")) state.tool = tool_set(at);
    if (pieces_[at].is("set_payload") || pieces_[at].is("set_target_payload") ||
        pieces_[at].is("set_payload_mass") || pieces_[at].is("set_payload_cog"))
      state.load = loads_.set(pieces_, at, state.load, program_.files[index_].name);
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
    if (state.tool != other.tool && program_.tools[state.tool].why_not.empty()) {
      ProgramTool tool;
      tool.name = "tcp";
      tool.why_not = "set_tcp: " + why;
      state.tool = known_tool(std::move(tool));
    }
    if (state.load != other.load && loads_[state.load].why_not.empty())
      state.load = loads_.add({"set_payload", std::nullopt, "set_payload: " + why});
  }

  std::size_t known_tool(ProgramTool tool) {
    for (std::size_t k = 0; k < program_.tools.size(); ++k) {
      const ProgramTool& known = program_.tools[k];
      const bool same_pose = known.X_FT && tool.X_FT && known.X_FT->isApprox(*tool.X_FT, 1e-12);
      const bool both_unknown =
          !known.X_FT && !tool.X_FT && known.why_not == tool.why_not && !tool.why_not.empty();
      if ((same_pose || both_unknown) && known.carries == tool.carries &&
          known.why_not == tool.why_not)
        return k;
    }
    program_.tools.push_back(std::move(tool));
    return program_.tools.size() - 1;
  }

  /// The tool as a motion has it.
  std::size_t tool_carrying(const State& state) {
    if (state.load == 0) return state.tool;
    const auto [entry, is_new] = carrying_.try_emplace({state.tool, state.load}, 0);
    if (!is_new) return entry->second;
    const Load& load = loads_[state.load];
    ProgramTool tool = program_.tools[state.tool];
    tool.carries = load.name;
    tool.load = load.load;
    if (tool.why_not.empty()) tool.why_not = load.why_not;
    return entry->second = known_tool(std::move(tool));
  }

  /// What else reads a target that is written anew: `b = hole`, `if hole[2] > 0.5:`.
  void note_reading(std::size_t at) {
    if (pieces_[at].kind != Piece::Kind::kWord) return;
    const auto variable = values_of_.variables().find(std::string(pieces_[at].text));
    if (variable == values_of_.variables().end() || !variable->second.changed.empty()) return;
    if (variable->second.in_order.empty()) return note_reading(at, variable->second.value);
    for (const Value& value : variable->second.in_order) note_reading(at, value);
  }
  void note_reading(std::size_t at, const Value& value) {
    if (!values_.contains(value.begin) || value.numbers.empty()) return;
    const bool set_here = at + 1 < pieces_.size() && pieces_[at + 1].is("=") &&
                          !pieces_[std::min(at + 2, pieces_.size() - 1)].is("=");
    const bool gone_to = at > 1 && pieces_[at - 1].is("(") && is_motion(pieces_[at - 2]);
    if (set_here || gone_to) return;
    std::size_t first = at;
    while (first > 0 && pieces_[first - 1].line == pieces_[at].line) --first;
    const bool moves = is_motion(pieces_[first]);
    if (at + 1 < pieces_.size() && pieces_[at + 1].is("[") && !moves) {
      read_.emplace(value.begin, fmt::format("its numbers are read elsewhere too ({} line {})",
                                             program_.files[index_].name, pieces_[at].line));
      return;
    }
    if (pieces_[first].is("global") || pieces_[first].is("local")) ++first;
    const bool assigns = first + 1 < at && pieces_[first + 1].is("=");
    program_.readings.push_back({index_,
                                 {value.begin, value.end},
                                 std::string(pieces_[at].text),
                                 index_,
                                 pieces_[at].line,
                                 assigns ? std::string(pieces_[first].text) : "",
                                 moves});
  }

  std::size_t unknown_tool() {
    ProgramTool tool;
    tool.name = "tcp";
    take_row("TCP", options_, tool);
    program_.tools.push_back(std::move(tool));
    return program_.tools.size() - 1;
  }

  /// `set_gravity([0, 0, 9.82])`: away from the ground.
  void note_gravity(std::size_t at) {
    std::vector<double> up;
    for (std::size_t k = at + 2; k < pieces_.size() && !pieces_[k].is(")"); ++k) {
      if (pieces_[k].kind == Piece::Kind::kNumber)
        up.push_back(read_number(pieces_[k].text).value_or(WrittenNumber{}).value);
    }
    const std::string& file = program_.files[index_].name;
    const Vector3 up_B = up.size() == 3 ? Vector3(up[0], up[1], up[2]) : Vector3(Vector3::Zero());
    if (up_B.norm() > 0)
      program_.ups.push_back({up_B.normalized(), "set_gravity", file, pieces_[at].line});
    else
      program_.notes.push_back(fmt::format(
          "set_gravity ({} line {}) is not constant: it is not compared with the cell's gravity",
          file, pieces_[at].line));
  }

  std::size_t tool_set(std::size_t at) {
    std::size_t next = at + 2;
    const Told<Pose> X_FT = values_of_.pose_of_value(values_of_.value_at(next), 0);
    ProgramTool tool;
    tool.name = "tcp";
    tool.file = program_.files[index_].name;
    tool.line = pieces_[at].line;
    tool.rotation_rounding = 2e-4;
    if (X_FT)
      tool.X_FT = *X_FT;
    else
      tool.why_not = fmt::format("set_tcp (line {}): {}", tool.line, X_FT.error());
    return known_tool(std::move(tool));
  }

  void leave(const Piece& motion, const std::string& name, const std::string& why) {
    if (is_motion(motion)) program_.moves.back().left_some = true;
    program_.left.push_back({name, index_, motion.line, std::string(motion.text), why});
  }

  void motion(std::size_t at) {
    if (program_.frames.empty()) program_.frames.push_back({"base", Pose::Identity(), ""});
    program_.moves.push_back({index_, pieces_[at].line, {}, false});
    ProgramMove& move = program_.moves.back();
    move.is_arc = pieces_[at].is("movec");
    move.choice = is_of_axes(pieces_[at]) ? JointChoice::kNearest : JointChoice::kOnALine;
    std::size_t next = at + 2;
    const int count = pieces_[at].is("movec") ? 2 : 1;
    for (int k = 0; k < count; ++k) {
      Value value = values_of_.value_at(next);
      // The joints of a pose are those of the pose.
      std::string why;
      if (value.kind == Value::Kind::kCall && value.name == "get_inverse_kin" &&
          !value.arguments.empty())
        why = take_inverse(value, move);
      else if (!values_of_.ends_here(next, pieces_[at].line) && next < pieces_.size() &&
               !pieces_[next].is(","))
        value.kind = Value::Kind::kOther;
      for (std::size_t s = 0; s < superposed_.size(); ++s) {
        if (superposed_[s] != 0)
          why = fmt::format("{} (line {})", superposed()[s].why, superposed_[s]);
      }
      if (why.empty())
        use(at, value);
      else
        leave(pieces_[at], text_.substr(value.begin, value.end - value.begin), why);
      if (next < pieces_.size() && pieces_[next].is(",")) ++next;
    }
    note_speed(at, next);
  }

  /// `get_inverse_kin(p, qnear=q)`: what stands for its pose, and the joints that the motion is to
  /// be near to. Returns why it is not known; empty: it is.
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
    if (is_of_axes(pieces_[at])) return;
    const std::size_t first = next;
    for (; next + 2 < pieces_.size() && pieces_[next].line == pieces_[at].line &&
           !pieces_[next].is(")");
         ++next) {
      const bool named = pieces_[next].is("v") && pieces_[next + 1].is("=");
      const bool second =
          next == first && pieces_[next].kind == Piece::Kind::kNumber && pieces_[next + 1].is(",");
      if (!named && !second) continue;
      if (pieces_[next + 2].kind != Piece::Kind::kNumber) continue;
      if (const auto speed = read_number(pieces_[next + 2].text))
        program_.moves.back().speed_mm_s = to_mm(speed->value);
    }
  }

  void use(std::size_t at, const Value& value) {
    const std::string name = text_.substr(value.begin, value.end - value.begin);
    const Told<Value> now = values_of_.resolved(value);
    if (!now) return leave(pieces_[at], name, now.error());
    const bool readable = now->kind == Value::Kind::kPose || now->kind == Value::Kind::kJoints ||
                          (now->kind == Value::Kind::kCall && is_function_of_poses(now->name));
    if (!readable) {
      return leave(pieces_[at], name,
                   now->kind == Value::Kind::kCall
                       ? fmt::format("the function {} decides it", shown(now->name))
                       : std::string("an expression decides it"));
    }
    values_[now->begin] = *now;
    if (now->kind == Value::Kind::kCall)
      poses_.insert_or_assign(now->begin, values_of_.pose_of_value(value, 0));
    if (now->kind == Value::Kind::kJoints)
      program_.moves.back().axes = in_degrees(Coordinates::kJointRadians, numbers_in(*now));
    sites_.add(index_, now->begin, name,
               {tool_, 0, std::string(pieces_[at].text), index_, pieces_[at].line,
                program_.moves.size() - 1, !is_of_axes(pieces_[at])});
  }

  static std::string rewrite_numbers(const Value& value, ProgramTarget& target) {
    for (std::size_t k = 0; k < 6; ++k) {
      const auto written = read_number(value.numbers[k].text);
      if (!written) return "it holds what is no number";
      target.numbers.push_back(written->value);
      target.rewrites.push_back(
          {{value.numbers[k].begin, value.numbers[k].end}, {}, {{k, written->style}}});
    }
    return "";
  }

  void fold(const Value& value, ProgramTarget& target) const {
    target.folded = true;
    Rewrite whole{{value.begin, value.end}, {"p["}, {}};
    for (std::size_t k = 0; k < 6; ++k) {
      NumberStyle style;
      style.decimals = 6;
      whole.slots.push_back({k, style});
      whole.texts.emplace_back(k < 5 ? ", " : "]");
    }
    target.comment_at = line_begin(text_, value.begin);
    const std::size_t indent = text_.find_first_not_of(" \t", target.comment_at);
    std::string original = text_.substr(value.begin, value.end - value.begin);
    for (char& c : original) {
      if (c == '\n' || c == '\r') c = ' ';
    }
    target.comment =
        text_.substr(target.comment_at, indent - target.comment_at) + "# trammel: was " + original;
    target.rewrites.push_back(std::move(whole));
  }

  std::size_t index_;
  Program& program_;
  Sites& sites_;
  const ReadOptions& options_;
  const std::string& text_;
  std::vector<Piece> pieces_;
  urscript::Values values_of_{pieces_, program_.files[index_].name};
  std::vector<Step> steps_;
  std::vector<std::size_t> step_at_;  ///< the piece of each
  Loads loads_;
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> carrying_;
  std::map<std::size_t, std::string> read_;     ///< why the numbers at a place must stay
  std::size_t tool_ = 0;                        ///< of the motion that is read
  std::array<int, kSuperposed> superposed_{};   ///< the same
  std::map<std::size_t, std::size_t> move_of_;  ///< of Program::moves, by the step
  std::vector<const Assignment*> sets_;         ///< of each step; nullptr: it is no such one
  std::map<std::size_t, Value> values_;
  std::map<std::size_t, Told<Pose>> poses_;  ///< of values that functions make
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
