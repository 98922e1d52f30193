#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "server/base/result.h"
#include "server/compensate/model_parts.h"

namespace trammel::model_file {

/// The parts in `content` and `stamp` of a model file (MODEL_FILE.md); `where` names the file in
/// messages. Refuses a cell, a robot or error sources that this program does not know, parameters
/// that do not match the error sources, and a bias that would now answer differently. Throws
/// exceptions of nlohmann if a key is missing or a value is of the wrong kind.
[[nodiscard]] Result<ModelParts> parts_from(const nlohmann::json& content,
                                            const nlohmann::json& stamp, const std::string& where);

}  // namespace trammel::model_file
