#include "server/diagnose/evidence/dependence.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <random>

#include "server/base/check.h"
#include "server/base/units.h"
#include "server/robot/arm_state.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kMostPoses = 200;   // distances are quadratic in them; evenly drawn from more
constexpr Index kFewestPoses = 20;  // fewer say nothing about sixteen questions
constexpr int kPermutations = 999;
constexpr int kAsLarge =
    10;  // permutations at least as large: then their share is known to a third
constexpr double kNegligible = 1e-4;  // of the largest weight
constexpr double kNarrow =
    1e-6;  // standard deviations: so near the mean the saddlepoint divides by zero
constexpr double kLeastSpread = 1e-9;   // rad, s or of a unit variance: less is a constant
constexpr double kLeastTorque = 1e-12;  // Nm, against division by zero
constexpr double kFarOut = 30;          // standard deviations, beyond which erfc() is zero
constexpr int kTailHalvings = 200;      // of an interval: more than a double can hold

/// Distances between rows, less the means of their rows and columns.
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
    for (Index i = 0; i < a.rows(); ++i)
      sum += a(i, j) * column(order[static_cast<std::size_t>(i)]);
  }
  return sum;
}

/// Positive eigenvalues of minus the centred distances, largest first.
std::vector<double> spectrum(const MatrixXd& centred) {
  const VectorXd values =
      Eigen::SelfAdjointEigenSolver<MatrixXd>(-centred, Eigen::EigenvaluesOnly).eigenvalues();
  std::vector<double> positive;
  for (Index k = values.size() - 1; k >= 0 && values(k) > kNegligible * values(values.size() - 1);
       --k)
    positive.push_back(values(k));
  return positive;
}

/// The upper tail of sum w_k z_k^2, z_k standard normal: saddlepoint, after Lugannani and Rice.
class WeightedChiSquare {
 public:
  /// The weights are all products of a number of `one` and a number of `other`.
  WeightedChiSquare(const std::vector<double>& one, const std::vector<double>& other)
      : largest_(one.front() * other.front()) {
    for (const double a : one) {
      for (const double b : other) {
        if (a * b < kNegligible * largest_) break;
        weight_.push_back(a * b);
      }
    }
    mean_ = std::accumulate(weight_.begin(), weight_.end(), 0.0);
  }

  /// log P(sum > x), beyond the mean.
  double log_tail(double x) const {
    if (x <= mean_) return std::log(0.5);
    const double t = saddlepoint(x);
    const double distance = t * x - cumulant(t);
    const double r = std::sqrt(2 * std::max(0.0, distance));
    const double u = t * std::sqrt(curvature(t));
    if (r < kNarrow) return std::log(0.5);
    // 1 - Phi(r) + phi(r) (1/u - 1/r), with phi(r) taken out.
    return -distance - 0.5 * std::log(2 * kPi) + std::log(mills_ratio(r) + 1 / u - 1 / r);
  }

 private:
  /// The point at which the slope of the cumulant is x.
  double saddlepoint(double x) const {
    double low = 0;
    double high = 0.5 / largest_;
    for (int k = 0; k < kTailHalvings; ++k) {
      const double middle = 0.5 * (low + high);
      (slope(middle) < x ? low : high) = middle;
    }
    return 0.5 * (low + high);
  }
  /// (1 - Phi(r)) / phi(r).
  static double mills_ratio(double r) {
    if (r >= kFarOut) return 1 / r - 1 / (r * r * r);
    return 0.5 * std::erfc(r / std::sqrt(2.0)) * std::sqrt(2 * kPi) * std::exp(0.5 * r * r);
  }
  double cumulant(double t) const {
    double sum = 0;
    for (const double w : weight_) sum -= 0.5 * std::log1p(-2 * t * w);
    return sum;
  }
  double slope(double t) const {
    double sum = 0;
    for (const double w : weight_) sum += w / (1 - 2 * t * w);
    return sum;
  }
  double curvature(double t) const {
    double sum = 0;
    for (const double w : weight_) sum += 2 * std::pow(w / (1 - 2 * t * w), 2);
    return sum;
  }

  std::vector<double> weight_;
  double largest_, mean_ = 0;
};

/// The tail of the statistic beyond `tenth`, its kAsLarge-th largest of all permutations, at
/// `observed`.
double p_value_in_tail(const MatrixXd& a, const MatrixXd& b, double observed, double tenth) {
  const WeightedChiSquare null(spectrum(a), spectrum(b));
  const double scale =
      static_cast<double>(a.rows() - 1);  // a product of unit vectors varies by 1 / (n - 1)
  const double beyond = null.log_tail(scale * observed) - null.log_tail(scale * tenth);
  const double share = kAsLarge / static_cast<double>(kPermutations);
  return std::max(kLeastPValue, share * std::exp(std::min(0.0, beyond)));
}

/// The p-value of two centred distance matrices: the share of permutations with at least this
/// covariance, or the tail estimate if there are too few.
double p_value(const MatrixXd& a, const MatrixXd& b, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<Index> order(static_cast<std::size_t>(a.rows()));
  std::iota(order.begin(), order.end(), Index{0});
  const double observed = permuted_product(a, b, order);
  std::vector<double> drawn;
  int above = 0;
  while (static_cast<int>(drawn.size()) < kPermutations) {
    for (std::size_t i = order.size() - 1; i > 0; --i)
      std::swap(order[i], order[random() % (i + 1)]);
    drawn.push_back(permuted_product(a, b, order));
    if (drawn.back() >= observed && ++above == kAsLarge)
      return kAsLarge / static_cast<double>(drawn.size());
  }
  std::nth_element(drawn.begin(), drawn.begin() + kAsLarge - 1, drawn.end(), std::greater<>());
  return p_value_in_tail(a, b, observed, drawn[kAsLarge - 1]);
}

