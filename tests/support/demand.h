#pragma once

#include <cstdio>
#include <cstdlib>
#include <utility>

#include "server/base/result.h"

namespace trammel::test {

/// The value of a Result that a test needs to go on. On an error it prints the error to standard
/// error and ends.
template <typename T>
[[nodiscard]] T demand(Result<T> result) {
  if (!result) {
    fmt::print(stderr, "{}\n", result.error().message);
    std::abort();
  }
  return std::move(*result);
}

}  // namespace trammel::test
