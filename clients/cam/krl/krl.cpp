#include "clients/cam/krl/krl.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <tl/expected.hpp>

#include "clients/cam/flow.h"
#include "clients/cam/krl/lines.h"
#include "clients/cam/krl/variables.h"
#include "clients/cam/sites.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"

namespace trammel::cam {

namespace {

using krl::Assigned;
using krl::because;
using krl::done_later;
using krl::is_motion;
using krl::kPose;
using krl::Line;
using krl::root_of;
using krl::stem_of;
using krl::Token;
using krl::TokenKind;
using krl::Told;
using krl::upper;
using krl::Value;
using krl::Variable;

constexpr int kDeepest = 20;  // calls within calls
constexpr std::array<const char*, 6> kAxes = {"A1", "A2", "A3", "A4", "A5", "A6"};

/// Of a number that the program did not write.
const NumberStyle kThreeDecimals = [] {
  NumberStyle style;
  style.decimals = 3;
  return style;
}();

struct Routine {
  std::string name;
  std::size_t file = 0, first = 0, last = 0;  ///< lines
};

constexpr double kSpeedUnknown = -1;

constexpr const char* kToolStands = "the tool stands and the robot holds the work piece";

/// What the controller has set when a motion comes.
struct State {
  std::size_t tool = 0, frame = 0;
  std::size_t load = 0;          ///< 0: the tool's own
  std::string fixed_tool;        ///< why the robot does not hold the tool; empty: it does
  std::string sensed;            ///< why a sensor moves the path; empty: none does
  std::uint64_t armed = 0;       ///< interrupts that are declared, a bit each
  double speed = kSpeedUnknown;  ///< of the tool, mm/s
  auto operator<=>(const State&) const = default;
};

/// What `$LOAD` was set to.
struct Load {
  std::string name;
  std::optional<StatedLoad> load;
  std::string note, why_not;
};

bool is_relative(const std::string& word) {
  return word.ends_with("_REL") && is_motion(word.substr(0, word.size() - 4));
}

/// `PTP`, `SPTP`, `PTP_REL`
bool is_by_axes(const std::string& word) { return word.find("PTP") != std::string::npos; }

/// `PTP $AXIS_ACT` goes to where the axes are: it has no target.
bool stands_still(const std::vector<Token>& tokens) {
  const bool alone = tokens.size() == 2 || (tokens.size() > 2 && tokens[2].kind == TokenKind::kWord);
  return alone && tokens[1].text == "$AXIS_ACT";
}

class Reader {
 public:
  Reader(std::vector<SourceFile> files, const ReadOptions& options) : options_(options) {
    program_.dialect = "krl";
    program_.files = std::move(files);
    program_.frames.push_back({"$BASE", Pose::Identity(), "no $BASE is set before it"});
    program_.frames.push_back({"$NULLFRAME", Pose::Identity(), ""});
    program_.tools.push_back({"$TOOL", "", 0, std::nullopt, std::nullopt, 0, "no $TOOL is set before it"});
  }

  Program read() {
    for (std::size_t f = 0; f < program_.files.size(); ++f) collect(f);
    note_handed_over();
    names_.join_globals();
    find_base();
    find_numbers();
    std::set<std::string> called;
    for (std::size_t r = 0; r < routines_.size(); ++r) by_name_.emplace(routines_[r].name, r);
    find_interrupts(called);
    for (const Routine& routine : routines_) note_calls(routine, called);
    for (std::size_t r = 0; r < routines_.size(); ++r) {
      if (!called.contains(routines_[r].name)) run(r, {}, 0);
    }
    for (std::size_t r = 0; r < routines_.size(); ++r) {
      if (!ran_.contains(r)) run(r, {}, 0);
    }
    for (std::size_t f = 0; f < lines_.size(); ++f) note_readings(f);
    sites_.finish(program_, [this](const Site& site, ProgramTarget& target) { return describe(site, target); });
    find_order();
    list_unused();
    note_elsewhere();
    note_angles();
    return std::move(program_);
  }

 private:
  // First pass: lines, routines, names.

  void collect(std::size_t f) {
    lines_.push_back(krl::lines_of(program_.files[f].text));
    int open = -1;  // the routine that the line is in
    MarkPlace mark{program_.files[f].text.starts_with("\xEF\xBB\xBF") ? std::size_t{3} : 0, "; "};
    const std::vector<Line>& lines = lines_[f];
    if (is_controllers_bas(f)) return program_.mark_places.push_back(mark);
    std::size_t spline = lines.size();  // the head of the block that the line is in; their number: none
    bool any = false;
    for (std::size_t k = 0; k < lines.size(); ++k) {
      note_tool_name(lines[k]);
      note_robot(f, k);
      const std::vector<Token>& tokens = lines[k].tokens;
      const std::size_t first = !tokens.empty() && tokens[0].text == "GLOBAL" ? 1 : 0;
      const std::string word = tokens.empty() ? "" : tokens[0].text;
      if (word == "ENDSPLINE") spline = lines.size();
      if (spline < lines.size()) spline_heads_[{f, k}] = spline;
      if (word == "SPLINE" || word == "PTP_SPLINE") spline = k;
      if (tokens.size() > first + 1 &&
          (tokens[first].text == "DEF" || tokens[first].text == "DEFFCT" || tokens[first].text == "DEFDAT")) {
        const std::size_t name = first + (tokens[first].text == "DEFFCT" && tokens.size() > first + 2 ? 2 : 1);
        if (!any) mark.at = k + 1 < lines.size() ? lines[k + 1].begin : mark.at;
        any = true;
        if (tokens[first].text == "DEFDAT") continue;
        names_.note_parameters(f, k, name + 1);
        routines_.push_back({tokens[name].text, f, k + 1, lines.size()});
        open = static_cast<int>(routines_.size()) - 1;
      } else if (!tokens.empty() && (tokens[0].text == "END" || tokens[0].text == "ENDFCT") && open >= 0) {
        routines_[static_cast<std::size_t>(open)].last = k;
        open = -1;
      } else {
        names_.note_value(f, k);
        note_moved_axes(tokens);
      }
    }
    if (!any) routines_.push_back({"", f, 0, lines.size()});
    program_.mark_places.push_back(mark);
  }

  /// `shift(XP2)`: a routine of these files that takes it without `:IN`, or one of others, may set it.
  void note_handed_over() {
    for (std::size_t f = 0; f < lines_.size(); ++f) {
      for (std::size_t k = 0; k < lines_[f].size(); ++k) {
        const std::vector<Token>& tokens = lines_[f][k].tokens;
        for (std::size_t at = 0; at + 1 < tokens.size(); ++at) {
          const bool calls = tokens[at].kind == TokenKind::kWord && tokens[at + 1].text == "(";
          if (calls && !declares(tokens)) note_handed_over(f, k, at);
        }
      }
    }
  }
  /// `DEF shift(p:IN)`, `EXT shift(E6POS:IN)`
  static bool declares(const std::vector<Token>& tokens) {
    static const std::set<std::string> kWords = {"DEF", "DEFFCT", "EXT", "EXTFCT"};
    const std::size_t first = tokens.size() > 1 && tokens[0].text == "GLOBAL" ? 1 : 0;
    return kWords.contains(tokens[first].text);
  }
  void note_handed_over(std::size_t f, std::size_t k, std::size_t at) {
    const std::vector<Token>& tokens = lines_[f][k].tokens;
    const std::string& name = tokens[at].text;
    const auto routine =
        std::find_if(routines_.begin(), routines_.end(), [&](const Routine& one) { return one.name == name; });
    // Functions of the controller in expressions take values; so do BAS( ) and `IF (`.
    const bool is_statement = at == 0 && name != "BAS" && step_of(tokens).kind == Step::Kind::kPlain;
    if (routine == routines_.end() && !is_statement) return;
    if (routine == routines_.end()) elsewhere_.insert(name);
    std::size_t argument = 0;
    int depth = 0;
    for (std::size_t t = at + 1; t + 1 < tokens.size(); ++t) {
      if (tokens[t].text == "(" || tokens[t].text == "[" || tokens[t].text == "{") ++depth;
      if (tokens[t].text == ")" || tokens[t].text == "]" || tokens[t].text == "}") --depth;
      if (depth == 0) return;
      if (depth != 1) continue;
      if (tokens[t].text == ",") ++argument;
      if (tokens[t].text != "(" && tokens[t].text != ",") continue;
      const bool by_value = routine != routines_.end() && takes_value(*routine, argument);
      if (!by_value && tokens[t + 1].kind == TokenKind::kWord) names_.note_handed_over(f, k, t + 1, tokens[at].text);
    }
  }
  /// Whether the parameter of that number is `:IN`.
  [[nodiscard]] bool takes_value(const Routine& routine, std::size_t number) const {
    if (routine.first == 0) return true;
    const std::vector<Token>& tokens = lines_[routine.file][routine.first - 1].tokens;
    std::size_t parameter = 0;
    for (std::size_t t = 0; t + 1 < tokens.size(); ++t) {
      if (tokens[t].text == ",") ++parameter;
      if (tokens[t].text == ":" && parameter == number) return tokens[t + 1].text == "IN";
    }
    return false;
  }

