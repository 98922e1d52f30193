#pragma once

#include <algorithm>
#include <cmath>

#include "server/bias/kernels/kernel.h"
#include "server/numerics/aligned_matrix.h"
#include "server/numerics/numerics.h"

/// The parts shared by kernels that work with Eigen on tiles.
namespace trammel {

using StridedColumns = Eigen::Map<const Eigen::MatrixXd, Eigen::Unaligned, Eigen::OuterStride<>>;
using MutableStridedColumns = Eigen::Map<Eigen::MatrixXd, Eigen::Unaligned, Eigen::OuterStride<>>;

inline StridedColumns columns_of(const FeatureBlock& block, Eigen::Index count) {
  return {block.data, block.rows, count, Eigen::OuterStride<>(block.ld)};
}
inline StridedColumns columns_of(const double* g, Eigen::Index rows, Eigen::Index cols,
                                 Eigen::Index ld) {
  return {g, rows, cols, Eigen::OuterStride<>(ld)};
}
inline MutableStridedColumns columns_of(double* k, Eigen::Index rows, Eigen::Index cols,
                                        Eigen::Index ld) {
  return {k, rows, cols, Eigen::OuterStride<>(ld)};
}

/// The number of joints of a kernel that has so many parameters. 0 if all its parameters are
/// shared.
inline Eigen::Index joints_of(const Kernel& kernel, Eigen::Index parameters) {
  const Eigen::Index shared = kernel.parameter_count(0);
  const Eigen::Index each = kernel.parameter_count(1) - shared;
  return each == 0 ? 0 : (parameters - shared) / each;
}

/// k(i, j) in a new matrix, with its padding.
inline AlignedMatrix tile_of(const Kernel& kernel, const Eigen::VectorXd& parameters,
                             const FeatureBlock& a, const FeatureBlock& b) {
  AlignedMatrix k(padded_rows(a.rows), b.rows);
  kernel.tile(parameters, a, b, k.data(), k.rows());
  return k;
}

/// Kernel::weighted_sum() by tiles, for kernels that have no faster way.
inline void weighted_sum_by_tiles(const Kernel& kernel, const Eigen::VectorXd& parameters,
                                  const FeatureBlock& a, const FeatureBlock& b,
                                  const double* weights, double* out) {
  constexpr Eigen::Index kRowsAtATime =
      10 * kRowPadding;  // 120 kB with 64 columns: the second-level cache
  std::fill_n(out, b.rows, 0.0);
  for (Eigen::Index j = 0; j < b.rows; j += kTile) {
    const FeatureBlock columns = {b.data + j, std::min(kTile, b.rows - j), b.ld};
    for (Eigen::Index i = 0; i < a.rows; i += kRowsAtATime) {
      const Eigen::Index rows = std::min(kRowsAtATime, a.rows - i);
      const AlignedMatrix k = tile_of(kernel, parameters, {a.data + i, rows, a.ld}, columns);
      const Eigen::Map<const Eigen::VectorXd> w(weights + i, rows);
      for (Eigen::Index c = 0; c < columns.rows; ++c)
        out[j + c] += k.map().col(c).head(rows).dot(w);
    }
  }
}

/// The box in which a search of length scales starts: half to ten times the standard deviation of
/// each column of `x`.
inline SearchBox length_scale_box(const Eigen::MatrixXd& x) {
  const Eigen::RowVectorXd mean = x.colwise().mean();
  SearchBox box{Eigen::VectorXd(x.cols()), Eigen::VectorXd(x.cols())};
  for (Eigen::Index k = 0; k < x.cols(); ++k) {
    const double spread = std::sqrt((x.col(k).array() - mean[k]).square().mean());
    const double scale =
        spread > 1e-6 ? spread : 1.0;  // a joint that never moved has no length scale to find
    box.low[k] = std::log(0.5 * scale);
    box.high[k] = std::log(10.0 * scale);
  }
  return box;
}

/// z = q / l, a column of the table each; `log_scales` one per column of `q`.
inline void scaled_joints(const Eigen::VectorXd& log_scales, const Eigen::MatrixXd& q,
                          double* table, Eigen::Index ld) {
  columns_of(table, q.rows(), q.cols(), ld) = q * (-log_scales).array().exp().matrix().asDiagonal();
}

}  // namespace trammel
