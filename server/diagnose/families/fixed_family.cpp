#include <cmath>

#include "server/diagnose/families/family.h"

namespace trammel::cause_search {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double log_evidence(double strength, double freedom) {
  if (!(strength > freedom) || freedom <= 0) return 0;
  return 0.5 * (strength - freedom - freedom * std::log(strength / freedom));
}

double strength_for(double evidence, double freedom) {
  double low = freedom;
  double high = freedom + 4 * evidence + 100;
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (low + high);
    (log_evidence(middle, freedom) < evidence ? low : high) = middle;
  }
  return high;
}

std::string Family::label() const {
  std::string text = to_string(cause(typical()));
  for (const std::string& on : depends_on()) text += " " + on;
  return text;
}

Shares shares_of(const LinearProblem& problem, const View& view, const VectorXd& g, const MatrixXd& projected) {
  const Index N = problem.poses();
  const MatrixXd& U = view.background.root();
  Shares shares{MatrixXd::Zero(N, projected.cols()), MatrixXd::Zero(N, U.cols()), VectorXd::Zero(N)};
  for (Index i = 0; i < N; ++i) {
    const Index row = problem.first_row(i);
    const Index count = problem.row_count(i);
    if (view.keep && (*view.keep)(row) == 0) continue;
    const auto own = g.segment(row, count).transpose();
    shares.along.row(i).noalias() = own * projected.middleRows(row, count);
    shares.root.row(i).noalias() = own * U.middleRows(row, count);
    shares.square(i) = own.squaredNorm();
  }
  return shares;
}

namespace {

class FixedFamily final : public Family {
 public:
  FixedFamily(Cause cause, std::string source, MatrixXd columns, double surprise)
      : cause_(std::move(cause)), source_(std::move(source)), columns_(std::move(columns)), surprise_(surprise) {}
  double surprise() const override { return surprise_; }

  Cause cause(const Best&) const override { return cause_; }
  std::string source(const Best&) const override { return source_; }
  MatrixXd columns(const Best&) const override { return columns_; }
  Best typical() const override { return {.freedom = static_cast<int>(columns_.cols())}; }

  std::vector<Best> scan(const View& view, const MatrixXd& projected) const override {
    const MatrixXd C = view.keep ? MatrixXd(view.keep->asDiagonal() * columns_) : columns_;
    const MatrixXd shared = view.background.root().transpose() * C;
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(C.transpose() * C - shared.transpose() * shared);
    // Directions that at their prior's size change less than the noise cannot be told from none.
    Index hidden = 0;
    while (hidden < C.cols() && eigen.eigenvalues()(hidden) < 1) ++hidden;
    const Index seen = C.cols() - hidden;
    std::vector<Best> best(static_cast<std::size_t>(projected.cols()));
    if (seen == 0) return best;
    const VectorXd scale = eigen.eigenvalues().tail(seen).cwiseSqrt().cwiseInverse();
    const MatrixXd along =
        scale.asDiagonal() * (eigen.eigenvectors().rightCols(seen).transpose() * (C.transpose() * projected));
    for (Index k = 0; k < projected.cols(); ++k) {
      const double strength = along.col(k).squaredNorm();
      const auto freedom = static_cast<int>(seen);
      best[static_cast<std::size_t>(k)] = {
          .evidence = log_evidence(strength, freedom), .strength = strength, .freedom = freedom};
    }
    return best;
  }

 private:
  Cause cause_;
  std::string source_;
  MatrixXd columns_;
  double surprise_;
};

}  // namespace

FamilyPtr make_fixed_family(const LinearProblem&, const Effect& effect, Cause cause, const std::vector<Index>& chosen,
                            double surprise) {
  return std::make_unique<FixedFamily>(std::move(cause), effect.source, effect.columns(Eigen::all, chosen), surprise);
}

}  // namespace trammel::cause_search