  /// `PTP {E1 90}`, `ASYPTP {E1 90}`: an external axis moves, and no target says it.
  void note_moved_axes(const std::vector<Token>& tokens) {
    if (tokens.empty() || !(is_motion(tokens[0].text) || is_relative(tokens[0].text) || tokens[0].text == "ASYPTP"))
      return;
    std::size_t end = 0;
    const std::vector<Value> target = krl::operands_at(tokens, 1, &end);
    if (target.size() != 1 || target[0].kind != Value::Kind::kAggregate) return;
    const bool whole = target[0].field("X") != nullptr || target[0].field("A1") != nullptr;
    const bool relative = is_relative(tokens[0].text);
    for (int axis = 0; axis < 6 && (!whole || relative); ++axis) {
      const Value* to = target[0].field(fmt::format("E{}", axis + 1));
      const bool stands = relative && to != nullptr && to->kind == Value::Kind::kNumber && to->number == 0;
      if (to != nullptr && !stands) program_.moved_axes.insert(axis);
    }
  }

  /// The controller's own `bas.src`: BAS( ) means the same with it among the files as without.
  [[nodiscard]] bool is_controllers_bas(std::size_t f) const {
    const std::string& name = program_.files[f].name;
    if (upper(name.substr(name.find_last_of("/\\") + 1)) != "BAS.SRC") return false;
    return std::any_of(lines_[f].begin(), lines_[f].end(), [](const Line& line) {
      const std::size_t first = !line.tokens.empty() && line.tokens[0].text == "GLOBAL" ? 1 : 0;
      return line.tokens.size() > first + 1 && line.tokens[first].text == "DEF" && line.tokens[first + 1].text == "BAS";
    });
  }

  /// `;FOLD PTP P1 ... Tool[1]:spindle Base[2]:panel;...`
  void note_tool_name(const Line& line) {
    if (!line.comment.starts_with("FOLD")) return;
    const std::size_t at = line.comment.find("Tool[");
    const std::size_t close = line.comment.find("]:", at == std::string_view::npos ? line.comment.size() : at);
    if (at == std::string_view::npos || close == std::string_view::npos) return;
    const std::size_t end = line.comment.find_first_of(" ;,\t\r", close + 2);
    const std::string number(line.comment.substr(at + 5, close - at - 5));
    tool_names_.emplace(number, std::string(line.comment.substr(close + 2, end - close - 2)));
  }

  /// Routines that the files lack may do more than they seem to.
  void note_elsewhere() {
    static const std::set<std::string> kOfTheController = {
        "PULSE", "COPEN", "CCLOSE", "CREAD", "CWRITE", "SWRITE", "SREAD", "P00", "CLEAR", "DELETE_BACKWARD_BUFFER"};
    for (const std::string& name : kOfTheController) elsewhere_.erase(name);
    if (elsewhere_.empty() || !sets_by_hand_) return;
    constexpr std::size_t kMost = 5;
    const std::vector<std::string> all(elsewhere_.begin(), elsewhere_.end());
    const std::size_t shown_here = std::min(all.size(), kMost);
    program_.notes.push_back(
        fmt::format("{}{}: not in the files handed over, taken to leave $TOOL, $BASE and $LOAD as they are",
                    fmt::join(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(shown_here), ", "),
                    all.size() > kMost ? fmt::format(" and {} more", all.size() - kMost) : ""));
  }

  // What `$machine.dat` says of the robot.

  /// Each value that a variable of the controller is given in the files.
  template <typename Work>
  void at_each(const std::string& name, const Work& work) const {
    for (const auto& [key, variable] : names_.all()) {
      if (key.second != name) continue;
      for (const Assigned& at : variable.values) {
        if (at.operands.size() == 1) work(at, at.operands[0]);
      }
    }
  }

  void find_base() {
    if (!on_rail_.empty()) {
      program_.notes.push_back(
          fmt::format("an external axis carries the robot ({}): $ROBROOT moves and is not used", on_rail_));
      return;
    }
    at_each("$ROBROOT", [&](const Assigned& at, const Value&) {
      const Told<Pose> X_WB = names_.frame_of(at.operands, at.file);
      if (X_WB) program_.bases.push_back({*X_WB, "$ROBROOT", program_.files[at.file].name, line_at(at)});
    });
    if (const auto row = options_.frames.find(kRobotBase); row != options_.frames.end())
      names_.set_robroot(row->second);
    else if (!program_.bases.empty())
      names_.set_robroot(program_.bases.front().X_WB);
  }

  void find_numbers() {
    const auto add = [&](ArmNumber of, const char* name, const auto& value_of) {
      at_each(name, [&](const Assigned& at, const Value& value) {
        if (const std::optional<double> number = value_of(at, value))
          program_.numbers.push_back({of, *number, name, program_.files[at.file].name, line_at(at)});
      });
    };
    const auto count = [](const Assigned&, const Value& value) -> std::optional<double> {
      return value.kind == Value::Kind::kNumber ? std::optional<double>(value.number) : std::nullopt;
    };
    const auto length = [](const Assigned&, const Value& value) -> std::optional<double> {
      // Arms of other kinds have zeros there.
      const bool said = value.kind == Value::Kind::kNumber && value.number != 0;
      return said ? std::optional<double>(from_mm(value.number)) : std::nullopt;
    };
    const auto along = [&](const Assigned& at, const Value&) -> std::optional<double> {
      const Told<Pose> X = names_.frame_of(at.operands, at.file);
      const bool said = X && !X->translation().isZero();
      return said ? std::optional<double>(X->translation().norm()) : std::nullopt;
    };
    add(ArmNumber::kAxes, "$NUM_AX", count);
    add(ArmNumber::kHeightOfAxis2, "$TIRORO", along);
    add(ArmNumber::kAxis1ToAxis2, "$LENGTH_A", length);
    add(ArmNumber::kAxis2ToAxis3, "$LENGTH_B", length);
    add(ArmNumber::kAxis3ToWrist, "$TX3P3", along);
    add(ArmNumber::kWristToFlange, "$TFLWP", along);
  }

