#pragma once

/// Coverage factors of the uncertainties that are reported.
namespace trammel {

/// Coverage factor k of every expanded uncertainty U = k u that is reported (`u95`, U(k=2), ±).
constexpr double kExpanded = 2;
/// Half width of the 95 % interval of a normal distribution, in standard deviations. Used to count
/// how many values lie inside (`coverage_95`).
constexpr double kInterval95 = 1.959963984540;

}  // namespace trammel
