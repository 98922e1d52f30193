#pragma once

#include <nlohmann/json_fwd.hpp>

#include "server/base/result.h"

namespace trammel::model_file {

/// Refuses texts and keys of a model file that no message, terminal or page can carry: too long, or
/// not plain (plain_text.h). Refuses times before 1970 and after 9999. Looks at all of `content`
/// and `stamp`, whatever their keys, except the cell's and robot's files and the error sources,
/// which their readers check.
[[nodiscard]] Status check_texts(const nlohmann::json& content, const nlohmann::json& stamp);

}  // namespace trammel::model_file
