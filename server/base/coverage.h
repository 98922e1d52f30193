#pragma once

/// How many standard deviations people are told.
namespace trammel {

/// U = k u, everywhere that a number is said with its uncertainty (`u95`, U(k=2), ±): two standard uncertainties.
constexpr double kExpanded = 2;
/// Half width of a normal distribution's 95 % interval, to count what lies inside (`coverage_95`).
constexpr double kInterval95 = 1.959963984540;

}  // namespace trammel
