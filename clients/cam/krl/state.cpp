#include "clients/cam/krl/state.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <set>

#include "clients/cam/number_text.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"

namespace trammel::cam::krl {

namespace {

constexpr const char* kToolStands = "the tool stands and the robot holds the work piece";

}  // namespace

/// What a line sets.
void Setting::set(std::size_t f, std::size_t k, State& state) {
  const std::vector<Token>& tokens = lines_[f][k].tokens;
  if (tokens.empty()) return;
  const std::string& word = tokens[0].text;
  const bool assigns = tokens.size() > 2 && tokens[1].text == "=";
  std::size_t end = 0;
  set_sensor(tokens, f, k, state);
  set_soft(tokens, f, k, state);
  sets_by_hand_ |= word == "$TOOL" || word == "$BASE";
  if (word == "$TOOL" && assigns) {
    state.tool = tools_.tool_set(operands_at(tokens, 2, &end), f, k);
  } else if (word == "$BASE" && assigns) {
    state.frame = tools_.base_set(operands_at(tokens, 2, &end), f);
  } else if (word == "$LOAD" && tokens.size() > 1) {
    state.load =
        assigns ? tools_.load_set(operands_at(tokens, 2, &end), f, k)
                : tools_.add_load({"$LOAD", std::nullopt, "",
                                   fmt::format("a part of $LOAD is set ({})", names_.place(f, k))});
  } else if ((word == "$TOOL" || word == "$BASE") && tokens.size() > 1) {
    const std::string why = fmt::format("a part of {} is set ({})", word, names_.place(f, k));
    if (word == "$TOOL")
      state.tool = tools_.add_tool({"$TOOL", "", 0, std::nullopt, std::nullopt, 0, why});
    if (word == "$BASE") state.frame = tools_.add_frame({"$BASE", Pose::Identity(), why});
  } else if (word == "$IPO_MODE" && assigns) {
    state.fixed_tool = why_fixed(tokens, 2);
  } else if (word == "FDAT_ACT" && assigns && tokens[2].kind == TokenKind::kWord) {
    apply_fdat(tokens[2].text, f, state);
  } else if (word == "FDAT_ACT" && tokens.size() > 1) {
    const std::string why = fmt::format("FDAT_ACT is set by itself ({})", names_.place(f, k));
    state.tool = tools_.add_tool({"$TOOL", "", 0, std::nullopt, std::nullopt, 0, "$TOOL: " + why});
    state.frame = tools_.add_frame({"$BASE", Pose::Identity(), "$BASE: " + why});
  } else if (word == "BAS" && tokens.size() >= 6 && tokens[2].text == "#") {
    set_by_bas(tokens, f, k, state);
  } else if (word == "$VEL") {
    state.speed = speed_at(tokens, 0);
  }
}

/// Where ways come together, what they set differently is not known.
void Setting::join(State& state, const State& other, const std::string& by) {
  const std::string why =
      by.empty() ? "a branch or a loop of the program decides it" : by + " may change it";
  if (state.tool != other.tool && program_.tools[state.tool].why_not.empty())
    state.tool = tools_.add_tool({"$TOOL", "", 0, std::nullopt, std::nullopt, 0, "$TOOL: " + why});
  if (state.frame != other.frame && program_.frames[state.frame].why_not.empty())
    state.frame = tools_.add_frame({"$BASE", Pose::Identity(), "$BASE: " + why});
  if (state.load != other.load && tools_.why_not(state.load).empty())
    state.load = tools_.add_load({"$LOAD", std::nullopt, "", "$LOAD: " + why});
  if (state.fixed_tool != other.fixed_tool && state.fixed_tool.empty()) state.fixed_tool = why;
  if (state.sensed.empty()) state.sensed = other.sensed;
  if (state.soft.empty()) state.soft = other.soft;
  state.armed |= other.armed;
  state.speed = std::max(state.speed, other.speed);
}

/// `WITH $TOOL = STOOL2(FP1), $BASE = SBASE(FP1.BASE_NO)`: for this motion, or for those of a
/// spline, alone.
void Setting::apply_with(std::size_t f, std::size_t k, State& state) {
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

/// FDAT of an inline form: `{TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE,...}`
void Setting::apply_fdat(const std::string& name, std::size_t f, State& state) {
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
void Setting::set_sensor(const std::vector<Token>& tokens, std::size_t f, std::size_t k,
                         State& state) const {
  static const std::set<std::string> kBegins = {"RSI_ON", "ST_ON", "ST_ON1"},
                                     kEnds = {"RSI_OFF", "ST_OFF", "ST_OFF1"};
  for (std::size_t at = 0; at + 1 < tokens.size(); ++at) {
    if (tokens[at + 1].text != "(" || declares(tokens)) continue;
    if (kBegins.contains(tokens[at].text))
      state.sensed =
          fmt::format("a sensor corrects the path ({}, {})", tokens[at].text, names_.place(f, k));
    if (kEnds.contains(tokens[at].text)) state.sensed.clear();
  }
}

/// `SET_TORQUE_LIMITS(3, lims)`, `RESET_TORQUE_LIMITS(3)`; `$CURR_RED[3,1]=20` (percent) and
/// `$TORQUE_AXIS=4` (a bit an axis) of older ones: axes with less torque give way.
void Setting::set_soft(const std::vector<Token>& tokens, std::size_t f, std::size_t k,
                       State& state) const {
  constexpr double kFullCurrent = 100;
  const auto begins = [&](const std::string& what) {
    state.soft = fmt::format("a force may move the axes, whose torques are limited ({}, {})", what,
                             names_.place(f, k));
  };
  for (std::size_t at = 0; at + 1 < tokens.size(); ++at) {
    if (tokens[at + 1].text != "(" || declares(tokens)) continue;
    if (tokens[at].text == "SET_TORQUE_LIMITS") begins(tokens[at].text);
    if (tokens[at].text == "RESET_TORQUE_LIMITS") state.soft.clear();
  }
  const std::string& word = tokens[0].text;
  if (word != "$CURR_RED" && word != "$TORQUE_AXIS") return;
  const auto equals = std::find_if(tokens.begin(), tokens.end(),
                                   [](const Token& token) { return token.text == "="; });
  if (equals == tokens.end() || equals + 1 == tokens.end()) return;
  const bool alone = equals + 2 == tokens.end() && (equals + 1)->kind == TokenKind::kNumber;
  const auto number = alone ? read_number((equals + 1)->text) : std::nullopt;
  const double stiff = word == "$CURR_RED" ? kFullCurrent : 0;
  if (number && number->value == stiff)
    state.soft.clear();
  else
    begins(word);
}

/// `$VEL.CP=0.25`, `$VEL={CP 0.25,...}`, `$VEL=SVEL_CP(0.25, , LCPDAT1)`, m/s.
double Setting::speed_at(const std::vector<Token>& tokens, std::size_t at) {
  const auto is = [&](std::size_t ahead, std::string_view text) {
    return at + ahead < tokens.size() && tokens[at + ahead].text == text;
  };
  std::size_t number = 0;
  if (is(1, ".") && is(2, "CP") && is(3, "=")) number = at + 4;
  if (is(1, "=") && is(2, "SVEL_CP") && is(3, "(")) number = at + 4;
  if (is(1, "=") && is(2, "{")) {
    number = at + 3;
    while (number < tokens.size() && tokens[number].text != "CP" && tokens[number].text != "}")
      ++number;
    ++number;
  }
  return number == 0 ? kSpeedUnknown : speed_of(tokens, number);
}

double Setting::speed_of(const std::vector<Token>& tokens, std::size_t at) {
  if (at >= tokens.size() || tokens[at].kind != TokenKind::kNumber) return kSpeedUnknown;
  const auto number = read_number(tokens[at].text);
  return number && number->value > 0 ? to_mm(number->value) : kSpeedUnknown;
}

/// `BAS(#TOOL,1)`, `BAS(#BASE,2)`
void Setting::set_by_bas(const std::vector<Token>& tokens, std::size_t f, std::size_t k,
                         State& state) {
  const bool constant = tokens[5].kind == TokenKind::kNumber;
  const int number = constant ? std::atoi(tokens[5].text.c_str()) : 0;
  const std::string why =
      fmt::format("{} chooses it ({})", shown(tokens[5].text), names_.place(f, k));
  if (tokens[3].text == "TOOL" || tokens[3].text == "EX_TOOL") {
    state.load = 0;
    state.tool =
        constant
            ? tools_.tool_numbered(number, f)
            : tools_.add_tool({"$TOOL", "", 0, std::nullopt, std::nullopt, 0, "$TOOL: " + why});
  } else if (tokens[3].text == "CP_PARAMS" || tokens[3].text == "VEL_CP") {
    state.speed = speed_of(tokens, 5);
  } else if (tokens[3].text == "INITMOV") {
    const std::string may =
        fmt::format("BAS(#INITMOV) sets it to its default ({})", names_.place(f, k));
    state.speed = kSpeedUnknown;
    state.load = 0;
    state.tool = tools_.add_tool({"$TOOL", "", 0, std::nullopt, std::nullopt, 0, "$TOOL: " + may});
    state.frame = tools_.add_frame({"$BASE", Pose::Identity(), "$BASE: " + may});
  } else if (tokens[3].text == "EX_BASE") {
    state.frame = tools_.add_frame({"$BASE", Pose::Identity(), carried_at(f, k)});
  } else if (tokens[3].text == "BASE") {
    state.frame = constant ? tools_.base_numbered(number, f)
                           : tools_.add_frame({"$BASE", Pose::Identity(), "$BASE: " + why});
  }
}

/// `#BASE` or `#TCP`, from a token on.
std::string Setting::why_fixed(const std::vector<Token>& tokens, std::size_t at) {
  const std::string word =
      at + 1 < tokens.size() && tokens[at].text == "#" ? tokens[at + 1].text : "";
  return word == "BASE" ? "" : word == "TCP" ? kToolStands : "$IPO_MODE is not constant";
}

std::string Setting::carried_at(std::size_t f, std::size_t k) const {
  return fmt::format("external kinematics carry the base ({})", names_.place(f, k));
}

/// One of them; `at` is its name.
void Setting::set_with(std::size_t f, std::size_t k, std::size_t at, bool assigns, State& state) {
  const std::vector<Token>& tokens = lines_[f][k].tokens;
  static const std::set<std::string> kOfFdat = {"STOOL2", "STOOL", "SBASE", "SIPO_MODE", "SLOAD"};
  const std::string& name = tokens[at].text;
  const bool calls = at + 4 < tokens.size() && tokens[at + 3].text == "(";
  const bool by_fdat =
      calls && kOfFdat.contains(tokens[at + 2].text) && tokens[at + 4].kind == TokenKind::kWord;
  State one = state;
  if (by_fdat) apply_fdat(tokens[at + 4].text, f, one);
  std::size_t end = 0;
  const auto operands = [&] { return operands_at(tokens, at + 2, &end); };
  const std::string part = fmt::format("a part of {} is set ({})", name, names_.place(f, k));
  if (name == "$TOOL") {
    state.tool = by_fdat   ? one.tool
                 : assigns ? tools_.tool_set(operands(), f, k)
                           : tools_.add_tool({"$TOOL", "", 0, std::nullopt, std::nullopt, 0, part});
    if (by_fdat) state.load = 0;
  } else if (name == "$BASE") {
    state.frame = by_fdat ? one.frame
                  : calls && tokens[at + 2].text == "EK"
                      ? tools_.add_frame({"$BASE", Pose::Identity(), carried_at(f, k)})
                  : assigns ? tools_.base_set(operands(), f)
                            : tools_.add_frame({"$BASE", Pose::Identity(), part});
  } else if (name == "$LOAD") {
    state.load = by_fdat   ? 0
                 : assigns ? tools_.load_set(operands(), f, k)
                           : tools_.add_load({"$LOAD", std::nullopt, "", part});
  } else if (by_fdat) {
    state.fixed_tool = one.fixed_tool;
  } else {
    state.fixed_tool = why_fixed(tokens, at + (calls ? 4 : 2));
  }
}

}  // namespace trammel::cam::krl
