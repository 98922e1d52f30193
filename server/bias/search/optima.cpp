#include "server/bias/search/optima.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/bias/search/starts.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kSameParameters =
    0.1;  // in logs, for every parameter: closer ends are one optimum
constexpr double kHopeless =
    30.0;  // nat behind the best on the same points: more points will not make up for it
constexpr double kOtherKind = 0.7;    // in logs of the noise: a factor of two
constexpr double kDifference = 0.02;  // in logs: a step over which a curvature is constant

bool same(const Optimum& a, const Optimum& b) {
  return std::abs(a.value - b.value) < kSameOptimum ||
         (a.x - b.x).cwiseAbs().maxCoeff() < kSameParameters;
}

}  // namespace

Optimum improved(ProfiledLikelihood* likelihood, const VectorXd& start,
                 const MatrixXd& inverse_hessian, const BfgsOptions& options) {
  std::vector<std::pair<VectorXd, VectorXd>>
      visited;  // the last point tried need not be the one kept
  const Objective objective = [&](const VectorXd& x, ObjectiveValue* out) {
    const bool defined = likelihood->evaluate(x, out);
    if (defined) visited.emplace_back(x, likelihood->signal_variance());
    return defined;
  };
  Optimum found{minimise(objective, start, inverse_hessian, options), {}};
  for (const auto& [x, signal_variance] : visited) {
    if (found.defined && x == found.x) found.signal_variance = signal_variance;
  }
  return found;
}

Optimum searched(ProfiledLikelihood* likelihood, const VectorXd& start,
                 const BfgsOptions& options) {
  const double curvature = 0.02 * static_cast<double>(likelihood->size());
  return improved(likelihood, start, MatrixXd::Identity(start.size(), start.size()) / curvature,
                  options);
}

void use_curvature(ProfiledLikelihood* likelihood, double least, Optimum* now) {
  const Index count = now->x.size();
  MatrixXd hessian(count, count);
  ObjectiveValue there;
  for (Index p = 0; p < count; ++p) {
    VectorXd moved = now->x;
    moved[p] += kDifference;
    if (!likelihood->evaluate(moved, &there)) return;
    hessian.col(p) = (there.gradient - now->gradient) / kDifference;
  }
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(0.5 * (hessian + hessian.transpose()));
  const VectorXd curvature = eigen.eigenvalues().cwiseAbs().cwiseMax(least);
  now->inverse_hessian = eigen.eigenvectors() * curvature.cwiseInverse().asDiagonal() *
                         eigen.eigenvectors().transpose();
}

double log_noise(const Optimum& optimum) {
  return 0.5 * (optimum.x[optimum.x.size() - 1] + optimum.signal_variance.array().log().mean());
}

bool other_kind(const Optimum& a, const Optimum& b) {
  return std::abs(log_noise(a) - log_noise(b)) > kOtherKind;
}

std::vector<Optimum> different(std::vector<Optimum> optima, std::size_t most) {
  std::stable_sort(optima.begin(), optima.end(),
                   [](const Optimum& a, const Optimum& b) { return a.value < b.value; });
  std::vector<Optimum> kept;
  bool both_kinds = false;
  for (Optimum& optimum : optima) {
    if (std::any_of(kept.begin(), kept.end(),
                    [&](const Optimum& other) { return same(optimum, other); }))
      continue;
    const bool needed = !kept.empty() && !both_kinds && other_kind(optimum, kept.front());
    const bool hopeless = !kept.empty() && optimum.value > kept.front().value + kHopeless;
    if (!needed && (hopeless || kept.size() >= most)) continue;
    kept.push_back(std::move(optimum));
    both_kinds = both_kinds || needed;
  }
  return kept;
}

}  // namespace trammel
