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
/// The number of targets, the size of the errors, and the targets of which nothing can be said.
[[nodiscard]] std::string prediction_summary(const cam::PredictedProgram& program);

}  // namespace trammel::cli
