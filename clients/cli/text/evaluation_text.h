#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "server/compensate/compensated_model.h"

/// An evaluation and a model, told to people and to programs.
namespace trammel::cli {

/// `nominal`, `calibrated` and `compensated`, a line each, mm.
[[nodiscard]] std::string evaluation_table(const Evaluation& evaluation);
/// A row per pose: errors (measured - predicted, in B) with and without the bias, stated standard
/// deviations, errors over them, and whether the pose is a suspect: farther off than one in a
/// million.
[[nodiscard]] std::string residuals_csv(const MeasurementBatch& batch,
                                        const CompensatedModel::LevelErrors& errors);
/// A row for each row of the batch with one number: errors of that number, in the same form.
[[nodiscard]] std::string gauge_residuals_csv(const MeasurementBatch& batch,
                                              const CompensatedModel::GaugeErrors& errors);
/// A sentence if the residual of the calibrated model at these poses is not noise; empty if it may
/// be.
[[nodiscard]] std::string structure_note(const CompensatedModel& model,
                                         const MeasurementBatch& batch,
                                         const CompensatedModel::LevelErrors& errors);
/// The keys of `evaluate --json`.
[[nodiscard]] nlohmann::ordered_json evaluation_json(const Evaluation& evaluation);

/// Id, level, batch and the undetermined combinations.
[[nodiscard]] std::string model_text(const CompensatedModel& model);
/// Provenance, parameters with U(k=2), undetermined combinations, errors at three levels.
[[nodiscard]] nlohmann::ordered_json model_json(const CompensatedModel& model);

}  // namespace trammel::cli
