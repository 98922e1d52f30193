#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// The comment in a corrected program that says so.
namespace trammel::cam {

struct Mark {
  std::string model;     ///< id
  std::string version;   ///< version of this software
  std::string date;      ///< 2026-11-22
  std::string original;  ///< first 16 digits of the SHA-256 of the bytes before (UTF-16: as UTF-8)
};

[[nodiscard]] std::string short_hash(std::string_view bytes);
/// The words of a mark, in their order in comments.
[[nodiscard]] std::vector<std::string> words_of(const Mark& mark);
/// `it is corrected already, by model 1a2b3c on 2026-01-07`
[[nodiscard]] std::string mark_text(const Mark& mark);
/// The mark of a text in any dialect; empty where there is none.
[[nodiscard]] std::optional<Mark> find_mark(std::string_view text);

/// Beside a corrected program: its bytes before.
[[nodiscard]] std::string original_path(const std::string& path);

}  // namespace trammel::cam
