#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "server/exchange/answer.h"
#include "server/exchange/history.h"

/// Models and jobs as JSON: the command line and HTTP write the same members. A number that is not
/// known is null.
namespace trammel {

[[nodiscard]] nlohmann::ordered_json model_json(const exchange::ModelInfo& model);
[[nodiscard]] nlohmann::ordered_json models_json(const std::vector<exchange::ModelInfo>& models);
[[nodiscard]] nlohmann::ordered_json job_json(const exchange::JobStatus& job);
[[nodiscard]] nlohmann::ordered_json jobs_json(const std::vector<exchange::DatedJob>& jobs);

}  // namespace trammel
