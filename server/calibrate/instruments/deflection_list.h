#pragma once

#include <Eigen/Dense>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"

/// Readings of reflectors along an arm while weights hung from its flange, as measured.
namespace trammel {

/// The motion of one reflector under one load, against the arm without load. x horizontal and
/// outward, z up.
struct DeflectionReading {
  int element = 0;                                  ///< number of the joint, from 1
  double load = 0;                                  ///< N, straight down
  double x = 0;                                     ///< m, along the element from its joint
  Eigen::Vector2d moved = Eigen::Vector2d::Zero();  ///< dx, dz, m
  std::optional<double> sigma;                      ///< m, of one coordinate
  std::optional<bool> validation;                   ///< the choice of the file
  int row = 0;
};

/// The pose of an element while the loads hung.
struct DeflectionElement {
  int element = 0;
  double theta = 0;   ///< rad, of the link above the horizontal
  double length = 0;  ///< m, from this joint to the next
  double lever = 0;   ///< m, horizontally from the link's far end to the line the load hangs on
};

struct DeflectionData {
  std::string where;
  std::vector<DeflectionElement> elements;  ///< from the base outward
  std::vector<DeflectionReading> readings;
};

/// Reads `element,load_n,x_mm,dx_mm,dz_mm,theta_deg,length_mm,lever_mm` with optional `sigma_mm`
/// and `set` (train, validation). Refuses a missing column, a value that is not a number, an
/// element whose angle, length or lever changes, and a sigma or length that is not positive. The
/// error names file, row, value and limit.
[[nodiscard]] Result<DeflectionData> parse_deflection_csv(const std::string& text,
                                                          const std::string& where);
[[nodiscard]] Result<DeflectionData> read_deflection_csv(const std::string& path);

}  // namespace trammel
