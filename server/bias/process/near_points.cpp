#include "server/bias/process/near_points.h"

#include <algorithm>
#include <functional>
#include <utility>

#include "server/numerics/aligned_matrix.h"
#include "server/numerics/numerics.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using Covariance =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, NearPoints::kMost, NearPoints::kMost>;
using Few = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, NearPoints::kMost, 1>;

constexpr Index kLanesOfEach = 4;

/// The largest of each lane: lane c of `lanes` holds k[c], k[c + lanes], ... They are compared side
/// by side.
Eigen::ArrayXd largest_of_lanes(const Eigen::Map<const Eigen::ArrayXd>& k, Index lanes) {
  Eigen::ArrayXd most = k.head(lanes);
  Index first = lanes;
  for (; first + lanes <= k.size(); first += lanes) most = most.max(k.segment(first, lanes));
  const Index rest = k.size() - first;
  most.head(rest) = most.head(rest).max(k.tail(rest));
  return most;
}

/// The places of the `count` largest elements of `k`, in rising order. Among equal elements the
/// first one counts. At least `count` elements are as large as the `count`-th largest of the lanes,
/// so the search enters only lanes with a large element.
std::vector<Index> largest(const Eigen::Map<const Eigen::ArrayXd>& k, Index count) {
  const Index lanes = std::min(k.size(), kLanesOfEach * count);
  const Eigen::ArrayXd most = largest_of_lanes(k, lanes);
  Eigen::ArrayXd sorted = most;
  std::nth_element(sorted.data(), sorted.data() + (count - 1), sorted.data() + lanes,
                   std::greater<>());
  const double least = sorted[count - 1];
  std::vector<Index> found;
  found.reserve(static_cast<std::size_t>(3 * count));
  for (Index lane = 0; lane < lanes; ++lane) {
    if (most[lane] < least) continue;
    for (Index i = lane; i < k.size(); i += lanes) {
      if (k[i] >= least) found.push_back(i);
    }
  }
  const auto larger = [&k](Index a, Index b) { return k[a] != k[b] ? k[a] > k[b] : a < b; };
  std::nth_element(found.begin(), found.begin() + (count - 1), found.end(), larger);
  found.resize(static_cast<std::size_t>(count));
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace

AlignedMatrix NearPoints::covariance_with(const FeatureBlock& target) const {
  AlignedMatrix covariance(features.rows(), 1);
  kernel.tile(parameters, rows_of(features, 0, noise.size()), target, covariance.data(),
              covariance.rows());
  return covariance;
}

double NearPoints::left_of(const AlignedMatrix& covariance, double prior,
                           NearWeights* weights) const {
  std::vector<Index> found =
      largest(Eigen::Map<const Eigen::ArrayXd>(covariance.data(), noise.size()), count);

  AlignedMatrix near(padded_rows(count), features.cols());
  Few known(count);
  for (Index i = 0; i < count; ++i) {
    const Index point = found[static_cast<std::size_t>(i)];
    known[i] = covariance(point, 0);
    near.map().row(i) = features.map().row(point);
  }
  AlignedMatrix between(near.rows(), count);
  kernel.tile(parameters, rows_of(near, 0, count), rows_of(near, 0, count), between.data(),
              between.rows());
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
