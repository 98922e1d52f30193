#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace trammel {

/// The temporary path at which `file` is written before it gets its name: `NAME.1234.part` beside
/// NAME, where 1234 is this process.
[[nodiscard]] std::filesystem::path part_beside(const std::filesystem::path& file);
/// The half-written files in a folder, by name, that processes left behind when they ended.
[[nodiscard]] std::vector<std::filesystem::path> leftover_parts(
    const std::filesystem::path& folder);
/// Removes the part files of `file` that nobody has written to for a minute. It goes by age,
/// because processes of other hosts and containers that share the folder cannot be seen.
void remove_leftover_parts(const std::filesystem::path& file);

}  // namespace trammel
