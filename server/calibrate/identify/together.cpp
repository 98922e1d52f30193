#include "server/calibrate/identify/together.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <random>
#include <utility>

#include "server/base/median.h"

namespace trammel {

namespace {

using Places = std::vector<std::size_t>;

constexpr std::size_t kNeighbours = 5;
constexpr std::size_t kFewestRows = 25;     // of fewer, five neighbours are a fifth of all
constexpr std::size_t kMostCompared = 300;  // rows: more tell no more, and cost their square
constexpr int kShuffles = 1000;
constexpr double kByChance = 0.002;  // that the far rows have so large neighbours
constexpr double kMuchMore = 30;     // times the median neighbour: a mistake among them

Places all_places(std::size_t count) {
  Places places(count);
  std::iota(places.begin(), places.end(), std::size_t{0});
  return places;
}

/// The far rows, and evenly drawn others beside them, rising.
Places compared_rows(std::size_t count, const Places& far) {
  const std::size_t wanted = std::max(kMostCompared, 2 * far.size());
  if (count <= wanted) return all_places(count);
  Places drawn(wanted), rows;
  for (std::size_t k = 0; k < wanted; ++k) drawn[k] = k * count / wanted;
  std::set_union(drawn.begin(), drawn.end(), far.begin(), far.end(), std::back_inserter(rows));
  return rows;
}

/// Rows x joints, and the reach and the height of the flange, in standard deviations of the rows. A
/// column that hardly changes stays at zero.
Eigen::MatrixXd scaled_postures(const Chain& robot, const MeasurementBatch& batch,
                                const Places& rows) {
  constexpr double kStill = 1e-3;  // rad, m
  const auto n = static_cast<Eigen::Index>(rows.size());
  const Eigen::Index joints = robot.size();
  Eigen::MatrixXd q(n, joints + 2);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto row = rows[static_cast<std::size_t>(i)];
    const JointVector& here = batch.measurements[row].context.q;
    const Vector3 flange_B = robot.flange_pose(here).translation();
    q.row(i) << here.transpose(), flange_B.head<2>().norm(), flange_B.z();
  }
  q.rowwise() -= q.colwise().mean().eval();
  for (Eigen::Index j = 0; j < q.cols(); ++j) {
    const double spread = std::sqrt(q.col(j).squaredNorm() / static_cast<double>(n));
    q.col(j) *= spread > kStill ? 1 / spread : 0;
  }
  return q;
}

/// Each joint, each pair of joints, all of them, the reach, and reach and height.
std::vector<std::vector<Eigen::Index>> groups_of_columns(Eigen::Index joints) {
  std::vector<std::vector<Eigen::Index>> groups;
  for (Eigen::Index a = 0; a < joints; ++a) {
    groups.push_back({a});
    for (Eigen::Index b = a + 1; b < joints; ++b) groups.push_back({a, b});
  }
  if (joints > 2) {
    groups.emplace_back(static_cast<std::size_t>(joints));
    std::iota(groups.back().begin(), groups.back().end(), Eigen::Index{0});
  }
  groups.push_back({joints});
  groups.push_back({joints, joints + 1});
  return groups;
}

Places nearest_rows(const Eigen::MatrixXd& q, std::size_t row) {
  const Eigen::VectorXd distance =
      (q.rowwise() - q.row(static_cast<Eigen::Index>(row))).rowwise().squaredNorm();
  Places others = all_places(static_cast<std::size_t>(q.rows()));
  others.erase(others.begin() + static_cast<std::ptrdiff_t>(row));
  const auto last = others.begin() + static_cast<std::ptrdiff_t>(kNeighbours);
  std::partial_sort(others.begin(), last, others.end(), [&](std::size_t a, std::size_t b) {
    return distance(static_cast<Eigen::Index>(a)) < distance(static_cast<Eigen::Index>(b));
  });
  others.erase(last, others.end());
  return others;
}

/// The neighbours of each row, by one group of joints.
using Neighbourhoods = std::vector<Places>;

std::vector<Neighbourhoods> neighbourhoods_of(const Eigen::MatrixXd& q) {
  std::vector<Neighbourhoods> groups;
  for (const std::vector<Eigen::Index>& columns : groups_of_columns(q.cols() - 2)) {
    const Eigen::MatrixXd some = q(Eigen::all, columns);
    Neighbourhoods all;
    for (std::size_t row = 0; row < static_cast<std::size_t>(q.rows()); ++row)
      all.push_back(nearest_rows(some, row));
    groups.push_back(std::move(all));
  }
  return groups;
}

/// The share of the values that each one exceeds.
std::vector<double> ranks_of(const std::vector<double>& values) {
  Places order = all_places(values.size());
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  std::vector<double> ranks(order.size());
  for (std::size_t k = 0; k < order.size(); ++k)
    ranks[order[k]] = static_cast<double>(k) / static_cast<double>(order.size());
  return ranks;
}

double mean_rank(const Places& rows, const std::vector<double>& ranks) {
  double sum = 0;
  for (const std::size_t row : rows) sum += ranks[row];
  return sum / static_cast<double>(rows.size());
}

/// The group by which the neighbours of `far` are the largest, and their mean rank.
std::pair<std::size_t, double> largest_by(const std::vector<Neighbourhoods>& groups,
                                          const Places& far, const std::vector<double>& ranks) {
  std::pair<std::size_t, double> best{0, -1};
  for (std::size_t g = 0; g < groups.size(); ++g) {
    double sum = 0;
    for (const std::size_t row : far) sum += mean_rank(groups[g][row], ranks);
    if (const double mean = sum / static_cast<double>(far.size()); mean > best.second)
      best = {g, mean};
  }
  return best;
}

/// The share of exchanges of the rows' misfits in which the far rows have neighbours as large as
/// `seen`, by any group.
double chance_of(double seen, const std::vector<Neighbourhoods>& groups, const Places& far,
                 const std::vector<double>& ranks) {
  int as_large = 0;
  Places moved_to = all_places(ranks.size());
  std::vector<double> shuffled(ranks.size());
  std::mt19937_64 random(1);
  for (int k = 0; k < kShuffles; ++k) {
    // The misfits move, and so do the rows that are far.
    std::shuffle(moved_to.begin(), moved_to.end(), random);
    for (std::size_t i = 0; i < ranks.size(); ++i) shuffled[moved_to[i]] = ranks[i];
    Places far_now;
    for (const std::size_t row : far) far_now.push_back(moved_to[row]);
    as_large += largest_by(groups, far_now, shuffled).second >= seen ? 1 : 0;
  }
  return as_large / static_cast<double>(kShuffles);
}

double median_of(const Places& rows, const std::vector<double>& misfit) {
  std::vector<double> all;
  for (const std::size_t row : rows) all.push_back(misfit[row]);
  return median(all);
}

}  // namespace

std::vector<std::size_t> together_in_joints(const Chain& robot, const MeasurementBatch& batch,
                                            const Eigen::VectorXd& farness,
                                            const std::vector<std::size_t>& far) {
  if (far.empty() || batch.measurements.size() < kFewestRows) return {};
  const Places rows = compared_rows(batch.measurements.size(), far);
  std::vector<double> misfit;
  Places far_here;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    misfit.push_back(farness(static_cast<Eigen::Index>(rows[i])));
    if (std::binary_search(far.begin(), far.end(), rows[i])) far_here.push_back(i);
  }
  const std::vector<Neighbourhoods> groups = neighbourhoods_of(scaled_postures(robot, batch, rows));
  const std::vector<double> ranks = ranks_of(misfit);
  const std::pair<std::size_t, double> seen = largest_by(groups, far_here, ranks);
  if (chance_of(seen.second, groups, far_here, ranks) > kByChance) return {};
  std::vector<std::size_t> together;
  for (const std::size_t row : far_here)
    if (misfit[row] <= kMuchMore * median_of(groups[seen.first][row], misfit))
      together.push_back(rows[row]);
  return together;
}

}  // namespace trammel
