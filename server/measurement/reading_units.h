#pragma once

#include <array>

/// Units in which numbers are given by mistake.
namespace trammel {

/// The largest angle of a robot's joint in radians: two half turns and a little. A column of
/// degrees that never exceeds it may be in radians.
inline constexpr double kMostRadians = 6.4;

/// A unit of lengths that should have been mm.
struct UnitOfLength {
  const char* name;
  double factor;  ///< mm per unit
};
inline constexpr std::array<UnitOfLength, 4> kUnitsOfLength = {
    UnitOfLength{"metres", 1000}, {"inches", 25.4}, {"centimetres", 10}, {"um", 1e-3}};

}  // namespace trammel
