#pragma once

#include <optional>

#include "server/base/result.h"
#include "server/measurement/reading/number_table.h"

namespace trammel::reading {

/// Doubts rows that have one joint vector but places far apart, if most repeated vectors show this.
/// Several reflectors share a name, or something changed in between. The average would be a place
/// without a reflector. If such rows do not follow each other and are few, they may be a check for
/// changes.
[[nodiscard]] std::optional<Error> doubt_of_several_points(const NumberTable& table);

}  // namespace trammel::reading
