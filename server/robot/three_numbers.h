#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "server/robot/pose.h"

/// How controllers and files tell an orientation by three numbers.
namespace trammel {

/// One way: three turns about axes of the frame, or a rotation vector.
struct ThreeNumbers {
  std::string name;     ///< after "as ": `A B C`, `turns about x, z, y`, `a rotation vector`
  std::string meaning;  ///< for people who do not know the maker; empty where the name says it
  /// Columns that mean this way and no other, in lower case: `a`, `b`, `c`. Empty: none.
  std::vector<std::array<std::string, 3>> columns;
  std::array<int, 3> axes = {};  ///< of the turns, each about the axis as turned so far
  bool from_behind = false;      ///< the last number is of the first turn
  bool is_vector = false;        ///< a rotation vector, which has no turns

  [[nodiscard]] Eigen::Quaterniond rotation(const Vector3& rad) const;
  /// The numbers (within half a turn) that tell R, the smaller ones first: of turns there are two.
  [[nodiscard]] std::array<Vector3, 2> numbers(const Matrix3& R) const;
  /// The columns as people write them: `A, B, C`. Empty where no columns mean this way.
  [[nodiscard]] std::string columns_text() const;
};

/// The ways of controllers, which have columns, then all other orders of turns about x, y and z.
[[nodiscard]] const std::vector<ThreeNumbers>& ways_of_three_numbers();
/// The way that these columns (in lower case, without units) mean: `rvx`, `rvy`, `rvz`.
[[nodiscard]] const ThreeNumbers* way_of_columns(const std::array<std::string, 3>& columns);

}  // namespace trammel
