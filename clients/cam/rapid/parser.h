#pragma once

#include <string_view>

#include "clients/cam/rapid/syntax.h"

namespace trammel::cam::rapid {

/// Never fails: what is not understood is not there.
[[nodiscard]] Module parse(std::string_view text);

}  // namespace trammel::cam::rapid
