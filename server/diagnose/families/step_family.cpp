#include <algorithm>

#include "server/diagnose/families/family.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kFewestPoses = 4;  // on either side of a step

/// Columns that are zero before a pose. Sums from the end give every beginning in one pass.
class StepFamily final : public Family {
 public:
  StepFamily(const LinearProblem& problem, MatrixXd columns, Cause cause, std::string spec)
      : problem_(problem),
        columns_(std::move(columns)),
        cause_(std::move(cause)),
        spec_(std::move(spec)) {}

  Cause cause(const Best& best) const override {
    Cause cause = cause_;
    cause.pose_id = measurement(best).pose_id;
    return cause;
  }
  std::string source(const Best& best) const override {
    return fmt::format("{}@{}", spec_, measurement(best).context.index + 1);
  }
  MatrixXd columns(const Best& best) const override {
    MatrixXd C = columns_;
    C.topRows(problem_.first_row(best.pose)).setZero();
    return C;
  }
  Best typical() const override {
    return {.freedom = static_cast<int>(columns_.cols()), .pose = problem_.poses() / 2};
  }

  std::vector<Best> scan(const View& view, const MatrixXd& projected) const override {
    const Index m = columns_.cols();
    const std::vector<Beginning>& beginnings =
        beginnings_.of(view, [&] { return beginnings_beside(view); });
    std::vector<Best> best(static_cast<std::size_t>(projected.cols()));
    MatrixXd along = MatrixXd::Zero(m, projected.cols());
    for (const Beginning& beginning : beginnings) {
      const Index row = problem_.first_row(beginning.pose);
      const Index count = problem_.row_count(beginning.pose);
      along.noalias() +=
          columns_.middleRows(row, count).transpose() * projected.middleRows(row, count);
      if (beginning.inverse.size() == 0) continue;
      const MatrixXd whitened = beginning.inverse.lazyProduct(along);
      for (Index d = 0; d < projected.cols(); ++d) {
        Best& one = best[static_cast<std::size_t>(d)];
        const double strength = whitened.col(d).squaredNorm();
        if (strength > one.strength)
          one = {.strength = strength, .freedom = static_cast<int>(m), .pose = beginning.pose};
      }
    }
    for (Best& one : best) one.evidence = log_evidence(one.strength, one.freedom);
    return best;
  }

 private:
  struct Beginning {
    Index pose;
    MatrixXd inverse;  ///< L⁻¹ of the information of a step that begins here, priors included;
                       ///< empty where none can
  };
  /// From the last pose on.
  std::vector<Beginning> beginnings_beside(const View& view) const {
    const Index m = columns_.cols();
    const MatrixXd root = view.background.root().transpose();
    std::vector<Beginning> beginnings;
    MatrixXd shared = MatrixXd::Zero(root.rows(), m);
    MatrixXd own = MatrixXd::Identity(m, m);  // the prior's share
    for (Index i = problem_.poses() - 1; i >= kFewestPoses; --i) {
      const Index row = problem_.first_row(i);
      const Index count = problem_.row_count(i);
      if (view.keep && (*view.keep)(row) == 0) continue;
      const auto C = columns_.middleRows(row, count);
      shared += root.middleCols(row, count).lazyProduct(C);
      own += C.transpose().lazyProduct(C);
      beginnings.push_back({i, {}});
      if (i > problem_.poses() - kFewestPoses) continue;
      const Eigen::LLT<MatrixXd> factor(own - shared.transpose() * shared);
      if (factor.info() == Eigen::Success)
        beginnings.back().inverse = factor.matrixL().solve(MatrixXd::Identity(m, m));
    }
    return beginnings;
  }
  const Measurement& measurement(const Best& best) const {
    return problem_.batch().measurements[static_cast<std::size_t>(best.pose)];
  }

  const LinearProblem& problem_;
  MatrixXd columns_;
  Cause cause_;
  std::string spec_;
  BesideBackground<std::vector<Beginning>> beginnings_;
};

class PoseFamily final : public Family {
 public:
  PoseFamily(const LinearProblem& problem, Cause cause)
      : problem_(problem), cause_(std::move(cause)) {}

  Cause cause(const Best& best) const override {
    Cause cause = cause_;
    cause.pose_id = problem_.batch().measurements[static_cast<std::size_t>(best.pose)].pose_id;
    return cause;
  }
  bool predicts() const override { return false; }
  MatrixXd columns(const Best& best) const override {
    const Index pose = best.pose;
    MatrixXd C = MatrixXd::Zero(problem_.rows(), problem_.row_count(pose));
    C.middleRows(problem_.first_row(pose), C.cols()).setIdentity();
    return kPriorSigmas * C;
  }

  std::vector<Best> scan(const View& view, const MatrixXd& projected) const override {
    std::vector<Best> best(static_cast<std::size_t>(projected.cols()));
    for (Index i = 0; i < problem_.poses(); ++i) {
      const Index row = problem_.first_row(i);
      const Index count = problem_.row_count(i);
      if (view.keep && (*view.keep)(row) == 0) continue;
      consider(view, projected, i, row, 3, best);
      if (count > 3) consider(view, projected, i, row, count, best);
    }
    return best;
  }

 private:
  static constexpr double kPriorSigmas = 100;

  /// `count` rows of a pose: its position, or position and orientation.
  static void consider(const View& view, const MatrixXd& projected, Index pose, Index row,
                       Index count, std::vector<Best>& best) {
    const auto U = view.background.root().middleRows(row, count);
    const MatrixXd information =
        (1 + 1 / (kPriorSigmas * kPriorSigmas)) * MatrixXd::Identity(count, count) -
        U * U.transpose();
    const Eigen::LLT<MatrixXd> factor(information);
    if (factor.info() != Eigen::Success) return;
    const MatrixXd whitened = factor.matrixL().solve(projected.middleRows(row, count));
    for (Index d = 0; d < projected.cols(); ++d) {
      Best& one = best[static_cast<std::size_t>(d)];
      const double strength = whitened.col(d).squaredNorm();
      const double evidence = log_evidence(strength, static_cast<double>(count));
      if (evidence > one.evidence) {
        one = {.evidence = evidence,
               .strength = strength,
               .freedom = static_cast<int>(count),
               .pose = pose};
      }
    }
  }

  const LinearProblem& problem_;
  Cause cause_;
};

}  // namespace

FamilyPtr make_step_family(const LinearProblem& problem, const Effect& effect, Cause cause,
                           std::string spec) {
  return std::make_unique<StepFamily>(problem, effect.columns, std::move(cause), std::move(spec));
}

FamilyPtr make_pose_family(const LinearProblem& problem, Cause cause) {
  return std::make_unique<PoseFamily>(problem, std::move(cause));
}

}  // namespace trammel::cause_search
