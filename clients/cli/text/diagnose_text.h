#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "server/tasks/train/extend.h"

/// A diagnosis told to a metrologist.
namespace trammel::cli {

/// The text for the output of `diagnose --json`, from any source: the verdict, the findings, the
/// open questions, the next poses to measure.
[[nodiscard]] std::string diagnosis_text(const nlohmann::ordered_json& diagnosis);

/// The poses suggested next, as a plan: `pose_id`, joints in deg (rails mm).
[[nodiscard]] std::string next_poses_csv(const nlohmann::ordered_json& diagnosis);

/// Held-out figures without and with the causes found, a line each, mm.
[[nodiscard]] std::string extension_text(const Extension& extension);
[[nodiscard]] nlohmann::ordered_json extension_json(const Extension& extension);

}  // namespace trammel::cli
