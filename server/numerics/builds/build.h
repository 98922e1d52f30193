#pragma once

#include "server/numerics/builds/covariance.h"
#include "server/numerics/builds/factorisations.h"
#include "server/numerics/builds/products.h"
#include "server/numerics/builds/triangles.h"

/// The table of one build: TRAMMEL_NUMERICS_BUILD is its function, TRAMMEL_NUMERICS_NAME its name.
namespace trammel {

const Numerics& TRAMMEL_NUMERICS_BUILD() {
  static const Numerics build = {.name = TRAMMEL_NUMERICS_NAME,
                                 .packed_rows = kTileRows,
                                 .work_size = work_size,
                                 .sweep = sweep,
                                 .inverse_root = inverse_root,
                                 .multiply_work_size = multiply_work_size,
                                 .multiply_transposed = multiply_transposed,
                                 .transposed_product = transposed_product,
                                 .packed_size = packed_size,
                                 .pack_lower = pack_lower,
                                 .pack_triangle = pack_triangle,
                                 .unpack_triangle = unpack_triangle,
                                 .square_norms = square_norms<double>,
                                 .square_norms_single = square_norms<float>,
                                 .radial_tile = radial_tile,
                                 .radial_gradient = radial_gradient,
                                 .radial_weighted_sum = radial_weighted_sum,
                                 .weight_column = weight_column};
  return build;
}

}  // namespace trammel
