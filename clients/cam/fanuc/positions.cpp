#include "clients/cam/fanuc/positions.h"

#include <fmt/format.h>

#include <cstdlib>
#include <utility>

#include "clients/cam/keep.h"

namespace trammel::cam::fanuc {

namespace {

void read_groups(const Tokens& tokens, std::size_t begin, std::size_t end, Position& position) {
  int group = 1;
  for (std::size_t at = begin; at + 2 < end; ++at) {
    if (!tokens[at].is_word()) continue;
    const std::string word(tokens[at].text);
    const Token sign = tokens[at + 1], value = tokens[at + 2];
    Group& now = position.groups[group];
    if (word.starts_with("GP") && sign.is(":")) {
      group = std::atoi(word.c_str() + 2);
    } else if (sign.is("=")) {
      if (value.is_number()) now.values[word] = value;
    } else if (sign.is(":")) {
      if (word == "UF") now.frame = value.text;
      if (word == "UT") now.tool = value.text;
      if (word == "CONFIG") now.config = value.text;
    }
  }
  if (position.groups.contains(1) && position.groups[1].values.empty() &&
      position.groups.size() > 1 && position.groups[1].frame.empty())
    position.groups.erase(1);
}

}  // namespace

std::size_t point_number(const std::string& name) {
  return std::strtoul(name.c_str() + 2, nullptr, 10);
}

std::vector<Position> positions_of(const std::string& text, const Part& part) {
  const Tokens tokens = tokens_of(text, part.begin, part.end, part.line, kLexis);
  std::vector<Position> positions;
  for (std::size_t at = 0; at + 3 < tokens.size(); ++at) {
    if (!tokens[at].is("P") || !tokens[at + 1].is("[") || !tokens[at + 2].is_number()) continue;
    Position position;
    position.begin = tokens[at].begin;
    position.line = tokens[at].line;
    position.name = fmt::format("P[{}]", tokens[at + 2].text);
    const std::size_t begin = tokens.find("{", at);
    at = tokens.find("}", begin);
    position.end = at < tokens.size() ? tokens[at].end : text.size();
    read_groups(tokens, begin, at, position);
    positions.push_back(std::move(position));
  }
  return positions;
}

std::vector<NewLine> another_position(const std::string& text, const Position& position,
                                      std::size_t at) {
  const Group& group = position.groups.at(1);
  const bool joints = group.values.contains("J1");
  std::map<std::size_t, std::pair<std::size_t, std::size_t>> numbers;  // by the first byte
  for (std::size_t k = 0; k < kPose.size(); ++k) {
    const auto value = group.values.find(joints ? kJoints[k] : kPose[k]);
    if (value == group.values.end() || !number_in(value->second)) return {};
    numbers[value->second.begin] = {value->second.end, k};
  }
  const std::size_t head_end = text.find(']', position.begin);
  std::vector<NewLine> lines(1, NewLine{at, {fmt::format("P[{}]", kNewPoint)}, {}});
  for (std::size_t b = head_end + 1; b < position.end;) {
    NewLine& line = lines.back();
    if (const auto number = numbers.find(b); number != numbers.end()) {
      const auto& [end, k] = number->second;
      const auto written = read_number(std::string_view(text).substr(b, end - b));
      line.slots.push_back({k, written->style});
      line.texts.emplace_back();
      b = end;
      continue;
    }
    if (text[b] == '\n')
      lines.push_back({at, {""}, {}});
    else if (text[b] != '\r')
      line.texts.back() += text[b];
    ++b;
  }
  lines.back().texts.back() += ";";
  return lines;
}

void note_external(int group, const Group& values, ProgramTarget& target) {
  for (int k = 1; k <= 6; ++k) {
    const auto extended = values.values.find(fmt::format("E{}", k));
    if (group == 1 && extended != values.values.end())
      target.external[k - 1] = value_in(extended->second);
    const auto joint = values.values.find(fmt::format("J{}", k));
    if (group > 1 && joint != values.values.end())
      target.external[6 * (group - 1) + k - 1] = value_in(joint->second);
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
