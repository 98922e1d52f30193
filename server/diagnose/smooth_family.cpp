#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/diagnose/family.h"

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kBox = 1.2;                       // half width of the box that the basis lives in; data lie in [-1, 1]
constexpr double kSmallestSpan = 0.035;            // rad
constexpr int kSizes = 17;                         // a quarter of a decade apart
constexpr double kSizeRatio = 1.7782794100389228;  // 10^(1/4)

/// A Gaussian process with a squared exponential kernel of unit variance as a weighted sum of sines in a box (Solin and
/// Särkkä 2020): column k has its standard deviation sqrt(S(omega_k)) multiplied in. N x count.
MatrixXd basis(const VectorXd& x, Index count, double length_scale) {
  MatrixXd columns(x.size(), count);
  for (Index k = 0; k < count; ++k) {
    const double omega = kPi * static_cast<double>(k + 1) / (2 * kBox);
    const double spectrum = std::sqrt(2 * kPi) * length_scale * std::exp(-0.5 * std::pow(length_scale * omega, 2));
    columns.col(k) = std::sqrt(spectrum / kBox) * (omega * (x.array() + kBox)).sin();
  }
  return columns;
}

/// [-1, 1] over the poses; empty where it hardly changes.
VectorXd spread(const VectorXd& x, double smallest) {
  const double low = x.minCoeff();
  const double high = x.maxCoeff();
  if (high - low < smallest) return {};
  return 2 * (x.array() - low) / (high - low) - 1;
}

VectorXd angles(const LinearProblem& problem, int joint) {
  VectorXd q(problem.poses());
  for (Index i = 0; i < q.size(); ++i)
    q(i) = problem.batch().measurements[static_cast<std::size_t>(i)].context.q(joint);
  return q;
}

/// A random smooth function: columns for each of a few length scales, of unit size.
class SmoothFamily : public Family {
 public:
  std::vector<Best> scan(const View& view, const MatrixXd& projected) const final {
    std::vector<Best> best(static_cast<std::size_t>(projected.cols()));
    for (std::size_t scale = 0; scale < members_.size(); ++scale) {
      const MatrixXd C = view.keep ? MatrixXd(view.keep->asDiagonal() * members_[scale]) : members_[scale];
      const MatrixXd shared = view.background.root().transpose() * C;
      const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(C.transpose() * C - shared.transpose() * shared);
      const VectorXd seen = eigen.eigenvalues().cwiseMax(0);
      const MatrixXd square =
          (eigen.eigenvectors().transpose() * (C.transpose() * projected)).array().square().matrix();
      double size = smallest_;
      for (int step = 0; step < kSizes; ++step, size *= kSizeRatio) {
        const VectorXd gain = (size * size) * (1 + size * size * seen.array()).inverse();
        const double cost = (1 + size * size * seen.array()).log().sum();
        const double freedom = (gain.array() * seen.array()).sum();
        const VectorXd strength = square.transpose() * gain;
        for (Index d = 0; d < projected.cols(); ++d) {
          Best& one = best[static_cast<std::size_t>(d)];
          const double evidence = 0.5 * (strength(d) - cost);
          if (evidence > one.evidence)
            one = {evidence, strength(d), static_cast<int>(std::ceil(freedom)), static_cast<double>(scale), size};
        }
      }
    }
    return best;
  }
  MatrixXd columns(const Best& best) const final { return best.size * members_[static_cast<std::size_t>(best.at)]; }
  Best typical() const final { return {0, 0, 1, static_cast<double>(members_.size() - 1), typical_}; }

 protected:
  std::vector<MatrixXd> members_;
  double smallest_ = 1e-6;
  double typical_ = 1e-4;
};

class JointMapFamily final : public SmoothFamily {
 public:
  JointMapFamily(const LinearProblem& problem, int joint, const VectorXd& x, double span) : joint_(joint) {
    const Index most = std::clamp<Index>(problem.poses() / 5, 6, 96);
    harmonics_ = std::clamp(static_cast<int>(static_cast<double>(most) * kPi / (kBox * span) + 1), 4, 48);
    for (const double length_scale : {0.04, 0.1, 0.25, 0.5}) {
      const auto needed = static_cast<Index>(std::ceil(4 * kBox / (kPi * length_scale) * 2));
      const MatrixXd functions = basis(x, std::min(most, needed), length_scale);
      MatrixXd columns(problem.rows(), functions.cols());
      for (Index i = 0; i < problem.poses(); ++i) {
        const Index row = problem.first_row(i);
        const Index count = problem.row_count(i);
        columns.middleRows(row, count) = problem.by_joint().col(joint).segment(row, count) * functions.row(i);
      }
      members_.push_back(std::move(columns));
    }
    smallest_ = 1e-7;
    typical_ = 5e-5;
  }
  Cause cause(const Best&) const override { return {"joint_map", joint_, "", "", {}}; }
  std::string source(const Best&) const override { return fmt::format("joint_map:{}@{}", joint_ + 1, harmonics_); }

 private:
  int joint_;
  int harmonics_;
};

class AnonymousFamily final : public SmoothFamily {
 public:
  AnonymousFamily(const LinearProblem& problem, std::vector<std::string> on, const std::vector<VectorXd>& x)
      : on_(std::move(on)) {
    for (const double length_scale : {0.2, 0.45, 1.0}) {
      MatrixXd functions = basis(x[0], x.size() == 1 ? 16 : 7, length_scale);
      if (x.size() == 2) functions = products(functions, basis(x[1], 7, length_scale));
      MatrixXd columns = MatrixXd::Zero(problem.rows(), 3 * functions.cols());
      for (Index i = 0; i < problem.poses(); ++i) {
        const Index row = problem.first_row(i);
        for (Index axis = 0; axis < 3; ++axis) {
          columns.row(row + axis).segment(axis * functions.cols(), functions.cols()) =
              problem.weight()(row + axis) * functions.row(i);
        }
      }
      members_.push_back(std::move(columns));
    }
  }
  bool named() const override { return false; }
  Cause cause(const Best&) const override { return {"unknown", -1, "", "", {}}; }
  std::vector<std::string> depends_on() const override { return on_; }

 private:
  static MatrixXd products(const MatrixXd& a, const MatrixXd& b) {
    MatrixXd all(a.rows(), a.cols() * b.cols());
    for (Index k = 0; k < a.cols(); ++k) {
      all.middleCols(k * b.cols(), b.cols()) = (b.array().colwise() * a.col(k).array()).matrix();
    }
    return all;
  }
  std::vector<std::string> on_;
};

}  // namespace

FamilyPtr make_joint_map_family(const LinearProblem& problem, int joint) {
  const VectorXd q = angles(problem, joint);
  const VectorXd x = spread(q, kSmallestSpan);
  if (x.size() == 0) return nullptr;
  return std::make_unique<JointMapFamily>(problem, joint, x, q.maxCoeff() - q.minCoeff());
}

FamilyPtr make_anonymous_family(const LinearProblem& problem, const std::vector<int>& joints) {
  std::vector<std::string> on;
  std::vector<VectorXd> x;
  for (const int joint : joints) {
    on.push_back(fmt::format("q{}", joint + 1));
    x.push_back(spread(angles(problem, joint), kSmallestSpan));
  }
  if (joints.empty()) {
    on.emplace_back("time");
    x.push_back(VectorXd::LinSpaced(problem.poses(), -1, 1));
  }
  if (std::any_of(x.begin(), x.end(), [](const VectorXd& one) { return one.size() == 0; })) return nullptr;
  return std::make_unique<AnonymousFamily>(problem, std::move(on), x);
}

}  // namespace trammel
