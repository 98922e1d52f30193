#include "server/bias/process/near_points.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <utility>

#include "server/numerics/aligned_matrix.h"
#include "server/numerics/numerics.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using Covariance = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, NearPoints::kMost, NearPoints::kMost>;
using Few = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, NearPoints::kMost, 1>;

constexpr Index kChunksOfEach = 4;

/// At least `count` of `k` are as large: the `count`-th largest of the largest of each chunk.
double least_of_largest(const double* k, Index size, Index count) {
  const Index chunk = std::max<Index>(1, size / (kChunksOfEach * count));
  std::vector<double> most;
  most.reserve(static_cast<std::size_t>(size / chunk + 1));
  for (Index i = 0; i < size; i += chunk) most.push_back(*std::max_element(k + i, k + std::min(size, i + chunk)));
  const auto last = most.begin() + (count - 1);
  std::nth_element(most.begin(), last, most.end(), std::greater<>());
  return *last;
}

/// The places of the `count` largest of `k`, rising; of equal ones the first.
std::vector<Index> largest(const double* k, Index size, Index count) {
  const double least = least_of_largest(k, size, count);
  std::vector<Index> found;
  found.reserve(static_cast<std::size_t>(3 * count));
  for (Index i = 0; i < size; ++i) {
    if (k[i] >= least) found.push_back(i);
  }
  const auto larger = [k](Index a, Index b) { return k[a] != k[b] ? k[a] > k[b] : a < b; };
  std::nth_element(found.begin(), found.begin() + (count - 1), found.end(), larger);
  found.resize(static_cast<std::size_t>(count));
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace

double NearPoints::left_of(const FeatureBlock& target, double prior, Index left_out, NearWeights* weights) const {
  const Index size = noise.size();
  AlignedMatrix cross(features.rows(), 1);
  kernel.tile(parameters, rows_of(features, 0, size), target, cross.data(), cross.rows());
  if (left_out >= 0) cross(left_out, 0) = -std::numeric_limits<double>::infinity();
  std::vector<Index> found = largest(cross.data(), size, count);

  AlignedMatrix near(padded_rows(count), features.cols());
  Few known(count);
  for (Index i = 0; i < count; ++i) {
    const Index point = found[static_cast<std::size_t>(i)];
    known[i] = cross(point, 0);
    near.map().row(i) = features.map().row(point);
  }
  AlignedMatrix between(near.rows(), count);
  kernel.tile(parameters, rows_of(near, 0, count), rows_of(near, 0, count), between.data(), between.rows());
  Covariance matrix = between.map().topRows(count);
  for (Index i = 0; i < count; ++i) matrix(i, i) += noise[found[static_cast<std::size_t>(i)]];
  const Eigen::LLT<Covariance> root(matrix);
  if (root.info() != Eigen::Success) return prior;
  root.matrixL().solveInPlace(known);
  const double left = std::clamp(prior - known.squaredNorm(), 0.0, prior);
  if (weights == nullptr) return left;
  root.matrixU().solveInPlace(known);
  *weights = {std::move(found), known};
  return left;
}

}  // namespace trammel
