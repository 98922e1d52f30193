#include "server/diagnose/dependence.h"

#include <algorithm>
#include <numeric>
#include <random>

#include "server/robot/arm_state.h"

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kMostPoses = 200;  // distances are quadratic; evenly drawn beyond
constexpr int kPermutations = 299;
constexpr double kLeastSpread = 1e-9;

/// Distances between rows, less row and column means.
MatrixXd centred_distances(const MatrixXd& rows) {
  const Index n = rows.rows();
  MatrixXd d(n, n);
  for (Index i = 0; i < n; ++i) d.col(i) = (rows.rowwise() - rows.row(i)).rowwise().norm();
  const VectorXd mean = d.rowwise().mean();
  const double whole = mean.mean();
  d = (d.colwise() - mean).rowwise() - mean.transpose();
  d.array() += whole;
  return d;
}

double permuted_product(const MatrixXd& a, const MatrixXd& b, const std::vector<Index>& order) {
  double sum = 0;
  for (Index j = 0; j < a.cols(); ++j) {
    const auto& column = b.col(order[static_cast<std::size_t>(j)]);
    for (Index i = 0; i < a.rows(); ++i) sum += a(i, j) * column(order[static_cast<std::size_t>(i)]);
  }
  return sum;
}

double p_value(const MatrixXd& a, const MatrixXd& b, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<Index> order(static_cast<std::size_t>(a.rows()));
  std::iota(order.begin(), order.end(), Index{0});
  const double observed = permuted_product(a, b, order);
  int above = 0;
  for (int k = 0; k < kPermutations; ++k) {
    for (std::size_t i = order.size() - 1; i > 0; --i) std::swap(order[i], order[random() % (i + 1)]);
    if (permuted_product(a, b, order) >= observed) ++above;
  }
  return static_cast<double>(above + 1) / (kPermutations + 1);
}

struct Question {
  std::string on;
  MatrixXd distances;
};

std::vector<Question> questions(const LinearProblem& problem, const std::vector<Index>& poses) {
  const auto n = static_cast<Index>(poses.size());
  const int joints = problem.model().cell->robot.size();
  MatrixXd q(n, joints), torque(n, joints);
  VectorXd time(n);
  for (Index i = 0; i < n; ++i) {
    const Measurement& m = problem.batch().measurements[static_cast<std::size_t>(poses[static_cast<std::size_t>(i)])];
    q.row(i) = m.context.q.transpose();
    torque.row(i) = ArmKinematics(problem.model().state(m.context)).gravity_torque().matrix().transpose();
    time(i) = static_cast<double>(m.context.index);
  }
  std::vector<Question> all;
  const auto ask = [&](std::string on, const MatrixXd& x) {
    if ((x.rowwise() - x.colwise().mean()).norm() < kLeastSpread) return;
    all.push_back({std::move(on), centred_distances(x)});
  };
  for (int joint = 0; joint < joints; ++joint) ask(fmt::format("q{}", joint + 1), q.col(joint));
  const VectorXd largest = torque.cwiseAbs().colwise().maxCoeff().cwiseMax(1e-12).transpose();
  ask("torque", torque * largest.cwiseInverse().asDiagonal());
  ask("time", time);
  return all;
}

}  // namespace

std::vector<Dependence> dependence_of(const LinearProblem& problem, const VectorXd& left, std::uint64_t seed) {
  const Index n = std::min(kMostPoses, problem.poses());
  if (n < 20) return {};
  std::vector<Index> poses(static_cast<std::size_t>(n));
  for (Index i = 0; i < n; ++i) poses[static_cast<std::size_t>(i)] = i * problem.poses() / n;
  const Eigen::Matrix3Xd positions = problem.positions(left);
  const MatrixXd residual = positions(Eigen::all, poses).transpose();
  const MatrixXd by_residual = centred_distances(residual);
  const MatrixXd by_size = centred_distances(residual.rowwise().norm());
  std::vector<Dependence> found;
  for (const Question& question : questions(problem, poses)) {
    found.push_back({question.on, false, p_value(by_residual, question.distances, seed + found.size())});
    found.push_back({question.on, true, p_value(by_size, question.distances, seed + found.size())});
  }
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.p_value < b.p_value; });
  double highest = 0;
  for (std::size_t k = 0; k < found.size(); ++k) {
    highest = std::max(highest, std::min(1.0, found[k].p_value * static_cast<double>(found.size() - k)));
    found[k].p_value = highest;
  }
  return found;
}

}  // namespace trammel
