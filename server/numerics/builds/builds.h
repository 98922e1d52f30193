#pragma once

#include "server/numerics/numerics_table.h"

/// One build for each instruction set, for numerics() to choose from and for the test that holds
/// them equal.
namespace trammel {

[[nodiscard]] const Numerics& numerics_baseline();  ///< SSE2, every x86-64
[[nodiscard]] const Numerics& numerics_avx2();      ///< needs AVX2 and FMA
[[nodiscard]] const Numerics& numerics_avx512();    ///< needs AVX-512 F and DQ

}  // namespace trammel
