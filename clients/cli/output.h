#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "server/base/result.h"

namespace trammel::cli {

/// Writes `text` whole or not at all; `-` is standard output.
[[nodiscard]] Status write_output(const std::string& path, const std::string& text);

/// Writes `value` where --json says; nothing when it was not given (empty path).
[[nodiscard]] Status write_json(const std::string& path, const nlohmann::ordered_json& value);

/// Text for people on standard output, left out when a result for programs goes there (`paths`: where results go).
void tell(const std::string& text, std::initializer_list<std::string> paths);

/// One line on standard error that is written over as work goes on. Silent where standard error is no terminal.
class ProgressLine {
 public:
  ProgressLine();
  ~ProgressLine();  ///< clears the line
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  /// `share` of all the work done, in [0, 1].
  void show(const std::string& what, double share);

 private:
  bool terminal_;
  std::string shown_;
};

}  // namespace trammel::cli
