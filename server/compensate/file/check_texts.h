#pragma once

#include <nlohmann/json_fwd.hpp>

#include "server/base/result.h"

namespace trammel::model_file {

/// Refuses texts and keys of a model file that no message, terminal or page can carry: too long,
/// not plain (plain_text.h). And times that are none: before 1970, after 9999. Looks at the whole
/// of `content` and `stamp`, whatever their keys, but at the cell's and robot's files and the error
/// sources, whose readers check them.
[[nodiscard]] Status check_texts(const nlohmann::json& content, const nlohmann::json& stamp);

}  // namespace trammel::model_file