  /// `$TRAFONAME[]="#KR210R2700 EXTRA C4 FLR"`, `DECL EX_KIN $EX_KIN={ET1 #ERSYS,...}`
  void note_robot(std::size_t f, std::size_t k) {
    const std::vector<Token>& tokens = lines_[f][k].tokens;
    const auto has = [&](const char* word) {
      return std::any_of(tokens.begin(), tokens.end(), [&](const Token& token) { return token.text == word; });
    };
    if (has("$EX_KIN") && has("ERSYS")) on_rail_ = names_.place(f, k);
    if (tokens.size() < 3 || tokens[0].text != "$TRAFONAME" || tokens.back().kind != TokenKind::kText) return;
    const std::string& text = tokens.back().text;
    program_.types.push_back(
        {text.substr(1, text.size() - 2), "$TRAFONAME", program_.files[f].name, lines_[f][k].number});
  }

  [[nodiscard]] int line_at(const Assigned& at) const { return lines_[at.file][at.line].number; }

  // Tools and bases.

  std::size_t add_tool(ProgramTool tool) { return add_once(program_, std::move(tool)); }
  std::size_t add_frame(ProgramFrame frame) { return add_once(program_, std::move(frame)); }

  std::size_t tool_numbered(int number, std::size_t f) {
    if (number == 0) return add_tool({"TOOL_DATA[0]", "", 0, Pose::Identity(), std::nullopt, 0, ""});
    const std::string data = fmt::format("TOOL_DATA[{}]", number);
    ProgramTool tool;
    const auto named = tool_names_.find(std::to_string(number));
    tool.name = named == tool_names_.end() ? data : named->second;
    const bool by_row = take_row(data, options_, tool);
    const Told<const Assigned*> value = names_.value_of(data, f);
    if (value && by_row)
      tool.why_not = against_row(data, *tool.X_FT, names_.frame_of((*value)->operands, (*value)->file), **value);
    else if (value)
      fill(**value, tool);
    else if (names_.is_set(data, f))
      tool.why_not = value.error();
    const std::string load = fmt::format("LOAD_DATA[{}]", number);
    if (const Told<const Assigned*> stated = names_.value_of(load, f)) {
      tool.load = load_of((*stated)->operands);
      tool.load_note = note_on_default(tool.load, **stated);
    } else if (names_.is_set(load, f)) {
      tool.load_note = fmt::format("{}: it is not compared with the cell's", stated.error());
    }
    return add_tool(std::move(tool));
  }

  /// Why a row of --frames cannot hold beside the value of the files; empty: it can.
  [[nodiscard]] std::string against_row(const std::string& row, const Pose& X, const Told<Pose>& by_files,
                                        const Assigned& at) const {
    return by_files ? cam::against_row(row, X, *by_files, names_.place(at.file, at.line)) : by_files.error();
  }

  void fill(const Assigned& assigned, ProgramTool& tool) const {
    tool.file = program_.files[assigned.file].name;
    tool.line = lines_[assigned.file][assigned.line].number;
    const Told<Pose> X_FT = names_.frame_of(assigned.operands, assigned.file);
    if (!X_FT) {
      tool.why_not = fmt::format("tool {}: {}", shown(tool.name), X_FT.error());
      return;
    }
    tool.X_FT = *X_FT;
    tool.rotation_rounding = from_deg(0.001);
  }

  static std::optional<StatedLoad> load_of(const std::vector<Value>& operands) {
    if (operands.size() != 1) return std::nullopt;
    const Value* mass = operands[0].field("M");
    const Value* centre = operands[0].field("CM");
    if (mass == nullptr || mass->kind != Value::Kind::kNumber) return std::nullopt;
    if (mass->number < 0) return StatedLoad{mass->number, Vector3::Zero(), false};
    if (centre == nullptr) return std::nullopt;
    StatedLoad load;
    load.mass = mass->number;
    for (Eigen::Index k = 0; k < 3; ++k) {
      const Value* number = centre->field(kPose[static_cast<std::size_t>(k)]);
      if (number == nullptr || number->kind != Value::Kind::kNumber) return std::nullopt;
      load.p_F(k) = from_mm(number->number);
    }
    return load;
  }

  /// `{M -1}` says that nobody has told the load.
  [[nodiscard]] std::string note_on_default(const std::optional<StatedLoad>& load, const Assigned& at) const {
    if (!load || load->mass >= 0) return "";
    return fmt::format(
        "a load of {:g} kg ({}): the controller takes its default load, which is not compared with the "
        "cell's",
        load->mass, names_.place(at.file, at.line));
  }

  /// `$TOOL = ...`
  std::size_t tool_set(const std::vector<Value>& operands, std::size_t f, std::size_t k) {
    const std::string data = operands.size() == 1 && operands[0].kind == Value::Kind::kName ? operands[0].name : "";
    if (data == "$NULLFRAME") return tool_numbered(0, f);
    if (data.starts_with("TOOL_DATA[") && data.find('*') == std::string::npos)
      return tool_numbered(std::atoi(data.c_str() + 10), f);
    ProgramTool tool;
    tool.name = data.empty() ? "$TOOL" : data;
    if (!data.empty() && names_.find(data, f) == nullptr) return add_tool(std::move(tool));
    fill({f, k, operands}, tool);
    return add_tool(std::move(tool));
  }

  std::size_t add_load(Load load) {
    for (std::size_t k = 0; k < loads_.size(); ++k) {
      if (loads_[k].name == load.name && loads_[k].why_not == load.why_not) return k;
    }
    loads_.push_back(std::move(load));
    return loads_.size() - 1;
  }

  /// `$LOAD = ...`
  std::size_t load_set(const std::vector<Value>& operands, std::size_t f, std::size_t k) {
    Load load{fmt::format("$LOAD ({})", names_.place(f, k)), std::nullopt, "", ""};
    const Assigned here{f, k, operands};
    const Assigned* value = &here;
    if (operands.size() == 1 && operands[0].kind == Value::Kind::kName) {
      load.name = operands[0].name;
      if (names_.find(root_of(load.name), f) == nullptr) {
        load.note = fmt::format("load {} is not in the files: it is not compared with the cell's", shown(load.name));
        return add_load(std::move(load));
      }
      const Told<const Assigned*> assigned = names_.value_of(load.name, f);
      if (assigned) value = *assigned;
      if (!assigned) load.why_not = "$LOAD: " + assigned.error();
    }
    if (load.why_not.empty()) load.load = load_of(value->operands);
    if (load.load) load.note = note_on_default(load.load, *value);
    if (load.why_not.empty() && !load.load)
      load.why_not = fmt::format("$LOAD is not constant ({})", names_.place(f, k));
    return add_load(std::move(load));
  }

  /// The tool as a motion has it.
  std::size_t tool_carrying(std::size_t tool, std::size_t index) {
    const Load& load = loads_[index];
    const std::optional<StatedLoad>& own = program_.tools[tool].load;
    const bool same = own && load.load && own->mass == load.load->mass && own->p_F == load.load->p_F;
    if (index == 0 || same) return tool;
    ProgramTool carrying = program_.tools[tool];
    carrying.carries = load.name;
    carrying.load = load.load;
    carrying.load_note = load.note;
    if (carrying.why_not.empty()) carrying.why_not = load.why_not;
    return add_tool(std::move(carrying));
  }

  std::size_t base_numbered(int number, std::size_t f) {
    if (number == 0) return 1;
    const std::string data = fmt::format("BASE_DATA[{}]", number);
    if (const std::string why = carried(number, f); !why.empty()) return add_frame({data, Pose::Identity(), why});
    Value name;
    name.kind = Value::Kind::kName;
    name.name = data;
    return base_set({name}, f);
  }

