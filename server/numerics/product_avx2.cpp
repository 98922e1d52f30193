#include <cstddef>

#pragma GCC target("avx2,fma")

#define TRAMMEL_PRODUCT_LANES 4
#define TRAMMEL_PRODUCT_NAME raw_product_avx2
#include "server/numerics/product_impl.h"
