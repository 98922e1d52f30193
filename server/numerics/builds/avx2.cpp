#include <immintrin.h>
#include <math.h>
#include <string.h>

#include "server/numerics/builds/builds.h"

#pragma GCC target("avx2,fma")

#define TRAMMEL_VECTOR_LANES 4
#define TRAMMEL_TILE_COLUMNS 4
#define TRAMMEL_NUMERICS_NAME "avx2"
#define TRAMMEL_NUMERICS_BUILD numerics_avx2
#include "server/numerics/builds/build.h"
