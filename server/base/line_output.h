#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "server/base/mutex.h"

namespace trammel {

/// Lines to a descriptor whose reader may have stopped reading: a pipe, a terminal, a socket. Never
/// waits, and never raises a signal of its own (a process that ignores SIGPIPE gets none at all).
/// Drops lines that cannot be written; the next written line states how many were dropped.
/// Thread-safe.
class LineOutput {
 public:
  /// `descriptor` stays open and its flags, which other processes may share, stay as they are.
  explicit LineOutput(int descriptor);
  ~LineOutput();
  LineOutput(const LineOutput&) = delete;
  LineOutput& operator=(const LineOutput&) = delete;

  /// `line` with its line end.
  void write(std::string_view line);
  /// Dropped lines that no written line has reported yet.
  [[nodiscard]] std::uint64_t dropped() const;

 private:
  /// True if all of the text was written.
  [[nodiscard]] bool put(std::string_view text) TRAMMEL_REQUIRES(mutex_);
  /// Bytes that went at once; below 0: none.
  [[nodiscard]] long put_part(std::string_view part) const;

  const int descriptor_;
  int own_ =
      -1;  // the same pipe or terminal, opened again so as not to wait; below 0: it cannot be
  bool is_socket_ = false;
  bool is_file_ = false;
  mutable Mutex mutex_;
  std::uint64_t dropped_ TRAMMEL_GUARDED_BY(mutex_) = 0;
  bool within_line_ TRAMMEL_GUARDED_BY(mutex_) = false;  // of the last line a part went
};

}  // namespace trammel
