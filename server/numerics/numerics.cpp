#include "server/numerics/numerics.h"

#include <cstdlib>
#include <string_view>

#include "server/numerics/builds/builds.h"

namespace trammel {

namespace {

/// True where TRAMMEL_NUMERICS asks for an older processor than `build` is for. This gives the
/// results of an older machine.
bool is_too_new(std::string_view build) {
  const char* said = std::getenv("TRAMMEL_NUMERICS");
  if (said == nullptr) return false;
  const std::string_view asked = said;
  return asked == "baseline" || (asked == "avx2" && build == "avx512");
}

}  // namespace

const Numerics& numerics() {
  static const Numerics& fastest = []() -> const Numerics& {
    if (!is_too_new("avx512") && __builtin_cpu_supports("avx512f") &&
        __builtin_cpu_supports("avx512dq"))
      return numerics_avx512();
    if (!is_too_new("avx2") && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
      return numerics_avx2();
    return numerics_baseline();
  }();
  return fastest;
}

}  // namespace trammel
