#include <cstddef>

#pragma GCC target("avx512f,avx512dq,fma")

#define TRAMMEL_PRODUCT_LANES 8
#define TRAMMEL_PRODUCT_NAME raw_product_avx512
#include "server/numerics/product_impl.h"