  /// Why a base moves: `MACH_DEF_INDEX[2]=3` hangs it on a unit of the controller; empty: it does not.
  [[nodiscard]] std::string carried(int number, std::size_t f) const {
    const Variable* unit = names_.find(fmt::format("MACH_DEF_INDEX[{}]", number), f);
    if (unit == nullptr || unit->values.empty() || unit->values[0].operands.size() != 1) return "";
    const Assigned& at = unit->values[0];
    if (at.operands[0].kind == Value::Kind::kNumber && (at.operands[0].number <= 0 || carries_nothing(at, f)))
      return "";
    return fmt::format("external kinematics carry base {} (MACH_DEF_INDEX, {})", number,
                       names_.place(at.file, at.line));
  }

  /// `MACHINE_DEF[3]={NAME[] "",...,MECH_TYPE #NONE}`: there is no such unit.
  [[nodiscard]] bool carries_nothing(const Assigned& index, std::size_t f) const {
    const Told<const Assigned*> unit = names_.value_of(fmt::format("MACHINE_DEF[{:g}]", index.operands[0].number), f);
    const Value* type = unit && (*unit)->operands.size() == 1 ? (*unit)->operands[0].field("MECH_TYPE") : nullptr;
    return type != nullptr && upper(program_.files[(*unit)->file].text.substr(type->begin, 5)) == "#NONE";
  }

  /// `$BASE = ...`
  std::size_t base_set(const std::vector<Value>& operands, std::size_t f) {
    ProgramFrame frame;
    frame.name = operands.size() == 1 && operands[0].kind == Value::Kind::kName ? operands[0].name : "$BASE";
    const bool numbered = frame.name.starts_with("BASE_DATA[") && frame.name.find('*') == std::string::npos;
    Told<Pose> X_WO = names_.frame_of(operands, f);
    if (numbered && take_row(frame.name, options_, frame)) {
      // Rows are seen from the robot's base.
      if (X_WO) X_WO = names_.robroot().inverse() * *X_WO;
      if (const Told<const Assigned*> value = names_.value_of(frame.name, f))
        frame.why_not = against_row(frame.name, frame.X_BO, X_WO, **value);
      else if (names_.is_set(frame.name, f))
        frame.why_not = fmt::format("base {}: {}", shown(frame.name), value.error());
      return add_frame(std::move(frame));
    }
    if (X_WO) frame.X_BO = *X_WO;
    if (!X_WO) frame.why_not = fmt::format("base {}: {}", shown(frame.name), X_WO.error());
    return add_frame(std::move(frame));
  }

  /// FDAT of an inline form: `{TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE,...}`
  void apply_fdat(const std::string& name, std::size_t f, State& state) {
    const Told<const Assigned*> assigned = names_.value_of(name, f);
    const Value* tool =
        assigned && (*assigned)->operands.size() == 1 ? (*assigned)->operands[0].field("TOOL_NO") : nullptr;
    const Value* base = tool == nullptr ? nullptr : (*assigned)->operands[0].field("BASE_NO");
    if (tool == nullptr || base == nullptr) {
      const std::string why = assigned ? fmt::format("{} has no tool or base", shown(name)) : assigned.error();
      state.tool = add_tool({name, "", 0, std::nullopt, std::nullopt, 0, why});
      state.frame = add_frame({name, Pose::Identity(), why});
      return;
    }
    state.tool = tool_numbered(static_cast<int>(tool->number), f);
    state.load = 0;
    state.frame = base_numbered(static_cast<int>(base->number), f);
    const Value* frame = (*assigned)->operands[0].field("IPO_FRAME");
    const std::string& text = program_.files[(*assigned)->file].text;
    const bool fixed = frame != nullptr && upper(text.substr(frame->begin, 4)) == "#TCP";
    state.fixed_tool = fixed ? kToolStands : "";
  }

  // Second pass: what happens, in the order of the text.

  void note_calls(const Routine& routine, std::set<std::string>& called) const {
    for (std::size_t k = routine.first; k < routine.last; ++k) {
      const std::vector<Token>& tokens = lines_[routine.file][k].tokens;
      for (const std::size_t r : called_by(tokens)) called.insert(routines_[r].name);
    }
  }

  /// The routines that come in between.
  void find_interrupts(std::set<std::string>& called) {
    for (std::size_t f = 0; f < lines_.size(); ++f) {
      for (const Line& line : lines_[f]) {
        const std::size_t at = done_later(line.tokens);
        const auto routine = at == 0 ? by_name_.end() : by_name_.find(line.tokens[at].text);
        resumes_ |= !line.tokens.empty() && line.tokens[0].text == "RESUME";
        const auto known = [&] { return std::find(interrupts_.begin(), interrupts_.end(), routine->second); };
        if (routine == by_name_.end() || known() != interrupts_.end()) continue;
        called.insert(routine->first);
        interrupts_.push_back(routine->second);
      }
    }
  }
  static std::uint64_t bit_of(std::size_t interrupt) {
    return std::uint64_t{1} << std::min<std::size_t>(interrupt, 63);
  }

