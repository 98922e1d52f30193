#include "server/bias/process/halves.h"

#include <algorithm>
#include <numeric>

#include "server/base/check.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

void halve(const MatrixXd& table, std::size_t most, std::vector<Index> part,
           std::vector<std::vector<Index>>* parts) {
  if (part.size() <= most) {
    std::sort(part.begin(), part.end());
    parts->push_back(std::move(part));
    return;
  }
  Index widest = 0;
  double width = -1;
  for (Index k = 0; k < table.cols(); ++k) {
    const auto column = table.col(k)(part);
    const double spread = column.maxCoeff() - column.minCoeff();
    if (spread > width) widest = k;
    width = std::max(width, spread);
  }
  const auto middle = part.begin() + static_cast<std::ptrdiff_t>(part.size() / 2);
  std::nth_element(part.begin(), middle, part.end(), [&](Index a, Index b) {
    return table(a, widest) != table(b, widest) ? table(a, widest) < table(b, widest) : a < b;
  });
  halve(table, most, {part.begin(), middle}, parts);
  halve(table, most, {middle, part.end()}, parts);
}

}  // namespace

std::vector<std::vector<Index>> halved(const MatrixXd& table, Index most) {
  TRAMMEL_CHECK(most > 0);
  std::vector<Index> all(static_cast<std::size_t>(table.rows()));
  std::iota(all.begin(), all.end(), Index{0});
  std::vector<std::vector<Index>> parts;
  halve(table, static_cast<std::size_t>(most), std::move(all), &parts);
  return parts;
}

std::vector<std::vector<Index>> halved(const MatrixXd& table, const std::vector<PoseGroup>& poses,
                                       Index most) {
  std::vector<Index> first;
  for (const PoseGroup& pose : poses) first.push_back(pose.front());
  std::vector<std::vector<Index>> parts;
  for (const std::vector<Index>& part : halved(MatrixXd(table(first, Eigen::all)), most)) {
    std::vector<Index>& rows = parts.emplace_back();
    for (const Index p : part) {
      const PoseGroup& pose = poses[static_cast<std::size_t>(p)];
      rows.insert(rows.end(), pose.begin(), pose.end());
    }
    std::sort(rows.begin(), rows.end());
  }
  return parts;
}

MatrixXd joints_as_seen_by(const Kernel& kernel, const Eigen::VectorXd& parameters,
                           const MatrixXd& q) {
  MatrixXd features(q.rows(), kernel.feature_count(q.cols()));
  if (features.cols() < q.cols() || features.cols() > q.cols() + 1) return q;
  kernel.features(parameters, q, features.data(), features.rows());
  return features.leftCols(q.cols());
}

}  // namespace trammel
