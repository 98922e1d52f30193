#pragma once

#include <string>

namespace trammel {

/// The settings by which requests and answers are kept for `trammel replay`.
struct RecordOptions {
  std::string folder;  ///< empty: it is not
  int max_mb = 100;    ///< of all files; the oldest goes
  bool operator==(const RecordOptions&) const = default;
};

}  // namespace trammel
