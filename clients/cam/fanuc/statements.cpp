#include "clients/cam/fanuc/statements.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "clients/cam/keep.h"
#include "server/base/letters.h"
#include "server/base/plain_text.h"

namespace trammel::cam::fanuc {

namespace {

/// First words of instructions.
constexpr std::string_view kKnown =
    " J L C A S LBL JMP IF ELSE ENDIF FOR ENDFOR SELECT WAIT CALL RUN END ABORT PAUSE OVERRIDE "
    "MESSAGE UALM RSR PAYLOAD UFRAME_NUM UTOOL_NUM Arc ARC Weave WEAVE Track TRACK Touch TOUCH "
    "Search SEARCH SPOT BACKUP COL SKIP OFFSET TOOL_OFFSET MONITOR ERROR_PROG RESUME_PROG LOCK "
    "UNLOCK SOFTFLOAT MP TORQ_LIMIT STOP_TRACKING VISION TIMER VOFFSET LINE SYNC JOINT_MAX_SPEED "
    "LINEAR_MAX_SPEED FORCE SENSOR DIAG POINT_LOGIC LINECOUNT TOOL_OFFSET_CONDITION CLEAR "
    "TC_ONLINE RESET PULSE RETURN ";

/// Removes comments of points and registers, `P[1:don't]`, and texts, since words in them mean
/// nothing.
Tokens without_comments(const std::string& text, const Tokens& tokens) {
  Tokens kept(text);
  int depth = 0;
  for (std::size_t at = 0; at < tokens.size(); ++at) {
    if (depth > 0 && tokens[at].is(":") && !is_group(tokens[at - 1])) at = tokens.find("]", at + 1);
    if (depth == 0 && tokens[at].is("'")) {
      const std::size_t end = tokens.find("'", at + 1);
      if (end < tokens.size()) at = end;
      continue;
    }
    if (at >= tokens.size()) break;
    if (tokens[at].is("[")) ++depth;
    if (tokens[at].is("]")) --depth;
    kept.add(tokens[at]);
  }
  return kept;
}

/// The start of the conditional action in `IF (R[1]=1),PR[5,1]=(200)`; 0: the statement has another
/// form.
std::size_t done_perhaps(const Tokens& tokens) {
  int depth = 0;
  for (std::size_t at = 0; at + 1 < tokens.size() && tokens[0].is("IF"); ++at) {
    if (tokens[at].is("[") || tokens[at].is("(")) ++depth;
    if (tokens[at].is("]") || tokens[at].is(")")) --depth;
    if (tokens[at].is(",") && depth == 0) return at + 1;
  }
  return 0;
}

/// `-12.5`, `(-12.5)`
std::optional<double> constant_in(const Tokens& value) {
  const bool in_brackets = value.size() == 3 && value[0].is("(") && value[2].is(")");
  const Token number = value[in_brackets ? 1 : 0];
  if ((!in_brackets && value.size() != 1) || !number.is_number()) return std::nullopt;
  return value_in(number);
}

std::optional<Assignment> assignment_in(const Tokens& tokens) {
  const std::size_t begin = done_perhaps(tokens);
  const std::size_t equals = tokens.find("=", begin);
  if (equals >= tokens.size()) return std::nullopt;
  Assignment made{indexed(tokens, begin),
                  tokens.part(begin, equals),
                  tokens.part(equals + 1, tokens.size()),
                  begin > 0,
                  {}};
  made.constant = constant_in(made.value);
  return made;
}

std::string macro_in(const Tokens& tokens) {
  const Token first = tokens[0];
  const bool is_known = kKnown.find(fmt::format(" {} ", first.text)) != std::string_view::npos;
  const bool is_name = first.is_word() && first.text[0] != '$' && !is_known;
  if (!is_name || tokens[1].is("[") || tokens[1].is("=")) return "";
  return tokens[1].is_word() ? fmt::format("{} {}", first.text, tokens[1].text)
                             : std::string(first.text);
}

Statement statement_of(Tokens tokens) {
  Statement made{tokens[0].line, std::move(tokens)};
  made.assignment = assignment_in(made.tokens);
  made.macro = macro_in(made.tokens);
  for (std::size_t at = 0; at + 1 < made.tokens.size(); ++at) {
    const Token word = made.tokens[at], next = made.tokens[at + 1];
    if (word.is("CALL") || word.is("RUN")) made.starts.push_back({word.text, next.text});
    if (word.is("CALL") && made.called.empty()) made.called = upper(next.text);
  }
  return made;
}

void add_statements(const Tokens& tokens, std::vector<Statement>& statements) {
  for (std::size_t begin = 0; begin < tokens.size();) {
    const std::size_t end = tokens.find(";", begin);
    while (begin < end && (tokens[begin].is_number() || tokens[begin].is(":"))) ++begin;
    if (begin < end) statements.push_back(statement_of(tokens.part(begin, end)));
    begin = end + 1;
  }
}

/// `250mm/sec`, `1500.0cm/min`
std::optional<double> speed_in(const Tokens& tokens) {
  std::optional<double> speed;
  for (std::size_t at = 0; at + 3 < tokens.size(); ++at) {
    if (!tokens[at].is_number() || !tokens[at + 2].is("/")) continue;
    const Token length = tokens[at + 1], time = tokens[at + 3];
    const double mm = length.is("mm") ? 1 : length.is("cm") ? 10 : length.is("inch") ? 25.4 : 0;
    const double s = time.is("sec") ? 1 : time.is("min") ? 60 : 0;
    if (mm > 0 && s > 0) speed = value_in(tokens[at]) * mm / s;
  }
  return speed;
}

/// The way in which a word behind a motion changes its end; empty: it does not.
std::string moved_by(const Token& word) {
  static const std::set<std::string_view> kDisplace = {"Offset",      "OFFSET",  "Tool_Offset",
                                                       "TOOL_OFFSET", "VOFFSET", "INC"},
                                          kSense = {"Skip", "SKIP", "Search"};
  if (word.is("Track") || word.is("TRACK"))
    return fmt::format("{} moves it at run time", word.text);
  if (kDisplace.contains(word.text)) return fmt::format("{} displaces it at run time", word.text);
  if (word.is("RTCP")) return "the tool stands and the robot holds the work piece (RTCP)";
  if (kSense.contains(word.text)) return fmt::format("a sensor may end the motion ({})", word.text);
  return "";
}

}  // namespace

Part part_of(const std::string& text, std::string_view head) {
  Part part{text.size(), text.size(), 1};
  bool inside = false;
  for (const TextLine& line : text_lines(text)) {
    const std::string_view word =
        line.text.substr(std::min(line.text.find_first_not_of(" \t"), line.text.size()));
    if (!word.starts_with('/')) continue;
    if (inside) {
      part.end = line.begin;
      return part;
    }
    inside = word.substr(0, word.find_first_of(" \t\r")) == head;
    if (inside) part = {std::min(line.end + 1, text.size()), text.size(), line.number + 1};
  }
  return part;
}

std::string name_of_program(const SourceFile& source) {
  const std::string& text = source.text;
  if (const std::size_t head = text.find("/PROG"); head != std::string::npos) {
    const std::size_t end = std::min(text.find('\n', head), text.size());
    const Token name = tokens_of(text, head, end, 1, {})[2];
    if (!name.text.empty()) return upper(name.text);
  }
  const std::string& file = source.name;
  const std::size_t folder = file.rfind('/') + 1;
  return upper(file.substr(folder, file.rfind('.') - std::min(folder, file.rfind('.'))));
}

std::vector<Statement> statements_of(const std::string& text, const Part& part) {
  std::vector<Statement> statements;
  std::size_t begin = part.begin;
  int first_line = part.line;
  for (const TextLine& line : text_lines(std::string_view(text).substr(0, part.end))) {
    if (line.begin < part.begin) continue;
    const std::size_t end = std::min(line.end + 1, part.end);
    const std::size_t last = text.find_last_not_of(" \t\r\n", end - 1);
    if (end < part.end && (last == std::string::npos || last < begin || text[last] != ';'))
      continue;
    const std::size_t first = text.find_first_not_of(" \t\r\n0123456789:", begin);
    // Remarks: `!hole`, `--eg:hole`, and statements commented out, `//L P[1] ...`.
    if (first < end && std::string_view("!-/").find(text[first]) == std::string_view::npos)
      add_statements(without_comments(text, tokens_of(text, begin, end, first_line, {})),
                     statements);
    begin = end;
    first_line = line.number + 1;
  }
  return statements;
}

std::optional<Motion> motion_of(const Statement& statement) {
  static const std::set<std::string_view> kMotions = {"J", "L", "C", "A", "S"};
  const Tokens& tokens = statement.tokens;
  if (tokens.size() < 4 || !kMotions.contains(statement.word())) return std::nullopt;
  // `L PAL_1[BTM] 100mm/sec FINE`
  const bool elsewhere = !tokens[1].is("P") && !tokens[1].is("PR");
  if (elsewhere && (!tokens[1].is_word() || !tokens[2].is("["))) return std::nullopt;
  Motion motion{
      statement.word(), elsewhere ? tokens[1].text : std::string_view(), {}, speed_in(tokens)};
  if (elsewhere) return motion;
  for (const Token token : tokens) {
    if (std::string by = moved_by(token); !by.empty()) motion.moved = std::move(by);
  }
  for (std::size_t at = 1; at + 2 < tokens.size(); ++at) {
    if ((!tokens[at].is("P") && !tokens[at].is("PR")) || !tokens[at + 1].is("[")) continue;
    if (at > 1 && tokens[at - 1].is(",")) continue;  // the register of an offset
    motion.points.push_back(indexed(tokens, at));
    if (motion.kind != "C") break;
  }
  return motion;
}

std::optional<std::string> follows_behind(const Statement& statement) {
  const Tokens& tokens = statement.tokens;
  if (statement.begins("TORQ_LIMIT") && tokens.size() > 1) {
    constexpr double kWhole = 100;  // percent
    const auto limit = number_in(tokens[1]);
    return limit && limit->value >= kWhole ? ""
                                           : fmt::format("TORQ_LIMIT (line {})", statement.line);
  }
  const bool offset = tokens.size() > 2 && (statement.begins("Touch") || statement.begins("MP")) &&
                      (tokens[1].is("Offset") || tokens[1].is("OFFSET"));
  static const std::set<std::string_view> kFollows = {"Track", "TRACK", "SOFTFLOAT"};
  if (!offset && (tokens.size() < 2 || !kFollows.contains(statement.word()))) return std::nullopt;
  const Token last = tokens[offset ? 2 : 1];
  if (last.is("End") || last.is("END")) return "";
  const std::string what = last.is("[") ? "" : " " + shown(tokens[1].text);
  return fmt::format("{}{} (line {})", statement.word(), what, statement.line);
}

std::string started_beside(const Statement& statement) {
  const Tokens& tokens = statement.tokens;
  if (statement.begins("MONITOR") && tokens.size() > 1 && !tokens[1].is("END"))
    return fmt::format("MONITOR {}", shown(tokens[1].text));
  const bool names = statement.begins("ERROR_PROG") || statement.begins("RESUME_PROG");
  return names && tokens.size() > 2 ? fmt::format("{}={}", statement.word(), shown(tokens[2].text))
                                    : "";
}

std::vector<std::string> loads_in(const Statement& statement) {
  std::vector<std::string> loads;
  for (std::size_t at = 0; at + 2 < statement.tokens.size(); ++at) {
    if (statement.tokens[at].is("PAYLOAD")) loads.push_back(indexed(statement.tokens, at));
  }
  return loads;
}

bool is_number(const std::string& text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
}

bool is_group(const Token& token) { return token.text.size() == 3 && token.text.starts_with("GP"); }

std::string indexed(const Tokens& tokens, std::size_t at) {
  if (at + 3 >= tokens.size() || !tokens[at + 1].is("[")) return "";
  const std::string_view word = tokens[at].text;
  const bool grouped = is_group(tokens[at + 2]) && tokens[at + 3].is(":") && at + 5 < tokens.size();
  if (grouped && !tokens[at + 2].is("GP1")) return fmt::format("{}[{}]", word, tokens[at + 2].text);
  const Token index = tokens[grouped ? at + 4 : at + 2];
  return fmt::format("{}[{}]", word, index.is_number() ? index.text : "*");
}

Step step_of(const Statement& statement) {
  using Kind = Step::Kind;
  const Tokens& tokens = statement.tokens;
  // `LBL[3:again]` -> `3`
  const auto label_at = [&](std::size_t at) { return std::string(tokens[at + 2].text); };
  if (statement.begins("LBL")) return {Kind::kLabel, label_at(0)};
  // `JMP LBL[1]`, `IF R[1]=1,JMP LBL[2]`, `L P[1] 100mm/sec FINE Skip,LBL[3]`, `WAIT DI[1]=ON
  // TIMEOUT,LBL[4]`
  if (const std::size_t at = tokens.find("LBL", 1); at < tokens.size())
    return {at == 1 && statement.begins("JMP") ? Kind::kJump : Kind::kJumpMaybe, label_at(at)};
  const bool alone = tokens.size() == 1;
  if (statement.begins("IF") && tokens.back().is("THEN")) return {Kind::kIf};
  if (statement.begins("ELSE") && alone) return {Kind::kElse};
  if (statement.begins("FOR")) return {Kind::kWhile};
  if (statement.begins("ENDIF") || statement.begins("ENDFOR")) return {Kind::kEnd};
  if ((statement.begins("END") || statement.begins("ABORT")) && alone) return {Kind::kReturn};
  return {};
}

}  // namespace trammel::cam::fanuc