/// N x 3: the positions of `poses` in S⁻¹ y, scaled to unit covariance for pure noise. The
/// covariance of S⁻¹ y is S⁻¹ = 1 - U Uᵀ.
MatrixXd standardised(const LinearProblem& problem, const Background& background,
                      const VectorXd& left, const std::vector<Index>& poses) {
  MatrixXd rows(static_cast<Index>(poses.size()), 3);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Index row = problem.first_row(poses[i]);
    const auto U = background.root().middleRows(row, 3);
    const Matrix3 covariance = Matrix3::Identity() - U * U.transpose();
    const Eigen::SelfAdjointEigenSolver<Matrix3> eigen(covariance);
    const Vector3 scale = eigen.eigenvalues().cwiseMax(kLeastSpread).cwiseSqrt().cwiseInverse();
    const Matrix3& V = eigen.eigenvectors();
    rows.row(static_cast<Index>(i)) =
        (V * scale.asDiagonal() * V.transpose() * left.segment<3>(row)).transpose();
  }
  return rows;
}

struct Question {
  std::string on;
  MatrixXd distances;
};

/// The circumstances that the residual may depend on, a row a pose.
struct Circumstances {
  MatrixXd q;       ///< rad or m
  MatrixXd torque;  ///< of gravity, over the largest of each joint
  VectorXd time;    ///< the order of measuring
};

Circumstances circumstances_of(const LinearProblem& problem, const std::vector<Index>& poses) {
  const auto n = static_cast<Index>(poses.size());
  const int joints = problem.model().cell->robot.size();
  Circumstances all{MatrixXd(n, joints), MatrixXd(n, joints), VectorXd(n)};
  for (Index i = 0; i < n; ++i) {
    const Measurement& m =
        problem.batch().measurements[static_cast<std::size_t>(poses[static_cast<std::size_t>(i)])];
    all.q.row(i) = problem.gear_angles(poses[static_cast<std::size_t>(i)]).transpose();
    all.torque.row(i) =
        ArmKinematics(problem.model().state(m.context)).gravity_torque().matrix().transpose();
    all.time(i) = static_cast<double>(m.context.index);
  }
  const VectorXd largest =
      all.torque.cwiseAbs().colwise().maxCoeff().cwiseMax(kLeastTorque).transpose();
  all.torque = (all.torque * largest.cwiseInverse().asDiagonal()).eval();
  return all;
}

std::vector<Question> questions(const LinearProblem& problem, const std::vector<Index>& poses) {
  const Circumstances circumstances = circumstances_of(problem, poses);
  std::vector<Question> all;
  const auto ask = [&](std::string on, const MatrixXd& x) {
    if ((x.rowwise() - x.colwise().mean()).norm() < kLeastSpread) return;
    all.push_back({std::move(on), centred_distances(x)});
  };
  for (Index j = 0; j < circumstances.q.cols(); ++j)
    ask(fmt::format("q{}", j + 1), circumstances.q.col(j));
  ask("torque", circumstances.torque);
  ask("time", circumstances.time);
  return all;
}

/// Sorts by p-value and corrects each for the number of questions, after Holm.
void correct_for_number(std::vector<Dependence>& found) {
  std::sort(found.begin(), found.end(),
            [](const auto& a, const auto& b) { return a.p_value < b.p_value; });
  double highest = 0;
  for (std::size_t k = 0; k < found.size(); ++k) {
    highest =
        std::max(highest, std::min(1.0, found[k].p_value * static_cast<double>(found.size() - k)));
    found[k].p_value = highest;
  }
}

}  // namespace

double independence_p_value(const MatrixXd& x, const MatrixXd& y, std::uint64_t seed) {
  TRAMMEL_CHECK(x.rows() == y.rows() && x.rows() >= 4);
  return p_value(centred_distances(x), centred_distances(y), seed);
}

std::vector<Dependence> dependence_of(const LinearProblem& problem, const Background& background,
                                      const VectorXd& left, std::uint64_t seed) {
  const Index n = std::min(kMostPoses, problem.poses());
  if (n < kFewestPoses) return {};
  std::vector<Index> poses(static_cast<std::size_t>(n));
  for (Index i = 0; i < n; ++i) poses[static_cast<std::size_t>(i)] = i * problem.poses() / n;
  const MatrixXd residual = standardised(problem, background, left, poses);
  const MatrixXd by_residual = centred_distances(residual);
  const MatrixXd by_size = centred_distances(residual.rowwise().norm());
  std::vector<Dependence> found;
  for (const Question& question : questions(problem, poses)) {
    found.push_back(
        {question.on, false, p_value(by_residual, question.distances, seed + found.size())});
    found.push_back({question.on, true, p_value(by_size, question.distances, seed + found.size())});
  }
  correct_for_number(found);
  return found;
}

}  // namespace trammel::cause_search
