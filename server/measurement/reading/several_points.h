#pragma once

#include <optional>

#include "server/base/result.h"
#include "server/measurement/reading/number_table.h"

namespace trammel::reading {

/// Doubts rows at one joint vector with places far apart, if most such vectors have this: several
/// reflectors share a name, or something changed in between. Their average would be a place where
/// nothing is. If such rows do not follow each other and are few, they may be a check for changes.
[[nodiscard]] std::optional<Error> doubt_of_several_points(const NumberTable& table);

}  // namespace trammel::reading
