#include <immintrin.h>
#include <math.h>
#include <string.h>

#include "server/numerics/builds/builds.h"

#define TRAMMEL_VECTOR_LANES 2
#define TRAMMEL_TILE_COLUMNS 4
#define TRAMMEL_NUMERICS_NAME "baseline"
#define TRAMMEL_NUMERICS_BUILD numerics_baseline
#include "server/numerics/builds/build.h"
