#include <immintrin.h>
#include <math.h>
#include <string.h>

#include "server/numerics/builds/builds.h"

#pragma GCC target("avx512f,avx512dq,avx2,fma,prefer-vector-width=512")

#define TRAMMEL_VECTOR_LANES 8
#define TRAMMEL_TILE_COLUMNS 8
#define TRAMMEL_NUMERICS_NAME "avx512"
#define TRAMMEL_NUMERICS_BUILD numerics_avx512
#include "server/numerics/builds/build.h"
