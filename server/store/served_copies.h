#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "server/base/mutex.h"
#include "server/base/result.h"

namespace trammel {

/// The last models in force of each cell as plain files, which are served when the store cannot be
/// read. They are in `<root>/<id of the store>/<hash of the cell's name>/`, one file per version,
/// the newest three. For a file store the root is `<store>.models`. Thread-safe; one thread at a
/// time writes the copies of a cell.
class ServedCopies {
 public:
  /// Without a root there are no copies.
  explicit ServedCopies(std::string root) : root_(std::move(root)) {}

  struct Copy {
    std::int64_t activation =
        0;  ///< number of the activation that put it in force: the larger, the newer
    int version = 0;
    std::string file;
  };
  /// The stores from which copies were made. The most recently written one comes first.
  [[nodiscard]] std::vector<std::string> stores() const;
  /// Assigns the copies to this store from now on. If it is `served`, it gets a folder even before
  /// its first copy.
  [[nodiscard]] Status belong_to(const std::string& store, bool served);
  /// Newest first; none where they cannot be read.
  [[nodiscard]] std::vector<Copy> of(const std::string& cell) const;
  [[nodiscard]] std::vector<std::string> files_of(const std::string& cell, int version) const;
  /// On disk when it returns. Replaces an older copy of the same version.
  [[nodiscard]] Status keep(const std::string& cell, std::int64_t activation, int version,
                            const std::string& content) const;
  /// Removes copies that were put in force later, since that part of the history no longer exists.
  void forget_after(const std::string& cell, std::int64_t activation) const;
  [[nodiscard]] const std::string& root() const { return root_; }
  /// The id of the store of these copies; empty: not known yet.
  [[nodiscard]] std::string store() const;

 private:
  /// The folder of the store's copies; empty: not known yet.
  [[nodiscard]] std::string folder() const;
  [[nodiscard]] std::string folder(const std::string& cell) const;

  const std::string root_;
  mutable Mutex mutex_;
  std::string store_ TRAMMEL_GUARDED_BY(mutex_);  // empty: not known yet
};

}  // namespace trammel
