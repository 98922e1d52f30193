#pragma once

#include "server/error_sources/error_source.h"

namespace trammel {

/// The other joint that `cause:J@K` names, 0-based; without a K the joint before J, of joint 1 the
/// one after. Refuses where J and K are not two joints that turn.
[[nodiscard]] Result<int> other_joint(const SourceSpec& spec, const Chain& chain);

}  // namespace trammel
