#include "clients/cam/inform/job.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <set>

#include "clients/cam/keep.h"
#include "server/base/letters.h"

namespace trammel::cam::inform {

namespace {

constexpr Lexis kLexis = {"'", "\""};

bool is_end(std::string_view line) {
  const std::size_t first = std::min(line.find_first_not_of(" \t"), line.size());
  return line.substr(first).starts_with("END") &&
         line.find_first_not_of(" \t\r", first + 3) == std::string_view::npos;
}

std::string value_behind(std::string_view line) {
  const std::size_t at = line.find(' ');
  if (at == std::string_view::npos) return "";
  const std::size_t end = line.find_last_not_of(" \t\r");
  return std::string(line.substr(at + 1, end - at));
}

/// `C00000`, and the external axes for the same position: `BC00000` for those that carry the robot,
/// `EC00000` for those that carry the part.
bool names_position(std::string_view text) {
  const std::size_t letter = !text.empty() && (text[0] == 'B' || text[0] == 'E') ? 1 : 0;
  return text.size() > letter + 1 && text[letter] == 'C' && is_digit(text[letter + 1]);
}

/// True if the token stands behind the position in a motion; `BP001` is a variable.
bool is_external(const Token& token) {
  return token.is_word() && token.text.size() > 2 &&
         (token.text[0] == 'B' || token.text[0] == 'E') &&
         (token.text[1] == 'C' || token.text[1] == 'P' || token.text[1] == 'X') &&
         is_digit(token.text[2]);
}

Statement statement_of(std::string_view text, const TokenLine& line) {
  Statement made{line.number, line.tokens, {}, {}, {}};
  const Tokens& tokens = made.tokens;
  const auto whole = [&](std::size_t number) {
    const std::size_t at = tokens[number].begin;
    return text.substr(at, std::min(text.find_first_of(" \t\r\n", at), text.size()) - at);
  };
  if (tokens.empty()) return made;
  made.whole_word = whole(0);
  for (std::size_t at = 1; at < tokens.size(); ++at) made.maybe |= tokens[at].is("IF");
  if (made.begins("JUMP") && tokens[1].is("*")) made.jumps_to = whole(1);
  if ((made.begins("CALL") || made.begins("JUMP")) && tokens[1].is("JOB") && tokens.size() > 3)
    made.job = whole(3);
  return made;
}

class Reader {
 public:
  explicit Reader(std::string_view text) : text_(text) {}

  JobText read() {
    made_.mark_at = text_.size();
    bool instructions = false;
    for (const TokenLine& line : token_lines(text_, kLexis)) {
      const std::string_view text = text_.substr(line.begin, line.end - line.begin);
      if (text.starts_with("//INST")) instructions = true;
      if (text.starts_with("/JOB")) made_.open_at = line.number;
      if (instructions && is_end(text)) made_.open_at = 0;
      if (instructions && text.starts_with("NOP") && made_.mark_at == text_.size())
        made_.mark_at = std::min(line.end + 1, text_.size());
      if (text.starts_with("//NAME ")) made_.name = value_behind(text);
      if (text.starts_with("///GROUP1 ")) made_.group = value_behind(text);
      if (instructions)
        made_.statements.push_back(statement_of(text_, line));
      else
        head(text, line);
    }
    return std::move(made_);
  }

 private:
  void head(std::string_view text, const TokenLine& line) {
    if (text.starts_with("///TOOL")) now_.tool = value_behind(text);
    if (text.starts_with("///USER")) now_.user = value_behind(text);
    if (text.starts_with("///POSTYPE")) now_.kind = value_behind(text);
    if (text.starts_with("///RCONF")) {
      now_.conf.clear();
      for (const double value : values_in(line.tokens))
        now_.conf.push_back(static_cast<int>(std::clamp(value, -1e6, 1e6)));
    }
    const std::size_t equals = text.find('=');
    if (!names_position(text) || equals == std::string_view::npos) return;
    Position position = now_;
    position.begin = line.begin;
    position.line = line.number;
    for (const Token token : line.tokens) {
      if (token.is_number()) position.numbers.push_back(token);
    }
    const auto [known, fresh] =
        made_.positions.emplace(std::string(text.substr(0, equals)), std::move(position));
    if (!fresh) known->second.again_at = line.number;
  }

