#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>

#include "server/base/result.h"

namespace trammel {

/// What a JSON text from outside may hold. A parser asks for some twenty times the text's size at worst, and what it
/// made is copied and freed by recursion: so the bytes are counted first, without memory and without recursion.
struct JsonLimits {
  std::size_t bytes = std::size_t{256} << 20;
  std::size_t depth = 16;                         ///< of arrays and objects inside one another
  std::size_t values = 16'000'000;                ///< numbers, texts, true, false, null
  std::size_t containers = 200'000;               ///< arrays and objects
  std::size_t members = 1'000'000;                ///< of all objects together
  std::size_t text_bytes = std::size_t{1} << 20;  ///< of one text
  std::size_t scalar_bytes = 64;                  ///< of one number
};

/// Refuses a text beyond the limits (kTooLarge), naming what there is too much of. Not whether it is JSON: that is the
/// parser's question.
[[nodiscard]] Status check_json_limits(std::string_view json, const std::string& where, const JsonLimits& limits = {});

/// The members of the object that `json` is, each value as its bytes stand in the text. Refuses what is beyond the
/// limits, what is no object, and a key that comes twice or holds an escape.
[[nodiscard]] Result<std::map<std::string, std::string_view>> json_members(std::string_view json,
                                                                           const std::string& where,
                                                                           const JsonLimits& limits = {});

}  // namespace trammel
