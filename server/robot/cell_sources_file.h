#pragma once

#include <string>
#include <vector>

#include "server/base/result.h"

namespace trammel {

/// The text of a cell file whose list `model: error_sources` reads `sources`; every other byte
/// stays as it is. Comments inside the list itself go with it. Refuses a text that is no cell file,
/// and two layouts that it does not support: a list behind an anchor, and a flow mapping `model`
/// over several lines that has no list yet. `where` names the file.
[[nodiscard]] Result<std::string> with_error_sources(const std::string& cell_yaml,
                                                     const std::vector<std::string>& sources,
                                                     const std::string& where);

}  // namespace trammel
