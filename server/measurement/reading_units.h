#pragma once

#include <array>

/// Units that numbers are told in by mistake.
namespace trammel {

/// The largest angle, told in radians, that a robot's joint has: two half turns and a little. A
/// column of degrees that nowhere is beyond it may be one of radians.
inline constexpr double kMostRadians = 6.4;

/// A unit of lengths that should have been mm.
struct UnitOfLength {
  const char* name;
  double factor;  ///< mm in one of it
};
inline constexpr std::array<UnitOfLength, 4> kUnitsOfLength = {
    UnitOfLength{"metres", 1000}, {"inches", 25.4}, {"centimetres", 10}, {"um", 1e-3}};

}  // namespace trammel
