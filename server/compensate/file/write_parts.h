#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "server/compensate/model_parts.h"

namespace trammel::model_file {

/// The `content` of a model file (MODEL_FILE.md): all that decides the model's answers and states
/// its origin, except the time when it was made.
[[nodiscard]] nlohmann::json content_of(const ModelParts& parts);

/// The `stamp`: the time when the model was made, and the program that made it.
[[nodiscard]] nlohmann::json stamp_of(const ModelProvenance& provenance);

/// SHA-256 of the content, in hexadecimal digits.
[[nodiscard]] std::string content_hash(const ModelParts& parts);

}  // namespace trammel::model_file
