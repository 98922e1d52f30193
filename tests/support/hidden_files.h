#pragma once

#include <string>
#include <vector>

#include "tests/support/hidden_world.h"

/// The three files of a hidden case for the program under test.
namespace trammel::hidden {

/// The tools and loads as the cell file states them.
struct Belief {
  std::vector<Eigen::Matrix4d> tools;
  std::vector<Load> loads;
  bool knows_stand = false;  ///< the file states the tracker's place
};

/// The arm as drawn.
[[nodiscard]] std::string robot_text();
[[nodiscard]] std::string cell_text(const World& world, const Belief& belief,
                                    const std::string& ranges);
/// `frames` as measured at the world's poses, with pose ids p1, p2, ...
[[nodiscard]] std::string batch_text(const World& world, const Frames& measured);

}  // namespace trammel::hidden
