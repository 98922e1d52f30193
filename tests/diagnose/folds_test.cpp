#include "server/diagnose/search/folds.h"

#include <gtest/gtest.h>

#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel::cause_search {
namespace {

/// A number of each pose's own, which only the rows of that pose tell.
TEST(Folds, ARowIsNotPredictedFromAnotherReflectorOfItsPose) {
  constexpr Eigen::Index kPoses = 24;
  const auto cell = test::cell_7();
  MeasurementBatch batch = test::measured(test::chapter_5_robot(cell), kPoses, 1, false);
  const auto first = batch.measurements;  // all of one reflector, then all of the other
  batch.measurements.insert(batch.measurements.end(), first.begin(), first.end());
  const LinearProblem problem(test::demand(make_physical_model(cell, {})), batch, {}, {});
  Eigen::MatrixXd own = Eigen::MatrixXd::Zero(problem.rows(), kPoses);
  for (Eigen::Index i = 0; i < problem.poses(); ++i)
    own.block(problem.first_row(i), i % kPoses, problem.row_count(i), 1).setConstant(10);
  const Eigen::VectorXd data = Eigen::VectorXd::Ones(problem.rows());
  EXPECT_TRUE(Folds(problem, own).held_out_residual(data).isApprox(data));
}

}  // namespace
}  // namespace trammel::cause_search
