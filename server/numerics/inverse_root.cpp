#include "server/numerics/inverse_root.h"

#include <cmath>

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

Index start_of(Index row) { return row * (row + 1) / 2; }

}  // namespace

Eigen::Map<const VectorXd> InverseRoot::row(Index i) const {
  return {rows_.data() + start_of(i), i + 1};
}
Eigen::Map<VectorXd> InverseRoot::mutable_row(Index i) {
  return {rows_.data() + start_of(i), i + 1};
}

// [L 0; lᵀ d]⁻¹ = [L⁻¹ 0; -lᵀL⁻¹/d 1/d], l = L⁻¹ k, d² = variance - |l|².
std::optional<VectorXd> InverseRoot::append(const VectorXd& covariance, double variance) {
  VectorXd fresh = VectorXd::Zero(size_ + 1);
  double explained = 0;
  for (Index i = 0; i < size_; ++i) {
    const double l = row(i).dot(covariance.head(i + 1));
    explained += l * l;
    fresh.head(i + 1) -= l * row(i);
  }
  if (!(variance - explained > 0.0)) return std::nullopt;
  const double pivot = std::sqrt(variance - explained);
  fresh[size_] = 1.0;
  fresh /= pivot;
  rows_.insert(rows_.end(), fresh.begin(), fresh.end());
  ++size_;
  return fresh;
}

// Each later row is rotated with the row of `point` until the column of the point is empty below
// it. The row of the point gathers r.
VectorXd InverseRoot::remove(Index point) {
  VectorXd gathered = VectorXd::Zero(size_);
  gathered.head(point + 1) = row(point);
  for (Index i = point + 1; i < size_; ++i) {
    auto other = mutable_row(i);
    const double length = std::hypot(gathered[point], other[point]);
    const double cosine = gathered[point] / length;
    const double sine = other[point] / length;
    auto head = gathered.head(i + 1);
    const VectorXd before = head;
    head = cosine * before + sine * other;
    other = cosine * other - sine * before;
    // The row moves up by one, and loses the column of the point.
    auto target = mutable_row(i - 1);
    for (Index j = 0; j < point; ++j) target[j] = other[j];
    for (Index j = point; j < i; ++j) target[j] = other[j + 1];
  }
  --size_;
  rows_.resize(static_cast<std::size_t>(start_of(size_)));
  return gathered;
}

}  // namespace trammel
