#include "server/diagnose/evidence/beginning.h"

namespace trammel::cause_search {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// The strength that a step from each pose on explains; 0 for the first pose, where it would have
/// acted always. Sums from the end give every beginning in one pass.
VectorXd explained_from(const LinearProblem& problem, const MatrixXd& always,
                        const Background& rest, const VectorXd& data) {
  const VectorXd projected = rest.project(data);
  const Index m = always.cols();
  VectorXd along = VectorXd::Zero(m);
  MatrixXd shared = MatrixXd::Zero(rest.root().cols(), m);
  MatrixXd own = MatrixXd::Identity(m, m);
  VectorXd explained = VectorXd::Zero(problem.poses());
  for (Index i = problem.poses() - 1; i >= 1; --i) {
    const Index row = problem.first_row(i);
    const Index count = problem.row_count(i);
    const auto C = always.middleRows(row, count);
    along.noalias() += C.transpose() * projected.segment(row, count);
    shared.noalias() += rest.root().middleRows(row, count).transpose() * C;
    own.noalias() += C.transpose() * C;
    const Eigen::LLT<MatrixXd> factor(own - shared.transpose() * shared);
    if (factor.info() == Eigen::Success) explained(i) = along.dot(factor.solve(along));
  }
  return explained;
}

}  // namespace

std::vector<Index> possible_beginnings(const LinearProblem& problem, const MatrixXd& always,
                                       const Background& rest, const VectorXd& data, Index found) {
  const VectorXd explained = explained_from(problem, always, rest, data);
  const double least = explained.maxCoeff() - kBeginning95;
  std::vector<Index> possible;
  for (Index i = 1; i < problem.poses(); ++i) {
    if (i == found || explained(i) > least) possible.push_back(i);
  }
  return possible;
}

}  // namespace trammel::cause_search
