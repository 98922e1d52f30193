#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>

#include "server/base/result.h"

namespace trammel {

/// The size and depth that a JSON text from outside may have. A parser may need twenty times the
/// memory of the text, and it copies and frees its tree by recursion. So the text is scanned first,
/// without allocating and without recursion.
struct JsonLimits {
  std::size_t bytes = std::size_t{256} << 20;
  std::size_t depth = 16;                         ///< of arrays and objects inside one another
  std::size_t values = 4'000'000;                 ///< numbers, texts, true, false, null
  std::size_t containers = 200'000;               ///< arrays and objects
  std::size_t members = 1'000'000;                ///< of all objects together
  std::size_t text_bytes = std::size_t{1} << 20;  ///< of one text
  std::size_t scalar_bytes = 64;                  ///< of one number
};

/// Refuses a text beyond the limits (kTooLarge) and names the limit. Does not check whether the
/// text is valid JSON: the parser does.
[[nodiscard]] Status check_json_limits(std::string_view json, const std::string& where,
                                       const JsonLimits& limits = {});

/// The members of the JSON object `json`. Each value is the part of the text that holds it. Refuses
/// a text beyond the limits, a text that is not an object, and a key that is repeated or holds an
/// escape.
[[nodiscard]] Result<std::map<std::string, std::string_view>> json_members(
    std::string_view json, const std::string& where, const JsonLimits& limits = {});

}  // namespace trammel
