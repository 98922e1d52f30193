#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "server/robot/pose.h"

/// The forms in which controllers and files describe an orientation by three numbers.
namespace trammel {

/// One form: three turns about axes of the frame, or a rotation vector.
struct ThreeNumbers {
  std::string name;     ///< after "as ": `A B C`, `turns about x, z, y`, `a rotation vector`
  std::string meaning;  ///< for people who do not know the maker; empty if the name explains the
                        ///< form
  /// Columns with exactly this meaning, in lower case: `a`, `b`, `c`. Empty: none.
  std::vector<std::array<std::string, 3>> columns;
  std::array<int, 3> axes = {};  ///< of the turns; each turns about the axis after the previous
                                 ///< turns
  bool from_behind = false;      ///< the last number belongs to the first turn
  bool is_vector = false;        ///< a rotation vector, which has no turns

  [[nodiscard]] Eigen::Quaterniond rotation(const Vector3& rad) const;
  /// The numbers (within half a turn) that describe R, the smaller ones first. Turns have two
  /// solutions.
  [[nodiscard]] std::array<Vector3, 2> numbers(const Matrix3& R) const;
  /// The columns in the spelling of people: `A, B, C`. Empty if no columns have this meaning.
  [[nodiscard]] std::string columns_text() const;
};

/// The forms of controllers, which have columns, then all other orders of turns about x, y and z.
[[nodiscard]] const std::vector<ThreeNumbers>& ways_of_three_numbers();
/// The form of these columns (in lower case, without units): `rvx`, `rvy`, `rvz`.
[[nodiscard]] const ThreeNumbers* way_of_columns(const std::array<std::string, 3>& columns);

}  // namespace trammel
