#pragma once

#include <string_view>

#include "clients/cam/rapid/syntax.h"

namespace trammel::cam::rapid {

/// Never fails: a part that is not understood is missing.
[[nodiscard]] Module parse(std::string_view text);

}  // namespace trammel::cam::rapid
