#pragma once

#include <string>
#include <utility>

#include "server/base/result.h"

namespace trammel {

/// Held by the one process that may write a file: an flock on `<file>.lock`, which contains the
/// holder's process id. The kernel releases it when the process ends, even after a crash. The lock
/// file itself stays.
class WriterLock {
 public:
  /// Refuses (kConflict) if any process, including this one, already has the lock. Links and
  /// relative paths to the same file share one lock.
  [[nodiscard]] static Result<WriterLock> take(const std::string& file);
  /// Refuses (kConflict) if any process holds the lock, or the file itself by another name. Takes
  /// no lock and leaves no file. Do not call it in a process that has the file open.
  [[nodiscard]] static Status look(const std::string& file);
  WriterLock(WriterLock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  WriterLock& operator=(WriterLock&&) = delete;
  ~WriterLock();

 private:
  explicit WriterLock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_;
};

}  // namespace trammel
