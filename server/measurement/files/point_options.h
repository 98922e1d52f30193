#pragma once

#include <optional>

namespace trammel {

enum class LengthUnit { kMillimetre, kMetre, kInch };
enum class Coordinates { kCartesian, kCylindrical, kSpherical };
/// The meaning of the three numbers after the coordinates.
enum class BehindCoordinates { kUncertainties, kFixedXyz, kEulerZyx };

/// Facts that a file may leave out. A file that contradicts them is refused.
struct PointFileOptions {
  std::optional<LengthUnit> unit;          ///< empty: as the file says, else mm
  std::optional<Coordinates> coordinates;  ///< empty: as the file says, else cartesian
  std::optional<BehindCoordinates> behind;
  double coverage = 1;  ///< uncertainties in the file are this many standard deviations
};

}  // namespace trammel
