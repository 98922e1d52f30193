#pragma once

#include <sys/stat.h>

#include <optional>
#include <string>

#include "server/base/result.h"

namespace trammel {

/// The file under a store's name, which other programs can remove, replace or write: which one it
/// is, how this process left it, and that no other process writes it. Opens no file that SQLite has
/// open, for closing that would give SQLite's locks up: it holds one descriptor from before SQLite
/// opens the file until after SQLite has closed it.
class StoreFile {
 public:
  explicit StoreFile(std::string path) : path_(std::move(path)) {}
  ~StoreFile();
  StoreFile(StoreFile&& other) noexcept;
  StoreFile& operator=(StoreFile&&) = delete;

  /// Locks the file that is at the path now, by whatever names it can be reached. Nothing to do
  /// where there is none, or none that can be opened. Refuses (kConflict) one that another process
  /// writes.
  [[nodiscard]] Status hold();
  /// Remembers the state of the file that is held: SQLite has just written it, or has just opened
  /// it.
  void remember();

  enum class Finding {
    kAsLeft,   ///< the same, untouched
    kTouched,  ///< the same, but another program wrote it, or only gave it another mode or name; or
               ///< its journal is gone
    kGone,     ///< nothing is at the path
    kAnother   ///< another one
  };
  [[nodiscard]] Finding look() const;
  /// A command that brings back a file that is gone, for people; empty: there is none.
  [[nodiscard]] std::string how_to_bring_back() const;

 private:
  struct Left {
    struct stat about {};
    std::string header;
    ino_t journal = 0;  // 0: it has none
  };
  [[nodiscard]] Left now(const struct stat& about) const;

  std::string path_;
  int descriptor_ = -1;
  std::optional<Left> left_;
};

}  // namespace trammel
