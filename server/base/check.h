#pragma once

namespace trammel {
[[noreturn]] void check_failed(const char* condition, const char* file, int line);
}  // namespace trammel

/// For bugs, not for bad input: prints the place and aborts, in every build.
#define TRAMMEL_CHECK(condition) \
  ((condition) ? static_cast<void>(0) : ::trammel::check_failed(#condition, __FILE__, __LINE__))
