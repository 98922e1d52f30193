#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/robot/arm_shape.h"
#include "server/robot/cell_obstacles.h"

/// Whether the arm keeps clear of what the cell file states as obstacles. Each part of the arm is a
/// capsule: a straight line with a radius. What is not stated is not known: cables, the gripper's
/// width, the ways between poses.
namespace trammel {

/// A part of the arm that meets an obstacle.
struct Touch {
  int link = 0;      ///< as ArmPart has it
  std::string what;  ///< `the floor`, `the mounting`, `box table`
  double by = 0;     ///< m that the capsule is inside; its radius at the most
};

class Clearance {
 public:
  /// `tool`: of the cell; its place is the end of the last capsule, if it is known. The cell
  /// outlives this.
  Clearance(const Cell& cell, const std::string& tool);

  /// The deepest touch of the nominal arm at `q` (rad, m); empty: it is clear. What the arm stands
  /// on by nature is let pass: the links up to its first turning joint may touch floor and
  /// mounting.
  [[nodiscard]] std::optional<Touch> touch_at(const JointVector& q) const;
  /// m, of the capsule of this part.
  [[nodiscard]] double radius_of(const ArmPart& part) const;

 private:
  const Cell& cell_;
  std::optional<Obstacles> around_;
  std::optional<Vector3> tool_F_;
  int standing_ = 0;  // the last link that may touch floor and mounting
};

/// `link 3 touches box table by 12 mm`, links from 1; `the tool`.
[[nodiscard]] std::string in_words(const Touch& touch, const Chain& robot);

/// `the floor, the mounting, box table; links 100 mm in radius`; empty where nothing is stated.
[[nodiscard]] std::string obstacles_in_words(const Cell& cell);

/// m: from a straight line between two points to a closed box; 0 where they meet.
[[nodiscard]] double distance_to_box(const Vector3& from, const Vector3& to, const Workspace& box);

}  // namespace trammel
