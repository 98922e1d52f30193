#pragma once

#include <string>
#include <vector>

#include "clients/cam/cell_tools.h"
#include "clients/cam/dialect.h"
#include "server/base/result.h"
#include "server/compensate/compensated_model.h"
#include "server/exchange/answer.h"

/// What a robot program needs of a model, on the command line and in the service.
namespace trammel::cam {

/// `model` outlives it.
[[nodiscard]] CellTools tools_of(const CompensatedModel& model);
[[nodiscard]] exchange::ModelInfo info_of(const CompensatedModel& model);

struct ToolAndPayload {
  std::string tool, payload;
};
/// The tool and payload of a program, by the cell's names; empty: its only ones. Refuses those that
/// the model was not trained with.
[[nodiscard]] Result<ToolAndPayload> known_tool_and_payload(const CompensatedModel& model,
                                                            const std::string& tool,
                                                            const std::string& payload);

/// Pulses of a degree of the six axes of a Yaskawa job, from the cell's robot file; empty: it has
/// none, or a rail, which has no place among the six axes of a job.
[[nodiscard]] Result<std::vector<double>> pulses_of_job(const Cell& cell);

/// The refusal of files in which no motion of this dialect was found. `where` names them.
[[nodiscard]] Failure no_motion_in(const std::vector<SourceFile>& files, Dialect dialect,
                                   const std::string& where);

}  // namespace trammel::cam