  std::string_view text_;
  Position now_;
  JobText made_;
};

}  // namespace

Configuration configuration_of(const std::vector<int>& conf) {
  Configuration said;
  if (conf.size() < 3) return said;
  said.bends_down = conf[0] == 1;
  said.elbow_up = conf[1] == 0;
  said.behind_axis_1 = conf[2] == 1;
  said.turns.resize(6);
  constexpr std::array<std::size_t, 3> kTurning = {3, 5, 0};
  for (std::size_t k = 0; k < 3 && k + 3 < conf.size(); ++k) {
    if (conf[k + 3] == 0) said.turns[kTurning[k]] = 0;
  }
  return said;
}

std::string Statement::sets() const {
  if (tokens.size() < 4 || (!begins("MFRAME") && !begins("SETTOOL"))) return "";
  const bool numbered = tokens.size() > 5 && tokens[2].is("#") && tokens[4].is_number();
  return fmt::format("{}[{}]", begins("MFRAME") ? "USER" : "TOOL", numbered ? tokens[4].text : "*");
}

std::vector<Step> Statement::steps() const {
  using Kind = Step::Kind;
  static const std::map<std::string_view, Kind> kWords = {
      {"IFTHEN", Kind::kIf},      {"IFTHENEXP", Kind::kIf},     {"ELSEIF", Kind::kCase},
      {"ELSEIFEXP", Kind::kCase}, {"ELSE", Kind::kElse},        {"ENDIF", Kind::kEnd},
      {"WHILE", Kind::kWhile},    {"WHILEEXP", Kind::kWhile},   {"ENDWHILE", Kind::kEnd},
      {"FOR", Kind::kWhile},      {"NEXT", Kind::kEnd},         {"SWITCH", Kind::kSwitch},
      {"CASE", Kind::kCase},      {"DEFAULT", Kind::kElse},     {"ENDSWITCH", Kind::kEnd},
      {"BREAK", Kind::kExit},     {"CONTINUE", Kind::kContinue}};
  if (begins("*")) return {{Kind::kLabel, std::string(whole_word)}};
  if (begins("RET") || begins("END")) return {{maybe ? Kind::kPlain : Kind::kReturn}};
  if (!jumps_to.empty()) return {{maybe ? Kind::kJumpMaybe : Kind::kJump, std::string(jumps_to)}};
  if (begins("JUMP")) return {{maybe ? Kind::kPlain : Kind::kReturn}};
  if (begins("CALL") && !job.empty()) {
    const Step call{Kind::kCall, std::string(job)};
    return maybe ? std::vector<Step>{{Kind::kIf}, call, {Kind::kEnd}} : std::vector<Step>{call};
  }
  const auto known = kWords.find(word());
  return {known == kWords.end() ? Step{} : Step{known->second}};
}

JobText job_of(std::string_view text) { return Reader(text).read(); }

std::optional<Motion> motion_of(const Statement& statement) {
  static const std::set<std::string_view> kMotions = {"MOVJ", "MOVL", "MOVC", "MOVS", "IMOV"};
  const Tokens& tokens = statement.tokens;
  if (tokens.size() < 2 || !kMotions.contains(statement.word())) return std::nullopt;
  Motion motion{statement.word(), std::string(tokens[1].text), {}, {}, {}};
  for (std::size_t at = 0; at < tokens.size(); ++at) {
    if (at > 1 && is_external(tokens[at])) motion.external.emplace_back(tokens[at].text);
    const bool ends = tokens[at].is("UNTIL") || tokens[at].is("SRCH");
    if (ends && motion.ended_by.empty()) motion.ended_by = tokens[at].text;
    const auto speed =
        tokens[at].is("V") && tokens[at + 1].is("=") ? number_in(tokens[at + 2]) : std::nullopt;
    if (speed && !motion.speed_mm_s) motion.speed_mm_s = speed->value;
  }
  return motion;
}

}  // namespace trammel::cam::inform
