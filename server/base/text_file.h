#pragma once

#include <string>

#include "server/base/result.h"

namespace trammel {

/// The whole file. Refuses one that is missing, a folder, or larger than `limit_bytes`.
[[nodiscard]] Result<std::string> read_text_file(const std::string& path, std::size_t limit_bytes = 1u << 28);
/// Writes beside the file and renames, so that a reader sees the old text or the new, never a part. Follows links; a
/// device or a pipe is written to as it is.
[[nodiscard]] Status write_text_file(const std::string& path, const std::string& text);

}  // namespace trammel
