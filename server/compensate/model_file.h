#pragma once

#include <string>

#include "server/compensate/compensated_model.h"

namespace trammel {

/// SHA-256 of everything that decides what the model answers and where it comes from, except the moment it was made.
[[nodiscard]] std::string content_hash(const CompensatedModel::Parts& parts);

}  // namespace trammel
