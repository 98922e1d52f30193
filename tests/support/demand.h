#pragma once

#include <cstdio>
#include <cstdlib>
#include <utility>

#include "server/base/result.h"

namespace trammel::test {

/// What a test cannot go on without: the value, or the error on standard error and the end.
template <typename T>
[[nodiscard]] T demand(Result<T> result) {
  if (!result) {
    fmt::print(stderr, "{}\n", result.error().message);
    std::abort();
  }
  return std::move(*result);
}

}  // namespace trammel::test
