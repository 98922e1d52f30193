#pragma once

#include <string>
#include <vector>

#include "tests/support/hidden_world.h"

/// The three files that describe a hidden case to whoever has to find what is hidden.
namespace trammel::hidden {

/// What the cell file believes of tools and loads.
struct Belief {
  std::vector<Eigen::Matrix4d> tools;
  std::vector<Load> loads;
  bool knows_stand = false;  ///< where the tracker stands
};

/// The arm as drawn.
[[nodiscard]] std::string robot_text();
[[nodiscard]] std::string cell_text(const World& world, const Belief& belief,
                                    const std::string& ranges);
/// `frames` as measured at the world's poses, with pose ids p1, p2, ...
[[nodiscard]] std::string batch_text(const World& world, const Frames& measured);

}  // namespace trammel::hidden
