#pragma once

namespace trammel::wire {

/// While one lives, what the library says of an error is not shown: for what it may refuse, and is
/// asked all the same.
class QuietLibrary {
 public:
  QuietLibrary();
  ~QuietLibrary();
  [[nodiscard]] static bool lives();
  QuietLibrary(const QuietLibrary&) = delete;
  QuietLibrary& operator=(const QuietLibrary&) = delete;
};

}  // namespace trammel::wire
