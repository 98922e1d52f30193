#pragma once

#include <string>
#include <utility>

#include "server/base/result.h"

namespace trammel {

/// Held by the one process that may write a file: an flock on `<file>.lock`, which says the holder's process id. The
/// kernel lets go of it when the process ends, however it ends; the lock file itself stays.
class WriterLock {
 public:
  /// Refuses (kConflict) when somebody has it already, this process included. Links and relative paths to the same file
  /// meet at one lock.
  [[nodiscard]] static Result<WriterLock> take(const std::string& file);
  /// Refuses (kConflict) when somebody has it; takes nothing and leaves no file.
  [[nodiscard]] static Status look(const std::string& file);
  WriterLock(WriterLock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  WriterLock& operator=(WriterLock&&) = delete;
  ~WriterLock();

 private:
  explicit WriterLock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_;
};

}  // namespace trammel
