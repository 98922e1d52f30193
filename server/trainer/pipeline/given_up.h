#pragma once

#include "server/base/result.h"

namespace trammel {

/// Of a training whose progress was answered with false.
[[nodiscard]] inline Error given_up() { return {ErrorCode::kBusy, "training given up on request"}; }

}  // namespace trammel
