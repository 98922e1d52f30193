#pragma once

namespace trammel {
[[noreturn]] void check_failed(const char* condition, const char* file, int line);
}  // namespace trammel

/// A bug, not bad input: prints where and aborts, in every build.
#define TRAMMEL_CHECK(condition) \
  ((condition) ? static_cast<void>(0) : ::trammel::check_failed(#condition, __FILE__, __LINE__))
