#pragma once

#include <numbers>

/// Inside, quantities are in m, rad, kg, N and s, and names carry no unit. These functions convert
/// at the boundary, and only there.
namespace trammel {

constexpr double kPi = std::numbers::pi;
constexpr double from_mm(double mm) { return mm * 1e-3; }
constexpr double to_mm(double m) { return m * 1e3; }
constexpr double from_deg(double deg) { return deg * kPi / 180.0; }
constexpr double to_deg(double rad) { return rad * 180.0 / kPi; }
/// Joint compliance: rad/Nmm (the source's tables) <-> rad/Nm.
constexpr double from_rad_per_nmm(double c) { return c * 1e3; }
constexpr double to_rad_per_nmm(double c) { return c * 1e-3; }

}  // namespace trammel
