#include "clients/cam/krl/statements.h"

#include <map>
#include <set>

#include "clients/cam/keep.h"
#include "server/base/units.h"

namespace trammel::cam::krl {

namespace {

/// m/s
std::optional<double> speed_in(const Token& token) {
  const auto number = token.is_number() ? number_in(token) : std::nullopt;
  return number && number->value > 0 ? std::optional<double>(to_mm(number->value)) : std::nullopt;
}

/// `$VEL.CP=0.25`, `$VEL={CP 0.25,...}`, `$VEL=SVEL_CP(0.25, , LCPDAT1)`
std::optional<double> speed_at(const Tokens& tokens, std::size_t at) {
  const auto is = [&](std::size_t ahead, std::string_view text) {
    return tokens[at + ahead].is(text);
  };
  const bool by_part = is(1, ".") && is(2, "CP") && is(3, "=");
  const bool by_call = is(1, "=") && is(2, "SVEL_CP") && is(3, "(");
  if (by_part || by_call) return speed_in(tokens[at + 4]);
  if (!is(1, "=") || !is(2, "{")) return std::nullopt;
  std::size_t field = at + 3;
  while (field < tokens.size() && !tokens[field].is("CP") && !tokens[field].is("}")) ++field;
  return speed_in(tokens[field + 1]);
}

Setting setting_at(const Tokens& tokens, std::size_t at) {
  Setting made;
  made.name = tokens[at].text;
  made.whole = tokens[at + 1].is("=") && at + 2 < tokens.size();
  const bool calls = tokens[at + 3].is("(") && at + 4 < tokens.size();
  const std::size_t argument = at + (calls ? 4 : 2);
  if (calls) made.function = tokens[at + 2].text;
  made.argument = tokens[argument];
  if (made.argument.is("#")) made.constant = tokens[argument + 1].text;
  if (made.whole) made.operands = operands_at(tokens, at + 2);
  if (made.name == "$VEL") made.speed_mm_s = speed_at(tokens, at);
  return made;
}

}  // namespace

bool is_motion(std::string_view word) {
  static const std::set<std::string_view> kMotions = {"PTP",  "LIN",   "CIRC", "SPTP",
                                                      "SLIN", "SCIRC", "SPL"};
  return kMotions.contains(word);
}

bool is_relative(std::string_view word) {
  return word.ends_with("_REL") && is_motion(word.substr(0, word.size() - 4));
}

bool is_by_axes(std::string_view word) { return word.find("PTP") != std::string_view::npos; }

bool declares(const Tokens& tokens) {
  static const std::set<std::string_view> kWords = {"DEF", "DEFFCT", "EXT", "EXTFCT"};
  return kWords.contains(tokens[tokens.size() > 1 && tokens[0].is("GLOBAL") ? 1 : 0].text);
}

std::optional<Head> head_of(const Tokens& tokens) {
  const std::size_t first = tokens[0].is("GLOBAL") ? 1 : 0;
  const Token word = tokens[first];
  const bool is_function = word.is("DEFFCT"), is_list = word.is("DEFDAT");
  if (tokens.size() < first + 2 || !(is_function || is_list || word.is("DEF"))) return std::nullopt;
  const std::size_t name = first + (is_function && tokens.size() > first + 2 ? 2 : 1);
  return Head{tokens[name].text, is_list, name + 1};
}

std::optional<Motion> motion_of(const Tokens& tokens) {
  const std::string_view word = tokens[0].text;
  if (!is_motion(word) && !is_relative(word)) return std::nullopt;
  const bool alone = tokens.size() == 2 || (tokens.size() > 2 && tokens[2].is_word());
  if (alone && tokens[1].is("$AXIS_ACT")) return std::nullopt;
  Motion made{word, {}, word == "CIRC" || word == "SCIRC"};
  const std::size_t due = made.is_arc ? 2 : 1;
  std::size_t next = 1;
  while (made.targets.size() < due) {
    made.targets.push_back(operands_at(tokens, next, &next));
    if (made.targets.back().empty() || !tokens[next].is(",")) break;
    ++next;
  }
  made.ends_by_angle = made.is_arc && !made.targets.back().empty() && tokens[next].is("CA");
  return made;
}

std::optional<Bas> bas_of(const Tokens& tokens) {
  if (!tokens[0].is("BAS") || !tokens[2].is("#") || tokens.size() < 6) return std::nullopt;
  return Bas{tokens[3].text, tokens[5], speed_in(tokens[5])};
}

std::optional<Setting> setting_of(const Tokens& tokens) {
  static const std::set<std::string_view> kSet = {"$TOOL",     "$BASE", "$LOAD",
                                                  "$IPO_MODE", "$VEL",  "FDAT_ACT"};
  if (tokens.size() < 2 || !kSet.contains(tokens[0].text)) return std::nullopt;
  return setting_at(tokens, 0);
}

std::vector<Setting> settings_with(const Tokens& tokens) {
  static const std::set<std::string_view> kSet = {"$TOOL", "$BASE", "$LOAD", "$IPO_MODE", "$VEL"};
  std::vector<Setting> all;
  for (std::size_t at = tokens.find("WITH") + 1; at + 2 < tokens.size(); ++at) {
    const bool begins = tokens[at - 1].is("WITH") || tokens[at - 1].is(",");
    if (begins && kSet.contains(tokens[at].text)) all.push_back(setting_at(tokens, at));
  }
  return all;
}

std::size_t done_later(const Tokens& tokens) {
  const std::size_t first = tokens[0].is("GLOBAL") ? 1 : 0;
  if (!tokens[first].is("INTERRUPT") && !tokens[first].is("TRIGGER")) return 0;
  const std::size_t at = tokens.find("DO", first + 1);
  return at + 1 < tokens.size() ? at + 1 : 0;
}

std::vector<std::string_view> called_in(const Tokens& tokens) {
  std::vector<std::string_view> called;
  for (std::size_t at = 0; at + 1 < tokens.size(); ++at) {
    if (tokens[at].is_word() && tokens[at + 1].is("(")) called.push_back(tokens[at].text);
  }
  return called;
}

Step step_of(const Tokens& tokens) {
  using Kind = Step::Kind;
  static const std::map<std::string_view, Kind> kWords = {
      {"IF", Kind::kIf},         {"ELSE", Kind::kElse},     {"ENDIF", Kind::kEnd},
      {"SWITCH", Kind::kSwitch}, {"CASE", Kind::kCase},     {"DEFAULT", Kind::kElse},
      {"ENDSWITCH", Kind::kEnd}, {"LOOP", Kind::kRepeat},   {"ENDLOOP", Kind::kEnd},
      {"WHILE", Kind::kWhile},   {"ENDWHILE", Kind::kEnd},  {"FOR", Kind::kWhile},
      {"ENDFOR", Kind::kEnd},    {"REPEAT", Kind::kRepeat}, {"UNTIL", Kind::kEnd},
      {"EXIT", Kind::kExit},     {"RETURN", Kind::kReturn}, {"RESUME", Kind::kReturn}};
  const Token next = tokens[1];
  if (tokens.size() == 2 && next.is(":")) return {Kind::kLabel, std::string(tokens[0].text)};
  if (tokens.size() > 1 && tokens[0].is("GOTO")) return {Kind::kJump, std::string(next.text)};
  if (next.is("=") || next.is("[") || next.is(".")) return {};
  const auto word = kWords.find(tokens[0].text);
  return word == kWords.end() ? Step{} : Step{word->second};
}

}  // namespace trammel::cam::krl
