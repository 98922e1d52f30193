#pragma once

#include <optional>

namespace trammel {

enum class LengthUnit { kMillimetre, kMetre, kInch };
enum class Coordinates { kCartesian, kCylindrical, kSpherical };
/// What the three numbers behind the coordinates are.
enum class BehindCoordinates { kUncertainties, kFixedXyz, kEulerZyx };

/// What a file may leave unsaid. A file that says otherwise is refused.
struct PointFileOptions {
  std::optional<LengthUnit> unit;          ///< else what the file says, else mm
  std::optional<Coordinates> coordinates;  ///< else what the file says, else cartesian
  std::optional<BehindCoordinates> behind;
  double coverage = 1;  ///< uncertainties in the file are this many standard deviations
};

}  // namespace trammel
