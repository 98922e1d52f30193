#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/base/result.h"

namespace trammel {

/// The whole file. Refuses one that is missing, a folder, or larger than `limit_bytes`.
[[nodiscard]] Result<std::string> read_text_file(const std::string& path,
                                                 std::size_t limit_bytes = 1u << 28);
/// Unix time, s, of the last change of the file; the present time if the file has none.
[[nodiscard]] std::int64_t written_at(const std::string& path);
/// Writes a temporary file beside `path` and renames it, so a reader sees the old text or the new
/// one, never a part. Follows links. Devices and pipes are written in place.
[[nodiscard]] Status write_text_file(const std::string& path, const std::string& text);

struct TextFile {
  std::string path, text;
};
/// Writes several files that belong together, each as write_text_file() does. All temporary files
/// are written before the first rename, so a full disk changes none of them. A rename that fails
/// ends it; the message names the files that are already new. No two may be the same file.
[[nodiscard]] Status write_text_files(const std::vector<TextFile>& files);
/// Checks, without writing, that the file can be written: the path is not a folder, and the file
/// and its folder are writable.
[[nodiscard]] Status check_writable(const std::string& path);

}  // namespace trammel
