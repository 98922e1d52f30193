#include "clients/cam/fanuc/statements.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "clients/cam/number_text.h"
#include "server/base/letters.h"

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

/// Without comments of points and registers, `P[1:don't]`, and without texts: words in them mean
/// nothing.
Pieces without_comments(const Pieces& pieces) {
  Pieces kept;
  const auto skip_to = [&](std::size_t at, std::string_view end) {
    std::size_t to = at + 1;
    while (to < pieces.size() && !pieces[to].is(end)) ++to;
    return to;
  };
  int depth = 0;
  for (std::size_t at = 0; at < pieces.size(); ++at) {
    if (depth > 0 && pieces[at].is(":") && !is_group(pieces[at - 1])) at = skip_to(at, "]");
    if (depth == 0 && pieces[at].is("'")) {
      const std::size_t end = skip_to(at, "'");
      if (end < pieces.size()) at = end;
      continue;
    }
    if (at >= pieces.size()) break;
    if (pieces[at].is("[")) ++depth;
    if (pieces[at].is("]")) --depth;
    kept.push_back(pieces[at]);
  }
  return kept;
}

void add_statements(const Pieces& pieces, std::vector<Pieces>& statements) {
  std::vector<Pieces> all(1);
  for (const Piece& piece : pieces) {
    if (piece.is(";")) {
      all.emplace_back();
      continue;
    }
    all.back().push_back(piece);
  }
  for (Pieces& one : all) {
    while (!one.empty() && (one[0].kind == Piece::Kind::kNumber || one[0].is(":")))
      one.erase(one.begin());
    if (!one.empty()) statements.push_back(std::move(one));
  }
}

/// `LBL[3:again]` -> `3`
std::string indexed_number(const Pieces& pieces, std::size_t at) {
  return at + 2 < pieces.size() ? std::string(pieces[at + 2].text) : std::string();
}

}  // namespace

Part part_of(const std::string& text, const std::string& head) {
  Part part{text.size(), text.size(), 1};
  bool inside = false;
  int line = 1;
  for (std::size_t at = 0; at < text.size(); ++line) {
    const std::size_t end = std::min(text.find('\n', at), text.size() - 1) + 1;
    const std::size_t first = text.find_first_not_of(" \t", at);
    if (first < end && text[first] == '/') {
      if (inside) {
        part.end = at;
        return part;
      }
      const std::size_t stop = text.find_first_of(" \t\r\n", first);
      inside = text.substr(first, std::min(stop, end) - first) == head;
      if (inside) part = {end, text.size(), line + 1};
    }
    at = end;
  }
  return part;
}

std::string name_of_program(const SourceFile& source) {
  const std::string& text = source.text;
  const std::size_t head = text.find("/PROG");
  const std::size_t end =
      head == std::string::npos ? 0 : std::min(text.find('\n', head), text.size());
  const Pieces pieces =
      head == std::string::npos ? Pieces{} : pieces_of(text, head, end, 1, {"", ""});
  if (pieces.size() > 2) return upper(std::string(pieces[2].text));
  const std::string& file = source.name;
  const std::size_t folder = file.rfind('/') + 1;
  return upper(file.substr(folder, file.rfind('.') - std::min(folder, file.rfind('.'))));
}

std::vector<Pieces> statements_of(const std::string& text, const Part& part) {
  std::vector<Pieces> statements;
  std::size_t begin = part.begin;
  int line = part.line, first_line = part.line;
  for (std::size_t at = part.begin; at < part.end; ++line) {
    const std::size_t end = std::min(text.find('\n', at), part.end - 1) + 1;
    const std::size_t last = text.find_last_not_of(" \t\r\n", end - 1);
    at = end;
    if (end < part.end && (last == std::string::npos || last < begin || text[last] != ';'))
      continue;
    const std::size_t first = text.find_first_not_of(" \t\r\n0123456789:", begin);
    // Remarks: `!hole`, `--eg:hole`, and what is commented out, `//L P[1] ...`.
    if (first < end && std::string_view("!-/").find(text[first]) == std::string_view::npos)
      add_statements(without_comments(pieces_of(text, begin, end, first_line, {"", ""})),
                     statements);
    begin = end;
    first_line = line + 1;
  }
  return statements;
}

