#pragma once

#include <array>
#include <optional>
#include <string>

#include "server/measurement/files/csv_table.h"
#include "server/measurement/files/point_options.h"

/// Finds the layout of a list of points.
namespace trammel {

/// Our names for columns that tracker software writes beside coordinates: expanded uncertainties
/// (U95, k = 2) of the point and of its axes, the time of the measurement, and the air. Brackets
/// mark columns with numbers.
inline const std::string kU95 = "u95 [point]";
inline const std::array<std::string, 3> kU95Axes = {"u95x [axis]", "u95y [axis]", "u95z [axis]"};
inline const std::string kTimeStamp = "timestamp";
inline const std::array<std::string, 3> kWeather = {"air_temperature [c]", "air_pressure [hpa]",
                                                    "air_humidity [%]"};

/// The statements of the file and of the caller about the layout.
struct Statements {
  std::optional<LengthUnit> unit;
  std::optional<Coordinates> coordinates;
  std::optional<BehindCoordinates> behind;
  std::optional<bool> radians;
};

/// The file as a table with our column names (see parse_points()), and the settings that it states
/// itself.
struct PointTable {
  CsvTable table;
  Statements statements;
  bool positional = false;  ///< had no header line
};

/// Refuses files without a point, rows of another length, and statements that are unknown or
/// contradict `options` or each other.
[[nodiscard]] Result<PointTable> take_apart(const std::string& text, const std::string& where,
                                            const PointFileOptions& options);

/// Our names of the three coordinates, and of their uncertainties, in their order.
using CoordinateNames = std::array<std::string, 3>;
[[nodiscard]] CoordinateNames coordinate_columns(Coordinates coordinates);
[[nodiscard]] CoordinateNames uncertainty_columns(Coordinates coordinates);

}  // namespace trammel
