#pragma once

#include <string>
#include <vector>

/// Lists of error sources for people; files, JSON and command line have their spellings
/// (spelling.h).
namespace trammel {

/// `link geometry, gear ripple in joint 3` for {`geometry`, `gear_transmission:3@48`}.
[[nodiscard]] std::string causes_in_words(const std::vector<std::string>& spellings);

/// `link geometry, gear ripple in joint 3` for a level as models have it:
/// `geometry,gear_transmission:3`; `none` where it is empty.
[[nodiscard]] std::string level_in_words(const std::string& level);

}  // namespace trammel
