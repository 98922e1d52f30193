#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "clients/cam/predict_program.h"

/// Where the tool goes with a program, as text.
namespace trammel::cli {

/// A line a target: its place in the program, `x_mm` ... where the program wants the tool, `px_mm`
/// ... where it will be, both in the robot's base, the error, and the standard deviations of the
/// true error along the base's axes.
[[nodiscard]] std::string prediction_csv(const cam::PredictedProgram& program);
[[nodiscard]] nlohmann::ordered_json prediction_json(const cam::PredictedProgram& program);
/// How many targets, how large the errors; and what nothing can be said of.
[[nodiscard]] std::string prediction_summary(const cam::PredictedProgram& program);

}  // namespace trammel::cli
