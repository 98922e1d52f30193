#pragma once

#include <string>
#include <vector>

#include "server/base/result.h"

namespace trammel {

/// The text of a cell file with `model: error_sources` set to `sources`. Every other byte stays;
/// comments inside the list are lost. Refuses a text that is not a cell file, and two layouts: a
/// list behind an anchor, and a flow mapping `model` over several lines that has no list yet.
/// `where` names the file in messages.
[[nodiscard]] Result<std::string> with_error_sources(const std::string& cell_yaml,
                                                     const std::vector<std::string>& sources,
                                                     const std::string& where);

}  // namespace trammel
