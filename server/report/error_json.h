#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "server/base/result.h"

namespace trammel {

/// The members of an error that are known, and the whole sentence.
[[nodiscard]] nlohmann::ordered_json error_json(const Error& error);

/// JSON as a text that a terminal can show: characters that would control it are escaped.
[[nodiscard]] std::string json_text(const nlohmann::ordered_json& value);

}  // namespace trammel
