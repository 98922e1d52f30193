#pragma once

#include <string>

#include "server/base/result.h"

namespace trammel {

/// Whether a store could be opened at `path`, as far as can be told without changing or creating anything: its folder
/// is there and may be written to, the file, if any, is a store of a schema that this program knows, and nobody else
/// writes it (kConflict). What stands in pages beyond the first is looked at when it is opened.
[[nodiscard]] Status check_store(const std::string& path);

}  // namespace trammel
