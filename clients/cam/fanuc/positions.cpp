#include "clients/cam/fanuc/positions.h"

#include <fmt/format.h>

#include <cstdlib>

namespace trammel::cam::fanuc {

namespace {

void read_groups(const Pieces& pieces, std::size_t begin, std::size_t end, Position& position) {
  int group = 1;
  for (std::size_t at = begin; at + 2 < end; ++at) {
    const std::string word(pieces[at].text);
    if (pieces[at].kind != Piece::Kind::kWord) continue;
    Group& now = position.groups[group];
    if (word.starts_with("GP") && pieces[at + 1].is(":")) {
      group = std::atoi(word.c_str() + 2);
      continue;
    }
    if (pieces[at + 1].is("=")) {
      if (pieces[at + 2].kind == Piece::Kind::kNumber) now.values[word] = pieces[at + 2];
    } else if (pieces[at + 1].is(":")) {
      if (word == "UF") now.frame = std::string(pieces[at + 2].text);
      if (word == "UT") now.tool = std::string(pieces[at + 2].text);
      if (word == "CONFIG") now.config = std::string(pieces[at + 2].text);
    }
  }
  if (position.groups.contains(1) && position.groups[1].values.empty() &&
      position.groups.size() > 1 && position.groups[1].frame.empty())
    position.groups.erase(1);
}

}  // namespace

std::vector<Position> positions_of(const std::string& text, const Part& part) {
  const Pieces pieces = pieces_of(text, part.begin, part.end, part.line, {"", "'\""});
  std::vector<Position> positions;
  for (std::size_t at = 0; at + 3 < pieces.size(); ++at) {
    if (!pieces[at].is("P") || !pieces[at + 1].is("[") ||
        pieces[at + 2].kind != Piece::Kind::kNumber)
      continue;
    Position position;
    position.begin = pieces[at].begin;
    position.line = pieces[at].line;
    position.name = fmt::format("P[{}]", pieces[at + 2].text);
    while (at < pieces.size() && !pieces[at].is("{")) ++at;
    const std::size_t begin = at;
    while (at < pieces.size() && !pieces[at].is("}")) ++at;
    position.end = at < pieces.size() ? pieces[at].end : text.size();
    read_groups(pieces, begin, at, position);
    positions.push_back(std::move(position));
  }
  return positions;
}

void note_external(int group, const Group& values, ProgramTarget& target) {
  for (int k = 1; k <= 6; ++k) {
    const auto extended = values.values.find(fmt::format("E{}", k));
    if (group == 1 && extended != values.values.end())
      target.external[k - 1] = number(extended->second);
    const auto joint = values.values.find(fmt::format("J{}", k));
    if (group > 1 && joint != values.values.end())
      target.external[6 * (group - 1) + k - 1] = number(joint->second);
  }
}

Configuration configuration_of(const std::string& text) {
  Configuration said;
  const std::size_t comma = text.find(',');
  for (const char c : text.substr(0, comma)) {
    if (c == 'N' || c == 'F') said.bends_down = c == 'N';
    if (c == 'U' || c == 'D') said.elbow_up = c == 'U';
    if (c == 'T' || c == 'B') said.behind_axis_1 = c == 'B';
  }
  said.turns.resize(6);
  std::size_t at = comma;
  for (const std::size_t joint : {std::size_t{0}, std::size_t{3}, std::size_t{5}}) {
    if (at == std::string::npos) break;
    said.turns[joint] = std::atoi(text.c_str() + at + 1);
    at = text.find(',', at + 1);
  }
  return said;
}

}  // namespace trammel::cam::fanuc