bool is_number(const std::string& text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
}

double number(const Piece& piece) {
  const auto written = read_number(piece.text);
  return written ? written->value : 0;
}

bool is_group(const Piece& piece) { return piece.text.size() == 3 && piece.text.starts_with("GP"); }

std::optional<double> constant_at(const Pieces& statement, std::size_t at) {
  const bool in_brackets =
      at + 3 == statement.size() && statement[at].is("(") && statement[at + 2].is(")");
  const std::size_t value = in_brackets ? at + 1 : at;
  if (!in_brackets && at + 1 != statement.size()) return std::nullopt;
  return statement[value].kind == Piece::Kind::kNumber
             ? std::optional<double>(number(statement[value]))
             : std::nullopt;
}

std::size_t done_perhaps(const Pieces& statement) {
  int depth = 0;
  for (std::size_t at = 0; at + 1 < statement.size() && statement[0].is("IF"); ++at) {
    if (statement[at].is("[") || statement[at].is("(")) ++depth;
    if (statement[at].is("]") || statement[at].is(")")) --depth;
    if (statement[at].is(",") && depth == 0) return at + 1;
  }
  return 0;
}

std::string indexed(const Pieces& pieces, std::size_t at) {
  if (at + 3 >= pieces.size() || !pieces[at + 1].is("[")) return "";
  const std::string_view word = pieces[at].text;
  const bool grouped = at + 5 < pieces.size() && is_group(pieces[at + 2]) && pieces[at + 3].is(":");
  if (grouped && !pieces[at + 2].is("GP1")) return fmt::format("{}[{}]", word, pieces[at + 2].text);
  if (grouped) at += 2;
  if (pieces[at + 2].kind != Piece::Kind::kNumber) return fmt::format("{}[*]", word);
  return fmt::format("{}[{}]", word, pieces[at + 2].text);
}

Step step_of(const Pieces& statement) {
  using Kind = Step::Kind;
  if (statement.empty()) return {};
  const Piece& first = statement[0];
  if (first.is("LBL")) return {Kind::kLabel, indexed_number(statement, 0)};
  // `JMP LBL[1]`, `IF R[1]=1,JMP LBL[2]`, `L P[1] 100mm/sec FINE Skip,LBL[3]`, `WAIT DI[1]=ON
  // TIMEOUT,LBL[4]`
  for (std::size_t at = 1; at < statement.size(); ++at) {
    if (!statement[at].is("LBL")) continue;
    const bool always = at == 1 && first.is("JMP");
    return {always ? Kind::kJump : Kind::kJumpMaybe, indexed_number(statement, at)};
  }
  const bool block = statement.back().is("THEN");
  if (first.is("IF") && block) return {Kind::kIf};
  if (first.is("ELSE") && statement.size() == 1) return {Kind::kElse};
  if (first.is("FOR")) return {Kind::kWhile};
  if (first.is("ENDIF") || first.is("ENDFOR")) return {Kind::kEnd};
  if ((first.is("END") || first.is("ABORT")) && statement.size() == 1) return {Kind::kReturn};
  return {};
}

std::string called_by(const Pieces& statement) {
  for (std::size_t at = 0; at + 1 < statement.size(); ++at) {
    if (statement[at].is("CALL")) return upper(std::string(statement[at + 1].text));
  }
  return "";
}

std::string macro_in(const Pieces& statement) {
  const Piece& first = statement[0];
  const bool is_known = kKnown.find(fmt::format(" {} ", first.text)) != std::string_view::npos;
  const bool is_name = first.kind == Piece::Kind::kWord && first.text[0] != '$' && !is_known;
  const bool sets = statement.size() > 1 && (statement[1].is("[") || statement[1].is("="));
  if (!is_name || sets) return "";
  return statement.size() > 1 && statement[1].kind == Piece::Kind::kWord
             ? fmt::format("{} {}", first.text, statement[1].text)
             : std::string(first.text);
}

}  // namespace trammel::cam::fanuc
