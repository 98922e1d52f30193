#include "server/numerics/numerics.h"

#include "server/numerics/builds/builds.h"

namespace trammel {

const Numerics& numerics() {
  static const Numerics& fastest = []() -> const Numerics& {
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq")) return numerics_avx512();
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return numerics_avx2();
    return numerics_baseline();
  }();
  return fastest;
}

}  // namespace trammel
