#pragma once

#include <string_view>

#include "correct_target.h"
#include "diagnose.h"
#include "manage_models.h"
#include "predict_error.h"
#include "state.h"
#include "training.h"

/// Checks what the generated code does not check when it reads a sample: enumerators and bounds. A sample that is not
/// valid is dropped. Too many targets or joints in a request pass here: the server refuses them with a message.
namespace trammel::wire {

/// Whether the name can be a reply partition: not empty, and without the wildcards of partition names.
[[nodiscard]] bool valid_partition(std::string_view name);

[[nodiscard]] bool valid(const PredictErrorRequest& request);
[[nodiscard]] bool valid(const CorrectTargetRequest& request);
[[nodiscard]] bool valid(const SubmitMeasurementsRequest& request);
[[nodiscard]] bool valid(const TrainRequest& request);
[[nodiscard]] bool valid(const DiagnoseRequest& request);
[[nodiscard]] bool valid(const ManageModelsRequest& request);

[[nodiscard]] bool valid(const PredictErrorReply& reply);
[[nodiscard]] bool valid(const CorrectTargetReply& reply);
[[nodiscard]] bool valid(const SubmitMeasurementsReply& reply);
[[nodiscard]] bool valid(const TrainReply& reply);
[[nodiscard]] bool valid(const DiagnoseReply& reply);
[[nodiscard]] bool valid(const ManageModelsReply& reply);

[[nodiscard]] bool valid(const ModelStatus& status);
[[nodiscard]] bool valid(const TrainingProgress& progress);
[[nodiscard]] bool valid(const ServiceStatus& status);
[[nodiscard]] bool valid(const ModelSnapshot& snapshot);

}  // namespace trammel::wire
