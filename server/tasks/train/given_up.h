#pragma once

#include "server/base/result.h"

namespace trammel {

/// The failure of a training whose progress was answered with false.
[[nodiscard]] inline Failure given_up() {
  return failure(ErrorCode::kBusy, "training given up on request");
}

}  // namespace trammel
