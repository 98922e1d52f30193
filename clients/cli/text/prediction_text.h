#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "clients/cam/predict_program.h"

/// The predicted tool positions of a program, as text.
namespace trammel::cli {

/// A line per target: its place in the program, `x_mm` ... the programmed position of the tool,
/// `px_mm` ... the predicted one, both in the robot's base, the error, and the standard deviations
/// of the true error along the base's axes.
[[nodiscard]] std::string prediction_csv(const cam::PredictedProgram& program);
[[nodiscard]] nlohmann::ordered_json prediction_json(const cam::PredictedProgram& program);
/// The number of targets, the size of the errors, and the targets without a prediction.
[[nodiscard]] std::string prediction_summary(const cam::PredictedProgram& program);

}  // namespace trammel::cli
