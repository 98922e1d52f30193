#include "clients/cam/krl/state.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <set>

#include "clients/cam/keep.h"
#include "server/base/plain_text.h"

namespace trammel::cam::krl {

namespace {

constexpr const char* kToolStands = "the tool stands and the robot holds the work piece";

/// Why the robot does not hold the tool; empty: it does.
std::string why_fixed(std::string_view ipo_mode) {
  return ipo_mode == "BASE" ? "" : ipo_mode == "TCP" ? kToolStands : "$IPO_MODE is not constant";
}

}  // namespace

void Settings::set(std::size_t f, std::size_t k, State& state) {
  const Tokens& tokens = lines_[f][k].tokens;
  if (tokens.empty()) return;
  set_sensor(tokens, f, k, state);
  set_soft(tokens, f, k, state);
  set_unit(tokens, f, k, state);
  sets_by_hand_ |= tokens[0].is("$TOOL") || tokens[0].is("$BASE");
  if (const auto setting = setting_of(tokens)) {
    if (setting->whole)
      apply(*setting, f, k, state);
    else
      apply_part(*setting, names_.place(f, k), state);
  }
  if (const auto bas = bas_of(tokens)) apply_bas(*bas, f, k, state);
}

void Settings::apply(const Setting& setting, std::size_t f, std::size_t k, State& state) {
  if (setting.name == "$TOOL") state.tool = tools_.tool_set(setting.operands, f, k);
  if (setting.name == "$BASE") set_base(setting, f, k, state);
  if (setting.name == "$LOAD") state.load = tools_.load_set(setting.operands, f, k);
  if (setting.name == "$IPO_MODE")
    state.fixed_tool = why_fixed(setting.function.empty() ? setting.constant : "");
  if (setting.name == "$VEL") state.speed = setting.speed_mm_s.value_or(kSpeedUnknown);
  if (setting.name != "FDAT_ACT") return;
  const Token from = setting.argument;
  if (!setting.function.empty() || from.is_word())
    apply_fdat(std::string(setting.function.empty() ? from.text : setting.function), f, state);
  else
    apply_part(setting, names_.place(f, k), state);
}

/// `$BASE=EK(MACHINE_DEF[2].ROOT,MACHINE_DEF[2].MECH_TYPE,{X 0,...})` follows the unit; what stands
/// for itself does so behind `MACH_DEF_INDEX[17]=2`.
void Settings::set_base(const Setting& setting, std::size_t f, std::size_t k, State& state) {
  if (setting.function == "EK")
    state.frame = tools_.unknown_base(carried_at(f, k));
  else if (!state.carried.empty())
    state.frame = tools_.unknown_base(state.carried);
  else
    state.frame = tools_.base_set(setting.operands, f);
}

/// `MACH_DEF_INDEX[17]=2` in a routine attaches a base to a unit while the program runs; 0 takes it
/// off. BAS( ) and inline forms choose a base of their own, and say themselves which.
void Settings::set_unit(const Tokens& tokens, std::size_t f, std::size_t k, State& state) const {
  static const std::set<std::string_view> kUnits = {"MACH_DEF_INDEX", "MACH_DEF",
                                                    "MACHINE_FRAME_DAT"};
  if (!kUnits.contains(tokens[0].text)) return;
  const std::size_t value = tokens.find("=") + 1;
  if (value >= tokens.size()) return;
  const auto number = tokens[value].is_number() ? number_in(tokens[value]) : std::nullopt;
  const bool none = tokens[value].is("-") || (number && number->value <= 0);
  state.carried = none ? ""
                       : fmt::format("external kinematics carry the base ({}, {})", tokens[0].text,
                                     names_.place(f, k));
}

/// `$TOOL.X=3`
void Settings::apply_part(const Setting& setting, const std::string& place, State& state) {
  const std::string why = fmt::format("a part of {} is set ({})", setting.name, place);
  if (setting.name == "$TOOL") state.tool = tools_.unknown_tool(why);
  if (setting.name == "$BASE") state.frame = tools_.unknown_base(why);
  if (setting.name == "$LOAD") state.load = tools_.unknown_load(why);
  if (setting.name == "$VEL") state.speed = setting.speed_mm_s.value_or(kSpeedUnknown);
  if (setting.name != "FDAT_ACT") return;
  const std::string by_itself = fmt::format(": FDAT_ACT is set by itself ({})", place);
  state.tool = tools_.unknown_tool("$TOOL" + by_itself);
  state.frame = tools_.unknown_base("$BASE" + by_itself);
}

/// Where paths meet, settings that differ between them become unknown.
void Settings::join(State& state, const State& other, const std::string& by) {
  const std::string why =
      by.empty() ? "a branch or a loop of the program decides it" : by + " may change it";
  if (state.tool != other.tool && program_.tools[state.tool].why_not.empty())
    state.tool = tools_.unknown_tool("$TOOL: " + why);
  if (state.frame != other.frame && program_.frames[state.frame].why_not.empty())
    state.frame = tools_.unknown_base("$BASE: " + why);
  if (state.load != other.load && tools_.why_not(state.load).empty())
    state.load = tools_.unknown_load("$LOAD: " + why);
  if (state.fixed_tool != other.fixed_tool && state.fixed_tool.empty()) state.fixed_tool = why;
  if (state.sensed.empty()) state.sensed = other.sensed;
  if (state.soft.empty()) state.soft = other.soft;
  if (state.carried.empty()) state.carried = other.carried;
  state.armed |= other.armed;
  state.speed = std::max(state.speed, other.speed);
}

/// `WITH $TOOL = STOOL2(FP1), $BASE = SBASE(FP1.BASE_NO)`: only for this motion, or for those of a
/// spline.
void Settings::apply_with(std::size_t f, std::size_t k, State& state) {
  for (const Setting& setting : settings_with(lines_[f][k].tokens))
    apply_one_with(setting, f, k, state);
}

/// FDAT of an inline form: `{TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE,...}`
void Settings::apply_fdat(const std::string& name, std::size_t f, State& state) {
  const Told<const Assigned*> assigned = names_.value_of(name, f);
  const Value* tool = assigned && (*assigned)->operands.size() == 1
                          ? (*assigned)->operands[0].field("TOOL_NO")
                          : nullptr;
  const Value* base = tool == nullptr ? nullptr : (*assigned)->operands[0].field("BASE_NO");
  if (tool == nullptr || base == nullptr) {
    const std::string why =
        assigned ? fmt::format("{} has no tool or base", shown(name)) : assigned.error();
    state.tool = tools_.add_tool({name, "", 0, std::nullopt, std::nullopt, 0, why});
    state.frame = tools_.add_frame({name, Pose::Identity(), why});
    return;
  }
  state.tool = tools_.tool_numbered(static_cast<int>(tool->number), f);
  state.load = 0;
  state.frame = tools_.base_numbered(static_cast<int>(base->number), f);
  const Value* frame = (*assigned)->operands[0].field("IPO_FRAME");
  const std::string& text = program_.files[(*assigned)->file].text;
  const bool fixed = frame != nullptr && upper(text.substr(frame->begin, 4)) == "#TCP";
  state.fixed_tool = fixed ? kToolStands : "";
}

/// `ret=RSI_ON(#RELATIVE)`, `RSI_OFF()`; `ST_ON1( )` of older ones.
void Settings::set_sensor(const Tokens& tokens, std::size_t f, std::size_t k, State& state) const {
  static const std::set<std::string_view> kBegins = {"RSI_ON", "ST_ON", "ST_ON1"},
                                          kEnds = {"RSI_OFF", "ST_OFF", "ST_OFF1"};
  if (declares(tokens)) return;
  for (const std::string_view called : called_in(tokens)) {
    if (kBegins.contains(called))
      state.sensed = fmt::format("a sensor corrects the path ({}, {})", called, names_.place(f, k));
    if (kEnds.contains(called)) state.sensed.clear();
  }
}

/// `SET_TORQUE_LIMITS(3, lims)`, `RESET_TORQUE_LIMITS(3)`; `$CURR_RED[3,1]=20` (percent) and
/// `$TORQUE_AXIS=4` (a bit an axis) of older ones: axes with less torque give way.
void Settings::set_soft(const Tokens& tokens, std::size_t f, std::size_t k, State& state) const {
  constexpr double kFullCurrent = 100;
  const auto begins = [&](std::string_view what) {
    state.soft = fmt::format("a force may move the axes, whose torques are limited ({}, {})", what,
                             names_.place(f, k));
  };
  for (const std::string_view called : called_in(tokens)) {
    if (declares(tokens)) break;
    if (called == "SET_TORQUE_LIMITS") begins(called);
    if (called == "RESET_TORQUE_LIMITS") state.soft.clear();
  }
  const std::string_view word = tokens[0].text;
  if (word != "$CURR_RED" && word != "$TORQUE_AXIS") return;
  const std::size_t value = tokens.find("=") + 1;
  if (value >= tokens.size()) return;
  const bool alone = value + 1 == tokens.size() && tokens[value].is_number();
  const auto number = alone ? number_in(tokens[value]) : std::nullopt;
  const double stiff = word == "$CURR_RED" ? kFullCurrent : 0;
  if (number && number->value == stiff)
    state.soft.clear();
  else
    begins(word);
}

/// `BAS(#TOOL,1)`, `BAS(#BASE,2)`
void Settings::apply_bas(const Bas& bas, std::size_t f, std::size_t k, State& state) {
  const bool constant = bas.to.is_number();
  const int number = constant ? std::atoi(std::string(bas.to.text).c_str()) : 0;
  const std::string why = fmt::format("{} chooses it ({})", shown(bas.to.text), names_.place(f, k));
  if (bas.sets == "TOOL" || bas.sets == "EX_TOOL") {
    state.load = 0;
    state.tool = constant ? tools_.tool_numbered(number, f) : tools_.unknown_tool("$TOOL: " + why);
  } else if (bas.sets == "CP_PARAMS" || bas.sets == "VEL_CP") {
    state.speed = bas.speed_mm_s.value_or(kSpeedUnknown);
  } else if (bas.sets == "INITMOV") {
    const std::string may =
        fmt::format(": BAS(#INITMOV) sets it to its default ({})", names_.place(f, k));
    state.speed = kSpeedUnknown;
    state.load = 0;
    state.tool = tools_.unknown_tool("$TOOL" + may);
    state.frame = tools_.unknown_base("$BASE" + may);
  } else if (bas.sets == "EX_BASE") {
    state.frame = tools_.unknown_base(carried_at(f, k));
  } else if (bas.sets == "BASE") {
    state.frame = constant ? tools_.base_numbered(number, f) : tools_.unknown_base("$BASE: " + why);
  }
}

std::string Settings::carried_at(std::size_t f, std::size_t k) const {
  return fmt::format("external kinematics carry the base ({})", names_.place(f, k));
}

void Settings::apply_one_with(const Setting& setting, std::size_t f, std::size_t k, State& state) {
  static const std::set<std::string_view> kOfFdat = {"STOOL2", "STOOL", "SBASE", "SIPO_MODE",
                                                     "SLOAD"};
  if (kOfFdat.contains(setting.function) && setting.argument.is_word()) {
    State by_fdat = state;
    apply_fdat(std::string(setting.argument.text), f, by_fdat);
    if (setting.name == "$TOOL") state.tool = by_fdat.tool;
    if (setting.name == "$TOOL" || setting.name == "$LOAD") state.load = 0;
    if (setting.name == "$BASE") state.frame = by_fdat.frame;
    if (setting.name == "$IPO_MODE") state.fixed_tool = by_fdat.fixed_tool;
    if (setting.name == "$VEL") state.speed = kSpeedUnknown;
  } else if (setting.name == "$IPO_MODE") {
    state.fixed_tool = why_fixed(setting.constant);
  } else if (setting.whole) {
    apply(setting, f, k, state);
  } else {
    apply_part(setting, names_.place(f, k), state);
  }
}

}  // namespace trammel::cam::krl
