#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "clients/cam/fanuc/statements.h"
#include "clients/cam/program.h"

/// The points of an LS file.
namespace trammel::cam::fanuc {

constexpr std::array<const char*, 6> kPose = {"X", "Y", "Z", "W", "P", "R"};
constexpr std::array<const char*, 6> kJoints = {"J1", "J2", "J3", "J4", "J5", "J6"};

/// Values of one motion group of a position.
struct Group {
  std::map<std::string, Token> values;
  std::string frame, tool, config;
};

struct Position {
  std::size_t begin = 0, end = 0;
  int line = 1;
  std::string name;  ///< `P[3]`
  std::map<int, Group> groups;
  std::string changed;
};

/// 3 of `P[3]`.
[[nodiscard]] std::size_t point_number(const std::string& name);
/// `P[3:"hole"]{ GP1: UF : 1, UT : 2, CONFIG : 'N U T, 0, 0, 0', X = 1.000 mm, ... };`
[[nodiscard]] std::vector<Position> positions_of(const std::string& text, const Part& part);
/// Repeats a position under a new number, line by line, above the line of `at`.
[[nodiscard]] std::vector<NewLine> another_position(const std::string& text,
                                                    const Position& position, std::size_t at);
/// Groups beyond the first, and E1 to E3 of the first.
void note_external(int group, const Group& values, ProgramTarget& target);
/// `'N U T, 0, 0, 0'`: wrist not flipped, elbow up, toward the front; turns of joints 1, 4, 6.
[[nodiscard]] Configuration configuration_of(const std::string& text);

}  // namespace trammel::cam::fanuc
