#pragma once

#include <functional>
#include <string>

#include "server/base/result.h"

namespace trammel {

/// Has `make` write the file `part` beside `path`, and gives it that name only once it is whole and
/// on the disk. Refuses a `path` that is there already.
[[nodiscard]] Status make_store_file(const std::string& path,
                                     const std::function<Status(const std::string& part)>& make);

}  // namespace trammel