  /// What interrupts that are declared make of a state before a line.
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
        join(state, back, fmt::format("the interrupt routine {}", shown(routines_[interrupts_[i]].name)));
        more |= !(state == was);
      }
    }
  }

  static Step step_of(const std::vector<Token>& tokens) {
    using Kind = Step::Kind;
    static const std::map<std::string, Kind> kWords = {
        {"IF", Kind::kIf},         {"ELSE", Kind::kElse},     {"ENDIF", Kind::kEnd},     {"SWITCH", Kind::kSwitch},
        {"CASE", Kind::kCase},     {"DEFAULT", Kind::kElse},  {"ENDSWITCH", Kind::kEnd}, {"LOOP", Kind::kRepeat},
        {"ENDLOOP", Kind::kEnd},   {"WHILE", Kind::kWhile},   {"ENDWHILE", Kind::kEnd},  {"FOR", Kind::kWhile},
        {"ENDFOR", Kind::kEnd},    {"REPEAT", Kind::kRepeat}, {"UNTIL", Kind::kEnd},     {"EXIT", Kind::kExit},
        {"RETURN", Kind::kReturn}, {"RESUME", Kind::kReturn}};
    if (tokens.empty()) return {};
    if (tokens.size() == 2 && tokens[1].text == ":") return {Kind::kLabel, tokens[0].text};
    if (tokens.size() > 1 && tokens[0].text == "GOTO") return {Kind::kJump, tokens[1].text};
    if (tokens.size() > 1 && (tokens[1].text == "=" || tokens[1].text == "[" || tokens[1].text == ".")) return {};
    const auto word = kWords.find(tokens[0].text);
    return word == kWords.end() ? Step{} : Step{word->second};
  }

  /// Before each line of a routine, and at its end.
  std::vector<State> states_in(std::size_t r, const State& begin, int depth) {
    const Routine& routine = routines_[r];
    const auto [order, is_new] = orders_.try_emplace(r);
    if (is_new) {
      std::vector<Step> steps;
      for (std::size_t k = routine.first; k < routine.last; ++k)
        steps.push_back(step_of(lines_[routine.file][k].tokens));
      order->second = flow_of(steps);
      // RESUME ends what was interrupted, wherever it was.
      for (std::vector<std::size_t>& next : order->second.next) {
        if (resumes_) next.push_back(steps.size());
      }
    }
    return states_before(
        order->second, begin,
        [&](std::size_t step, State& state) { set(routine.file, routine.first + step, state, depth); },
        [&](State& state, const State& other, const std::string& by) { join(state, other, by); },
        [&](State& state) { come_in(state, depth); });
  }

  State end_of(std::size_t r, const State& begin, int depth) {
    const auto key = std::tuple(r, begin, inside_interrupt_);
    if (const auto known = ends_.find(key); known != ends_.end()) return known->second;
    ends_[key] = begin;
    return ends_[key] = states_in(r, begin, depth).back();
  }

  /// Its motions, and those of what it calls.
  void run(std::size_t r, const State& begin, int depth) {
    if (!run_.emplace(r, begin, inside_interrupt_).second) return;
    ran_.insert(r);
    const Routine routine = routines_[r];
    const std::vector<State> states = states_in(r, begin, depth);
    for (std::size_t k = routine.first; k < routine.last; ++k) {
      const std::vector<Token>& tokens = lines_[routine.file][k].tokens;
      if (tokens.empty()) continue;
      const State& state = states[k - routine.first];
      if (is_motion(tokens[0].text) || is_relative(tokens[0].text)) motion(routine.file, k, state);
      if (depth >= kDeepest) continue;
      for (const std::size_t called : called_by(tokens)) run(called, state, depth + 1);
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

  /// Procedures and functions, in their order.
  [[nodiscard]] std::vector<std::size_t> called_by(const std::vector<Token>& tokens) const {
    std::vector<std::size_t> called;
    if (done_later(tokens) > 0) return called;
    for (std::size_t at = 0; at + 1 < tokens.size(); ++at) {
      if (tokens[at].kind != TokenKind::kWord || tokens[at + 1].text != "(") continue;
      if (const auto routine = by_name_.find(tokens[at].text); routine != by_name_.end())
        called.push_back(routine->second);
    }
    return called;
  }

  /// Where ways come together, what they set differently is not known.
  void join(State& state, const State& other, const std::string& by) {
    const std::string why = by.empty() ? "a branch or a loop of the program decides it" : by + " may change it";
    if (state.tool != other.tool && program_.tools[state.tool].why_not.empty())
      state.tool = add_tool({"$TOOL", "", 0, std::nullopt, std::nullopt, 0, "$TOOL: " + why});
    if (state.frame != other.frame && program_.frames[state.frame].why_not.empty())
      state.frame = add_frame({"$BASE", Pose::Identity(), "$BASE: " + why});
    if (state.load != other.load && loads_[state.load].why_not.empty())
      state.load = add_load({"$LOAD", std::nullopt, "", "$LOAD: " + why});
    if (state.fixed_tool != other.fixed_tool && state.fixed_tool.empty()) state.fixed_tool = why;
    if (state.sensed.empty()) state.sensed = other.sensed;
    state.armed |= other.armed;
    state.speed = std::max(state.speed, other.speed);
  }

  /// What a line sets.
  void set(std::size_t f, std::size_t k, State& state, int depth) {
    const std::vector<Token>& tokens = lines_[f][k].tokens;
    if (tokens.empty()) return;
    const std::string& word = tokens[0].text;
    const bool assigns = tokens.size() > 2 && tokens[1].text == "=";
    std::size_t end = 0;
    set_sensor(tokens, f, k, state);
    sets_by_hand_ |= word == "$TOOL" || word == "$BASE";
    if (word == "$TOOL" && assigns) {
      state.tool = tool_set(krl::operands_at(tokens, 2, &end), f, k);
    } else if (word == "$BASE" && assigns) {
      state.frame = base_set(krl::operands_at(tokens, 2, &end), f);
    } else if (word == "$LOAD" && tokens.size() > 1) {
      state.load =
          assigns
              ? load_set(krl::operands_at(tokens, 2, &end), f, k)
              : add_load({"$LOAD", std::nullopt, "", fmt::format("a part of $LOAD is set ({})", names_.place(f, k))});
    } else if ((word == "$TOOL" || word == "$BASE") && tokens.size() > 1) {
      const std::string why = fmt::format("a part of {} is set ({})", word, names_.place(f, k));
      if (word == "$TOOL") state.tool = add_tool({"$TOOL", "", 0, std::nullopt, std::nullopt, 0, why});
      if (word == "$BASE") state.frame = add_frame({"$BASE", Pose::Identity(), why});
    } else if (word == "$IPO_MODE" && assigns) {
      state.fixed_tool = why_fixed(tokens, 2);
    } else if (word == "FDAT_ACT" && assigns && tokens[2].kind == TokenKind::kWord) {
      apply_fdat(tokens[2].text, f, state);
    } else if (word == "FDAT_ACT" && tokens.size() > 1) {
      const std::string why = fmt::format("FDAT_ACT is set by itself ({})", names_.place(f, k));
      state.tool = add_tool({"$TOOL", "", 0, std::nullopt, std::nullopt, 0, "$TOOL: " + why});
      state.frame = add_frame({"$BASE", Pose::Identity(), "$BASE: " + why});
    } else if (word == "BAS" && tokens.size() >= 6 && tokens[2].text == "#") {
      set_by_bas(tokens, f, k, state);
    } else if (word == "$VEL") {
      state.speed = speed_at(tokens, 0);
    } else if (const std::size_t later = done_later(tokens); later > 0) {
      for (std::size_t i = 0; i < interrupts_.size(); ++i) {
        if (routines_[interrupts_[i]].name == tokens[later].text) state.armed |= bit_of(i);
      }
    }
    if (depth >= kDeepest) return;
    for (const std::size_t called : called_by(tokens)) state = end_of(called, state, depth + 1);
  }

  /// `ret=RSI_ON(#RELATIVE)`, `RSI_OFF()`; `ST_ON1( )` of older ones.
  void set_sensor(const std::vector<Token>& tokens, std::size_t f, std::size_t k, State& state) const {
    static const std::set<std::string> kBegins = {"RSI_ON", "ST_ON", "ST_ON1"},
                                       kEnds = {"RSI_OFF", "ST_OFF", "ST_OFF1"};
    for (std::size_t at = 0; at + 1 < tokens.size(); ++at) {
      if (tokens[at + 1].text != "(" || declares(tokens)) continue;
      if (kBegins.contains(tokens[at].text))
        state.sensed = fmt::format("a sensor corrects the path ({}, {})", tokens[at].text, names_.place(f, k));
      if (kEnds.contains(tokens[at].text)) state.sensed.clear();
    }
  }

  /// `$VEL.CP=0.25`, `$VEL={CP 0.25,...}`, `$VEL=SVEL_CP(0.25, , LCPDAT1)`, m/s.
  static double speed_at(const std::vector<Token>& tokens, std::size_t at) {
    const auto is = [&](std::size_t ahead, std::string_view text) {
      return at + ahead < tokens.size() && tokens[at + ahead].text == text;
    };
    std::size_t number = 0;
    if (is(1, ".") && is(2, "CP") && is(3, "=")) number = at + 4;
    if (is(1, "=") && is(2, "SVEL_CP") && is(3, "(")) number = at + 4;
    if (is(1, "=") && is(2, "{")) {
      number = at + 3;
      while (number < tokens.size() && tokens[number].text != "CP" && tokens[number].text != "}") ++number;
      ++number;
    }
    return number == 0 ? kSpeedUnknown : speed_of(tokens, number);
  }
  static double speed_of(const std::vector<Token>& tokens, std::size_t at) {
    if (at >= tokens.size() || tokens[at].kind != TokenKind::kNumber) return kSpeedUnknown;
    const auto number = read_number(tokens[at].text);
    return number && number->value > 0 ? to_mm(number->value) : kSpeedUnknown;
  }

  /// `BAS(#TOOL,1)`, `BAS(#BASE,2)`
  void set_by_bas(const std::vector<Token>& tokens, std::size_t f, std::size_t k, State& state) {
    const bool constant = tokens[5].kind == TokenKind::kNumber;
    const int number = constant ? std::atoi(tokens[5].text.c_str()) : 0;
    const std::string why = fmt::format("{} chooses it ({})", shown(tokens[5].text), names_.place(f, k));
    if (tokens[3].text == "TOOL" || tokens[3].text == "EX_TOOL") {
      state.load = 0;
      state.tool = constant ? tool_numbered(number, f)
                            : add_tool({"$TOOL", "", 0, std::nullopt, std::nullopt, 0, "$TOOL: " + why});
    } else if (tokens[3].text == "CP_PARAMS" || tokens[3].text == "VEL_CP") {
      state.speed = speed_of(tokens, 5);
    } else if (tokens[3].text == "INITMOV") {
      const std::string may = fmt::format("BAS(#INITMOV) sets it to its default ({})", names_.place(f, k));
      state.speed = kSpeedUnknown;
      state.load = 0;
      state.tool = add_tool({"$TOOL", "", 0, std::nullopt, std::nullopt, 0, "$TOOL: " + may});
      state.frame = add_frame({"$BASE", Pose::Identity(), "$BASE: " + may});
    } else if (tokens[3].text == "EX_BASE") {
      state.frame = add_frame({"$BASE", Pose::Identity(), carried_at(f, k)});
    } else if (tokens[3].text == "BASE") {
      state.frame = constant ? base_numbered(number, f) : add_frame({"$BASE", Pose::Identity(), "$BASE: " + why});
    }
  }

  /// `#BASE` or `#TCP`, from a token on.
  static std::string why_fixed(const std::vector<Token>& tokens, std::size_t at) {
    const std::string word = at + 1 < tokens.size() && tokens[at].text == "#" ? tokens[at + 1].text : "";
    return word == "BASE" ? "" : word == "TCP" ? kToolStands : "$IPO_MODE is not constant";
  }

  [[nodiscard]] std::string carried_at(std::size_t f, std::size_t k) const {
    return fmt::format("external kinematics carry the base ({})", names_.place(f, k));
  }

  /// `WITH $TOOL = STOOL2(FP1), $BASE = SBASE(FP1.BASE_NO)`: for this motion, or for those of a spline, alone.
  void apply_with(std::size_t f, std::size_t k, State& state) {
    const std::vector<Token>& tokens = lines_[f][k].tokens;
    std::size_t at = 0;
    while (at < tokens.size() && tokens[at].text != "WITH") ++at;
    for (++at; at + 2 < tokens.size(); ++at) {
      if (tokens[at - 1].text != "WITH" && tokens[at - 1].text != ",") continue;
      const std::string& name = tokens[at].text;
      if (name == "$VEL") state.speed = speed_at(tokens, at);
      if (name == "$TOOL" || name == "$BASE" || name == "$LOAD" || name == "$IPO_MODE")
        set_with(f, k, at, tokens[at + 1].text == "=", state);
    }
  }

  /// One of them; `at` is its name.
  void set_with(std::size_t f, std::size_t k, std::size_t at, bool assigns, State& state) {
    const std::vector<Token>& tokens = lines_[f][k].tokens;
    static const std::set<std::string> kOfFdat = {"STOOL2", "STOOL", "SBASE", "SIPO_MODE", "SLOAD"};
    const std::string& name = tokens[at].text;
    const bool calls = at + 4 < tokens.size() && tokens[at + 3].text == "(";
    const bool by_fdat = calls && kOfFdat.contains(tokens[at + 2].text) && tokens[at + 4].kind == TokenKind::kWord;
    State one = state;
    if (by_fdat) apply_fdat(tokens[at + 4].text, f, one);
    std::size_t end = 0;
    const auto operands = [&] { return krl::operands_at(tokens, at + 2, &end); };
    const std::string part = fmt::format("a part of {} is set ({})", name, names_.place(f, k));
    if (name == "$TOOL") {
      state.tool = by_fdat   ? one.tool
                   : assigns ? tool_set(operands(), f, k)
                             : add_tool({"$TOOL", "", 0, std::nullopt, std::nullopt, 0, part});
      if (by_fdat) state.load = 0;
    } else if (name == "$BASE") {
      state.frame = by_fdat                                ? one.frame
                    : calls && tokens[at + 2].text == "EK" ? add_frame({"$BASE", Pose::Identity(), carried_at(f, k)})
                    : assigns                              ? base_set(operands(), f)
                                                           : add_frame({"$BASE", Pose::Identity(), part});
    } else if (name == "$LOAD") {
      state.load = by_fdat ? 0 : assigns ? load_set(operands(), f, k) : add_load({"$LOAD", std::nullopt, "", part});
    } else if (by_fdat) {
      state.fixed_tool = one.fixed_tool;
    } else {
      state.fixed_tool = why_fixed(tokens, at + (calls ? 4 : 2));
    }
  }

  void leave(std::size_t f, std::size_t k, const std::string& name, const std::string& why) {
    const Line& line = lines_[f][k];
    program_.moves[move_at(f, k)].left_some = true;
    if (left_.emplace(f, line.number, name).second)
      program_.left.push_back({name, f, line.number, line.tokens[0].text, why});
  }

  std::size_t move_at(std::size_t f, std::size_t k) {
    const auto [entry, is_new] = moves_.emplace(std::pair(f, k), program_.moves.size());
    if (is_new) program_.moves.push_back({f, lines_[f][k].number, {}, false});
    return entry->second;
  }

  void motion(std::size_t f, std::size_t k, State state) {
    const std::vector<Token>& tokens = lines_[f][k].tokens;
    const std::string& word = tokens[0].text;
    if (stands_still(tokens)) return;
    const std::size_t move = move_at(f, k);
    program_.moves[move].is_arc = word == "CIRC" || word == "SCIRC";
    if (is_relative(word)) return leave(f, k, text_of(f, tokens, 1), "it is relative to where the robot is");
    if (const auto head = spline_heads_.find({f, k}); head != spline_heads_.end()) apply_with(f, head->second, state);
    apply_with(f, k, state);
    if (state.speed > program_.moves[move].speed_mm_s.value_or(0) && !is_by_axes(word))
      program_.moves[move].speed_mm_s = state.speed;
    state.tool = tool_carrying(state.tool, state.load);
    std::size_t next = 1;
    const int count = word == "CIRC" || word == "SCIRC" ? 2 : 1;
    for (int target = 0; target < count; ++target) {
      const std::vector<Value> operands = krl::operands_at(tokens, next, &next);
      if (operands.empty()) return leave(f, k, "", "it has no target");
      use(f, k, operands, state, move);
      if (next >= tokens.size() || tokens[next].text != ",") break;
      ++next;
    }
    if (count == 2 && next < tokens.size() && tokens[next].text == "CA") by_angle_.insert({f, lines_[f][k].number});
  }

  /// `CIRC XP1,XP2,CA 360`: the circle through the points is corrected, and the arc ends elsewhere on it.
  void note_angles() {
    if (by_angle_.empty()) return;
    const auto& [f, line] = *by_angle_.begin();
    const std::string more = by_angle_.size() > 1 ? fmt::format(" and {} more", by_angle_.size() - 1) : "";
    program_.notes.push_back(fmt::format(
        "an arc ends by its angle CA and not at its end point ({} line {}{}): the circle through its points "
        "is corrected, and what lies beyond them follows it",
        program_.files[f].name, line, more));
  }

  std::string text_of(std::size_t f, const std::vector<Token>& tokens, std::size_t from) const {
    if (from >= tokens.size()) return "";
    return program_.files[f].text.substr(tokens[from].begin, tokens.back().end - tokens[from].begin);
  }

  void use(std::size_t f, std::size_t k, const std::vector<Value>& operands, const State& state, std::size_t move) {
    const std::string name =
        program_.files[f].text.substr(operands.front().begin, operands.back().end - operands.front().begin);
    if (!state.fixed_tool.empty()) return leave(f, k, name, state.fixed_tool);
    if (!state.sensed.empty()) return leave(f, k, name, state.sensed);
    const SiteUse use{state.tool,
                      state.frame,
                      lines_[f][k].tokens[0].text,
                      f,
                      lines_[f][k].number,
                      move,
                      !is_by_axes(lines_[f][k].tokens[0].text)};
    if (operands.size() > 1 || operands[0].kind == Value::Kind::kAggregate) {
      places_[{f, operands[0].begin}] = {f, k, operands};
      note_axes(operands[0], move);
      return sites_.add(f, operands[0].begin, name, use);
    }
    if (operands[0].kind != Value::Kind::kName) return leave(f, k, name, "an expression decides it");
    const std::string& wanted = operands[0].name;
    if (wanted.starts_with("$")) return leave(f, k, name, fmt::format("{} decides it", shown(wanted)));
    if (wanted.find("[*]") == std::string::npos) {
      const Told<const Assigned*> one = names_.value_of(wanted, f);
      if (one && (*one)->operands.size() == 1) note_axes((*one)->operands[0], move);
      return use_named(f, k, wanted, name, use);
    }
    const std::string beginning = wanted.substr(0, wanted.find("[*]") + 1);
    bool any = false;
    for (const auto& [key, variable] : names_.all()) {
      if (!key.second.starts_with(beginning) || key.second == wanted) continue;
      any = true;
      const Assigned* at = variable.values.empty() ? nullptr : &variable.values[0];
      use_named(f, k, key.second, at == nullptr ? key.second : names_.spelled(key.second, at->file, at->line), use);
    }
    if (!any) leave(f, k, name, "an index chooses it, and its elements are not in the files");
  }

  void note_axes(const Value& value, std::size_t move) {
    if (const Told<std::vector<double>> axes = krl::Variables::numbers_of(value, kAxes)) axes_[move] = *axes;
  }

  void use_named(std::size_t f, std::size_t k, const std::string& wanted, const std::string& name, const SiteUse& use) {
    const Told<const Assigned*> assigned = names_.value_of(wanted, f);
    if (!assigned) return leave(f, k, name, assigned.error());
    const Assigned& at = **assigned;
    if (at.operands.empty()) return leave(f, k, name, "it is not constant");
    places_[{at.file, at.operands[0].begin}] = at;
    sites_.add(at.file, at.operands[0].begin, name, use);
  }

  // Which motions may be the last before each.

  /// Lines, arcs, and motions to positions without a status keep the posture of the motion before.
  void find_order() {
    std::vector<Step> steps;
    std::map<std::size_t, std::pair<std::size_t, std::size_t>> moves;  // file and line, by step
    for (const Routine& routine : routines_) {
      steps.push_back({Step::Kind::kRoutine, std::to_string(&routine - routines_.data())});
      for (std::size_t k = routine.first; k < routine.last; ++k) {
        const std::vector<Token>& tokens = lines_[routine.file][k].tokens;
        for (const std::size_t called : called_by(tokens)) steps.push_back({Step::Kind::kCall, std::to_string(called)});
        const auto move = moves_.find({routine.file, k});
        // A line that is left leaves the posture as it was.
        if (move != moves_.end() && (is_by_axes(tokens[0].text) || !program_.moves[move->second].targets.empty()))
          moves.emplace(steps.size(), std::pair(routine.file, k));
        steps.push_back(step_of(tokens));
      }
      steps.push_back({Step::Kind::kEnd});
    }
    const auto before = motions_before(flow_of(steps), [&](std::size_t step) -> std::optional<std::size_t> {
      const auto move = moves.find(step);
      return move == moves.end() ? std::nullopt : std::optional<std::size_t>(moves_.at(move->second));
    });
    for (const auto& [step, place] : moves) follow(place.first, place.second, before[step]);
    for (const auto& [move, axes] : axes_) program_.moves[move].axes = axes;
  }

  /// Where the program begins, or an interrupt ends what it came in, what a target does not say is taken to be nearest
  /// to zero.
  void follow(std::size_t f, std::size_t k, const std::set<std::size_t>& before) {
    ProgramMove& move = program_.moves[moves_.at({f, k})];
    const bool by_axes = is_by_axes(lines_[f][k].tokens[0].text);
    const bool says = std::any_of(move.targets.begin(), move.targets.end(),
                                  [&](std::size_t t) { return program_.targets[t].configuration.said(); });
    if (resumes_ || before.contains(kNoMotion) || (by_axes && (says || move.targets.empty()))) return;
    move.choice = JointChoice::kOnALine;
    move.before = before;
  }

  // Targets.

  std::string describe(const Site& site, ProgramTarget& target) const {
    const Assigned& place = places_.at({site.file, site.begin});
    target.line = lines_[place.file][place.line].number;
    if (const auto read = read_.find({site.file, site.begin}); read != read_.end()) return read->second;
    const Value& first = place.operands[0];
    if (place.operands.size() == 1 && first.kind == Value::Kind::kAggregate) {
      if (first.field("A1") != nullptr) return describe_axes(first, target);
      const Told<std::vector<double>> numbers = names_.numbers_of(first, kPose);
      if (!numbers) return numbers.error();
      target.coordinates = Coordinates::kAnglesZyx;
      target.numbers = *numbers;
      rewrite(first, kPose, target);
      note_rest(first, target);
      return "";
    }
    const Told<Pose> pose = names_.frame_of(place.operands, place.file);
    if (!pose) return pose.error();
    target.coordinates = Coordinates::kAnglesZyx;
    target.numbers = cam::numbers_of(Coordinates::kAnglesZyx, *pose, std::vector<double>(6, 0.0));
    const Value* last = &place.operands.back();
    if (last->kind == Value::Kind::kName) {
      const Told<const Assigned*> named = names_.value_of(last->name, place.file);
      last = named && (*named)->operands.size() == 1 ? &(*named)->operands[0] : nullptr;
    }
    if (last != nullptr) note_rest(*last, target);
    fold(place, last, target);
    return "";
  }

  std::string describe_axes(const Value& value, ProgramTarget& target) const {
    if (options_.keep_joints) return "joint targets are kept (--keep-joints)";
    const Told<std::vector<double>> numbers = names_.numbers_of(value, kAxes);
    if (!numbers) return numbers.error();
    target.coordinates = Coordinates::kJoints;
    target.numbers = *numbers;
    rewrite(value, kAxes, target);
    note_rest(value, target);
    return "";
  }

  void rewrite(const Value& value, const std::array<const char*, 6>& fields, ProgramTarget& target) const {
    const std::string& text = program_.files[target.file].text;
    for (std::size_t k = 0; k < fields.size(); ++k) {
      const Value& number = *value.field(fields[k]);
      const auto written = read_number(std::string_view(text).substr(number.begin, number.end - number.begin));
      target.rewrites.push_back({{number.begin, number.end}, {}, {{k, written ? written->style : kThreeDecimals}}});
    }
  }

  /// The whole expression as one frame, with status, turns and external axes of its last operand.
  void fold(const Assigned& place, const Value* last, ProgramTarget& target) const {
    const std::string& text = program_.files[place.file].text;
    target.folded = true;
    Rewrite whole{{place.operands.front().begin, place.operands.back().end}, {"{X "}, {}};
    for (std::size_t k = 0; k < kPose.size(); ++k) {
      whole.slots.push_back({k, kThreeDecimals});
      whole.texts.push_back(k + 1 < kPose.size() ? fmt::format(",{} ", kPose[k + 1]) : "");
    }
    if (last != nullptr && last->kind == Value::Kind::kAggregate) {
      for (std::size_t k = 0; k < last->field_names.size(); ++k) {
        const std::string& name = last->field_names[k];
        if (name == "S" || name == "T" || (name.size() == 2 && name[0] == 'E'))
          whole.texts.back() += fmt::format(",{} {}", name, last->field_values[k].number);
      }
    }
    whole.texts.back() += "}";
    target.comment_at = lines_[place.file][place.line].begin;
    const std::size_t indent = text.find_first_not_of(" \t", target.comment_at);
    target.comment = text.substr(target.comment_at, indent - target.comment_at) + "; trammel: was " +
                     text.substr(whole.span.begin, whole.span.end - whole.span.begin);
    target.rewrites.push_back(std::move(whole));
  }

  /// Status, turns and external axes.
  static void note_rest(const Value& value, ProgramTarget& target) {
    const auto number = [&](const char* name) -> std::optional<double> {
      const Value* field = value.field(name);
      const bool known = field != nullptr && (field->kind == Value::Kind::kNumber || field->kind == Value::Kind::kBits);
      return known ? std::optional<double>(field->number) : std::nullopt;
    };
    for (int k = 0; k < 6; ++k) {
      if (const auto axis = number(fmt::format("E{}", k + 1).c_str())) target.external[k] = *axis;
    }
    if (target.coordinates == Coordinates::kJoints) return;
    Configuration& said = target.configuration;
    if (const auto status = number("S"); status && *status >= 0) {
      const auto bits = static_cast<unsigned>(*status);
      said.behind_axis_1 = (bits & 1U) != 0;
      said.larger_joint_3 = (bits & 2U) != 0;
      said.signs.resize(6);
      said.signs[4] = (bits & 4U) != 0 ? -1 : 1;
    }
    if (const auto turns = number("T"); turns && *turns >= 0) {
      const auto bits = static_cast<unsigned>(*turns);
      said.signs.resize(6);
      for (std::size_t j = 0; j < 6; ++j) said.signs[j] = ((bits >> j) & 1U) != 0 ? -1 : 1;
    }
  }

  /// What else reads the targets that are written anew.
  void note_readings(std::size_t f) {
    if (targets_.empty()) {
      for (const auto& [key, variable] : names_.all()) {
        if (variable.values.size() != 1 || variable.values[0].operands.empty()) continue;
        const Assigned& at = variable.values[0];
        if (!places_.contains({at.file, at.operands[0].begin})) continue;
        targets_.emplace(key.second, &at);
        words_of_targets_.insert(key.second.substr(0, key.second.find('[')));
      }
    }
    for (std::size_t k = 0; k < lines_[f].size(); ++k) {
      const std::vector<Token>& tokens = lines_[f][k].tokens;
      for (std::size_t at = 0; at < tokens.size(); ++at) {
        if (tokens[at].kind == TokenKind::kWord && words_of_targets_.contains(tokens[at].text)) note_reading(f, k, at);
      }
    }
  }

  void note_reading(std::size_t f, std::size_t k, std::size_t at) {
    const std::vector<Token>& tokens = lines_[f][k].tokens;
    std::size_t end = at;
    const std::vector<Value> one = krl::operands_at(tokens, at, &end);
    if (one.empty() || one[0].name.empty()) return;
    const std::string root = root_of(one[0].name);
    const bool number = root != one[0].name;
    const bool moves = is_motion(tokens[0].text) || is_relative(tokens[0].text);
    const bool plain = one.size() == 1 && tokens[at > 0 ? at - 1 : 0].text != ":";
    if (moves && !number && plain) return;  // the motion goes to it
    const auto own = names_.all().find({stem_of(program_.files[f].name), root});
    if (own != names_.all().end()) {
      if (own->second.values.size() == 1) add_reading(f, k, at, number, own->second.values[0]);
    } else if (const auto other = targets_.find(root); other != targets_.end()) {
      add_reading(f, k, at, number, *other->second);
    } else if (root.ends_with("[*]")) {
      const std::string beginning = root.substr(0, root.size() - 2);
      for (auto any = targets_.lower_bound(beginning); any != targets_.end() && any->first.starts_with(beginning);
           ++any)
        add_reading(f, k, at, number, *any->second);
    }
  }

  void add_reading(std::size_t f, std::size_t k, std::size_t at, bool number, const Assigned& source) {
    if (source.operands.empty() || (source.file == f && source.line == k)) return;
    const auto where = std::pair(source.file, source.operands[0].begin);
    if (!places_.contains(where)) return;
    const std::vector<Token>& tokens = lines_[f][k].tokens;
    const bool moves = is_motion(tokens[0].text) || is_relative(tokens[0].text);
    const std::string& text = program_.files[f].text;
    static const std::set<std::string> kConditions = {"IF", "WHILE", "UNTIL", "SWITCH", "CASE", "FOR", "WAIT"};
    std::string by;
    for (std::size_t k2 = 1; k2 < at && !moves && !kConditions.contains(tokens[0].text); ++k2) {
      if (tokens[k2].text != "=" || tokens[k2 - 1].kind != TokenKind::kWord) continue;
      by = text.substr(tokens[k2 - 1].begin, tokens[k2 - 1].end - tokens[k2 - 1].begin);
    }
    if (number && !moves) {
      read_.emplace(where, fmt::format("its numbers are read elsewhere too ({})", names_.place(f, k)));
      return;
    }
    const Line& line = lines_[f][k];
    program_.readings.push_back({source.file,
                                 {source.operands.front().begin, source.operands.back().end},
                                 text.substr(tokens[at].begin, tokens[at].end - tokens[at].begin),
                                 f,
                                 line.number,
                                 by,
                                 moves});
  }

  /// Positions of data lists that nothing moves to.
  void list_unused() {
    for (const auto& one : names_.all()) {
      const auto& [key, variable] = one;
      const std::string& name = key.second;
      const bool is_position = variable.values.size() == 1 && variable.values[0].operands.size() == 1 &&
                               variable.values[0].operands[0].field("X") != nullptr &&
                               variable.values[0].operands[0].field("S") != nullptr;
      if (!is_position) continue;
      const Assigned& at = variable.values[0];
      const bool listed = std::any_of(program_.left.begin(), program_.left.end(),
                                      [&](const LeftAlone& left) { return upper(left.name) == name; });
      if (places_.contains({at.file, at.operands[0].begin}) || listed) continue;
      program_.left.push_back({names_.spelled(name, at.file, at.line), at.file, lines_[at.file][at.line].number, "",
                               "no motion in these files goes to it"});
    }
  }

  ReadOptions options_;
  Program program_;
  std::vector<std::vector<Line>> lines_;
  std::map<std::string, const Assigned*> targets_;  ///< by name, of all files
  std::set<std::string> words_of_targets_;
  std::vector<Routine> routines_;
  krl::Variables names_{program_.files, lines_};
  std::map<std::string, std::string> tool_names_;
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> spline_heads_;  ///< of the lines in a spline block
  std::set<std::string> elsewhere_;  ///< routines that are called and not in the files
  bool sets_by_hand_ = false;        ///< tool or base, for more than one motion
  std::string on_rail_;              ///< where an external axis is said to carry the robot; empty: nowhere
  std::vector<Load> loads_ = std::vector<Load>(1);
  std::map<std::string, std::size_t> by_name_;  ///< routines
  std::map<std::size_t, Flow> orders_;          ///< of the lines of each routine
  std::map<std::tuple<std::size_t, State, bool>, State> ends_;
  std::vector<std::size_t> interrupts_;  ///< routines that come in between
  bool resumes_ = false;                 ///< an interrupt may end what it came in
  bool inside_interrupt_ = false;
  std::set<std::tuple<std::size_t, State, bool>> run_;
  std::set<std::size_t> ran_;
  std::map<std::pair<std::size_t, std::size_t>, std::string> read_;  ///< why the numbers at a place must stay
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> moves_;
  std::map<std::pair<std::size_t, std::size_t>, Assigned> places_;
  std::set<std::tuple<std::size_t, int, std::string>> left_;
  std::set<std::pair<std::size_t, int>> by_angle_;   ///< arcs, by file and line
  std::map<std::size_t, std::vector<double>> axes_;  ///< deg, that motions command
  Sites sites_;
};

}  // namespace

Program read_krl(std::vector<SourceFile> files, const ReadOptions& options) {
  return Reader(std::move(files), options).read();
}

}  // namespace trammel::cam
