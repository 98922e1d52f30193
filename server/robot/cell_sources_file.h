#pragma once

#include <string>
#include <vector>

#include "server/base/result.h"

namespace trammel {

/// The text of a cell file whose list `model: error_sources` reads `sources`; every other byte stays as it is. Comments
/// inside the list itself go with it. Refuses what is not a cell file's text, and a list that it cannot find its way in
/// (behind an anchor, or a key of a flow mapping over several lines that has no list yet); `where` names the file.
[[nodiscard]] Result<std::string> with_error_sources(const std::string& cell_yaml,
                                                     const std::vector<std::string>& sources, const std::string& where);

}  // namespace trammel
