#include "server/bias/process/variance_table.h"

#include <algorithm>
#include <utility>

#include "server/base/check.h"
#include "server/numerics/numerics.h"

namespace trammel {

using Eigen::Index;

// Packs the last rows first. Columns to the right of a row are not needed for the rows above, so
// their memory is freed, and at most one matrix and one triangle exist at a time.
VarianceTable::VarianceTable(PointFeatures features, Index size, AlignedMatrix root)
    : features_(std::move(features)), size_(size), packed_root_(numerics().packed_size(size), 1) {
  const Numerics& n = numerics();
  for (Index first = (size - 1) / n.packed_rows * n.packed_rows; first >= 0;
       first -= n.packed_rows) {
    n.pack_lower(size, first, root.data(), root.rows(), packed_root_.data() + n.packed_size(first));
    root.forget_columns_from(first);
  }
}

VarianceTable::VarianceTable(PointFeatures features, Index size, const std::vector<double>& rows)
    : features_(std::move(features)), size_(size), packed_root_(numerics().packed_size(size), 1) {
  numerics().pack_triangle(size, rows.data(), packed_root_.data());
}

VarianceTable VarianceTable::in_single_precision(double rounding) const {
  TRAMMEL_CHECK(!is_single_);
  const Index length = numerics().packed_size(size_);
  VarianceTable table;
  table.features_ = features_;
  table.size_ = size_;
  table.packed_root_ = {(length + 1) / 2, 1};
  table.is_single_ = true;
  table.factor_ = factor_;
  table.added_ = added_ + rounding;
  auto* singles = reinterpret_cast<float*>(table.packed_root_.data());
  for (Index i = 0; i < length; ++i) singles[i] = static_cast<float>(packed_root_.data()[i]);
  return table;
}

std::vector<double> VarianceTable::rows(Index more) const {
  TRAMMEL_CHECK(!is_single_);
  std::vector<double> rows;
  rows.reserve(static_cast<std::size_t>((size_ + more) * (size_ + more + 1) / 2));
  rows.resize(static_cast<std::size_t>(size_ * (size_ + 1) / 2));
  numerics().unpack_triangle(size_, packed_root_.data(), rows.data());
  return rows;
}

void VarianceTable::square_norms(Index count, const double* k, double* out) const {
  if (is_single_) {
    numerics().square_norms_single(size_, reinterpret_cast<const float*>(packed_root_.data()),
                                   count, k, out);
  } else {
    numerics().square_norms(size_, packed_root_.data(), count, k, out);
  }
}

void VarianceTable::shares(const Kernel& kernel, const Eigen::VectorXd& parameters,
                           const FeatureBlock& targets, double* posterior, double* prior) const {
  const Index block = targets.rows == 1 ? 1 : kTargetBlock;
  const Index ld = padded_rows(size_);
  AlignedMatrix cross(ld, block);
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> interleaved(size_, block);
  kernel.diagonal(parameters, targets, prior);
  for (Index first = 0; first < targets.rows; first += block) {
    const Index count = std::min(block, targets.rows - first);
    kernel.tile(parameters, rows_of(*features_, 0, size_),
                {targets.data + first, count, targets.ld}, cross.data(), ld);
    interleaved = cross.map().topRows(size_);
    double explained[kTargetBlock];
    square_norms(block, interleaved.data(), explained);
    for (Index j = 0; j < count; ++j) {
      const double k = prior[first + j];
      posterior[first + j] = std::clamp(factor_ * (k - explained[j]) + added_, 0.0, k);
    }
  }
}

}  // namespace trammel
