#pragma once

#include <functional>
#include <string>

#include "server/base/result.h"

namespace trammel {

/// Makes `make` write the file `part` beside `path`, and renames it when it is complete and on
/// disk. Refuses an existing `path`.
[[nodiscard]] Status make_store_file(const std::string& path,
                                     const std::function<Status(const std::string& part)>& make);

}  // namespace trammel
