#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "server/calibrate/instruments/circle_point.h"
#include "server/calibrate/instruments/deflection.h"

/// The measured geometry and stiffness of a robot, told to people and to programs.
namespace trammel::cli {

/// Three tables: the fit of the arcs, lengths, angles (the source's Tables 4.3, 4.4 and 4.5), then
/// the unmeasured values.
[[nodiscard]] std::string circle_point_text(const CirclePointResult& result);
[[nodiscard]] nlohmann::ordered_json circle_point_json(const CirclePointResult& result);
/// `parameter,unit,nominal,deviation,u95,measured,note`, a row a parameter.
[[nodiscard]] std::string circle_point_csv(const CirclePointResult& result);

/// For each element the parameters and errors of both models (Tables 4.8 to 4.13) and their
/// conclusion about the link; then the errors of all elements together (Table 4.14).
[[nodiscard]] std::string deflection_text(const DeflectionResult& result);
[[nodiscard]] nlohmann::ordered_json deflection_json(const DeflectionResult& result);

}  // namespace trammel::cli
