#pragma once

#include <string>

namespace trammel {

struct LogOptions {
  std::string level = "info";   ///< `debug`, `info`, `warn` or `error`
  std::string file;             ///< empty: standard error
  std::string format = "text";  ///< or `json`: an object a line
};

}  // namespace trammel
