#include <cstddef>

#define TRAMMEL_PRODUCT_LANES 2
#define TRAMMEL_PRODUCT_NAME raw_product_baseline
#include "server/numerics/product_impl.h"
