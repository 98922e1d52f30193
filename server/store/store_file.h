#pragma once

#include <sys/stat.h>

#include <optional>
#include <string>

#include "server/base/result.h"

namespace trammel {

/// The file under a store's name, which other programs can remove, replace or write. It records the
/// file's identity and the state in which this process left it, and makes sure that no other
/// process writes it. It never opens a file that SQLite has open, since closing that would release
/// SQLite's locks. Instead it holds one descriptor from before SQLite opens the file until after
/// SQLite has closed it.
class StoreFile {
 public:
  explicit StoreFile(std::string path) : path_(std::move(path)) {}
  ~StoreFile();
  StoreFile(StoreFile&& other) noexcept;
  StoreFile& operator=(StoreFile&&) = delete;

  /// Locks the file that is now at the path, under all of its names. Does nothing if there is no
  /// file, or none that can be opened. Refuses (kConflict) a file that another process writes.
  [[nodiscard]] Status hold();
  /// Remembers the state of the file that is held: SQLite has just written it, or has just opened
  /// it.
  void remember();

  enum class Finding {
    kAsLeft,   ///< the same, untouched
    kTouched,  ///< the same store, but another program wrote it, or only changed its mode or name;
               ///< or its journal is missing
    kGone,     ///< nothing is at the path
    kAnother   ///< another one
  };
  [[nodiscard]] Finding look() const;
  /// A command that restores a missing file, for people; empty: there is none.
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
