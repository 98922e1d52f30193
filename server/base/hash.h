#pragma once

#include <string>
#include <string_view>

namespace trammel {

/// SHA-256 of `bytes`, lower-case hex (64 characters).
[[nodiscard]] std::string sha256_hex(std::string_view bytes);

}  // namespace trammel
