#pragma once

#include <string>

#include "server/base/units.h"
#include "server/error_sources/error_source.h"

/// Parameters in the units for people.
namespace trammel {

[[nodiscard]] inline Parameter length_parameter(std::string name, double prior_scale_mm) {
  return {std::move(name), "mm", to_mm(1), 0, from_mm(prior_scale_mm)};
}

[[nodiscard]] inline Parameter angle_parameter(std::string name, double prior_scale_rad) {
  return {std::move(name), "rad", 1, 0, prior_scale_rad};
}

/// A joint compliance: not negative; `prior` in rad/Nm.
[[nodiscard]] inline Parameter compliance_parameter(std::string name, double prior) {
  return {std::move(name), "rad/Nmm", to_rad_per_nmm(1), prior, from_rad_per_nmm(1e-8), 0.0};
}

}  // namespace trammel
