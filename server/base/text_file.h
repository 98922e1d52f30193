#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/base/result.h"

namespace trammel {

/// The whole file. Refuses one that is missing, a folder, or larger than `limit_bytes`.
[[nodiscard]] Result<std::string> read_text_file(const std::string& path, std::size_t limit_bytes = 1u << 28);
/// Unix time, s, of the last change of the file; now, of one that has none.
[[nodiscard]] std::int64_t written_at(const std::string& path);
/// Writes beside the file and renames, so that a reader sees the old text or the new, never a part. Follows links; a
/// device or a pipe is written to as it is.
[[nodiscard]] Status write_text_file(const std::string& path, const std::string& text);

struct TextFile {
  std::string path, text;
};
/// Several files that belong together, each as write_text_file() does: every text lies beside its file before the first
/// one is renamed, so that a full disk changes none of them. A renaming that fails even so ends it; the message names
/// the files that are new by then. No two may be the same file.
[[nodiscard]] Status write_text_files(const std::vector<TextFile>& files);
/// Whether it seems that the file can be written: it is no folder, and it and its folder may be written to.
[[nodiscard]] Status check_writable(const std::string& path);

}  // namespace trammel
