#include <cmath>

#include "server/diagnose/families/family.h"
#include "server/numerics/product.h"

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
  return text + wanderer();
}

namespace {

VectorXd kept_rows(const View& view, const VectorXd& g) {
  return view.keep ? VectorXd(view.keep->cwiseProduct(g)) : g;
}

/// N x k: the rows of each pose, times g's, summed up. Column by column, as they lie in memory.
MatrixXd summed_up(const LinearProblem& problem, const VectorXd& g, const MatrixXd& rows) {
  MatrixXd sums(problem.poses(), rows.cols());
  for (Index k = 0; k < rows.cols(); ++k) {
    const auto column = rows.col(k);
    for (Index i = 0; i < problem.poses(); ++i) {
      double sum = 0;
      for (Index row = problem.first_row(i); row < problem.first_row(i + 1); ++row)
        sum += g(row) * column(row);
      sums(i, k) = sum;
    }
  }
  return sums;
}

}  // namespace

const Shares& shares_of(const LinearProblem& problem, const View& view, const std::string& name,
                        const VectorXd& g, const MatrixXd& projected) {
  auto& all = view.known->of_data;
  const auto known = all.find(name);
  if (known != all.end()) return known->second;
  const VectorXd kept = kept_rows(view, g);
  Shares shares{summed_up(problem, kept, projected), summed_up(problem, kept, kept)};
  return all.insert_or_assign(name, std::move(shares)).first->second;
}

const MatrixXd& root_shares_of(const LinearProblem& problem, const View& view,
                               const std::string& name, const VectorXd& g) {
  auto& all = view.known->of_root;
  const auto known = all.find(name);
  if (known != all.end()) return known->second;
  return all.insert_or_assign(name, summed_up(problem, kept_rows(view, g), view.background.root()))
      .first->second;
}

namespace {

class FixedFamily : public Family {
 public:
  FixedFamily(Cause cause, std::string source, MatrixXd columns, double surprise)
      : cause_(std::move(cause)),
        source_(std::move(source)),
        columns_(std::move(columns)),
        surprise_(surprise) {}
  double surprise() const override { return surprise_; }

  Cause cause(const Best&) const override { return cause_; }
  std::string source(const Best&) const override { return source_; }
  MatrixXd columns(const Best&) const override { return columns_; }
  Best typical() const override { return {.freedom = static_cast<int>(columns_.cols())}; }

  std::vector<Best> scan(const View& view, const MatrixXd& projected) const override {
    const MatrixXd& seen = seen_.of(view, [&] { return seen_beside(view); });
    std::vector<Best> best(static_cast<std::size_t>(projected.cols()));
    if (seen.cols() == 0) return best;
    const MatrixXd along = transposed_product(seen, projected);
    for (Index k = 0; k < projected.cols(); ++k) {
      const double strength = along.col(k).squaredNorm();
      const auto freedom = static_cast<int>(seen.cols());
      best[static_cast<std::size_t>(k)] = {
          .evidence = log_evidence(strength, freedom), .strength = strength, .freedom = freedom};
    }
    return best;
  }

 private:
  /// R x seen: the directions that these poses show, of unit variance beside the background.
  MatrixXd seen_beside(const View& view) const {
    const MatrixXd C = view.keep ? MatrixXd(view.keep->asDiagonal() * columns_) : columns_;
    const MatrixXd shared = transposed_product(view.background.root(), C);
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(gram(C) - gram(shared));
    // Directions that change less than the noise at their prior's size are invisible.
    Index hidden = 0;
    while (hidden < C.cols() && eigen.eigenvalues()(hidden) < 1) ++hidden;
    const Index seen = C.cols() - hidden;
    const VectorXd scale = eigen.eigenvalues().tail(seen).cwiseSqrt().cwiseInverse();
    return C * (eigen.eigenvectors().rightCols(seen) * scale.asDiagonal());
  }

  Cause cause_;
  std::string source_;
  MatrixXd columns_;
  double surprise_;
  BesideBackground<MatrixXd> seen_;
};

constexpr double kTypicalSag = 1e-3;  // m

class AttitudeFamily final : public FixedFamily {
 public:
  explicit AttitudeFamily(MatrixXd columns)
      : FixedFamily(unknown_cause(), "", std::move(columns), 0) {}
  bool named() const override { return false; }
  std::vector<std::string> depends_on() const override { return {kAttitude}; }
};

/// The motion of the tool along each of its axes, for gravity along each of them: nine columns.
MatrixXd sags(const LinearProblem& problem) {
  const PhysicalModel& model = problem.model();
  MatrixXd columns = MatrixXd::Zero(problem.rows(), 9);
  for (Index i = 0; i < problem.poses(); ++i) {
    const Matrix3 R_WT =
        model.pose_W(problem.batch().measurements[static_cast<std::size_t>(i)].context).linear();
    const Vector3 down_T = R_WT.transpose() * model.cell->gravity_W.normalized();
    const Index row = problem.first_row(i);
    for (Index k = 0; k < 3; ++k)
      columns.block<3, 3>(row, 3 * k) =
          kTypicalSag * down_T(k) * (problem.weight().segment<3>(row).asDiagonal() * R_WT);
  }
  return columns;
}

}  // namespace

FamilyPtr make_attitude_family(const LinearProblem& problem) {
  if (!(problem.model().cell->gravity_W.norm() > 0)) return nullptr;
  return std::make_unique<AttitudeFamily>(sags(problem));
}

FamilyPtr make_fixed_family(const LinearProblem&, const Effect& effect, Cause cause,
                            const std::vector<Index>& chosen, double surprise) {
  return std::make_unique<FixedFamily>(std::move(cause), effect.source,
                                       effect.columns(Eigen::all, chosen), surprise);
}

}  // namespace trammel::cause_search
