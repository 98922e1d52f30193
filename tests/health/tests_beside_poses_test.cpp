#include "server/health/evidence/tests_beside_poses.h"

#include <gtest/gtest.h>

#include <random>

#include "server/health/evidence/check_tests.h"

namespace trammel::health {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A check of ten poses, three rows each: causes with one number, with four, and with one a pose;
/// then single poses.
class BesidePoses : public testing::Test {
 protected:
  static constexpr Index kPoses = 10, kRows = 3 * kPoses;

  BesidePoses() {
    const MatrixXd mixed = drawn(kRows);
    covariance_ = mixed * mixed.transpose() + MatrixXd::Identity(kRows, kRows);
    frames_ = drawn(6);
    const MatrixXd one = drawn(1);
    MatrixXd by_pose = MatrixXd::Zero(kRows, kPoses);
    for (Index i = 0; i < kPoses; ++i)
      by_pose.col(i).segment<3>(3 * i) = one.col(0).segment<3>(3 * i);
    for (const MatrixXd& columns : {one, drawn(4), by_pose})
      questions_.hypotheses.push_back({0, -1, columns});
    questions_.causes = questions_.hypotheses.size();
    for (Index i = 0; i < kPoses; ++i)
      questions_.hypotheses.push_back({0, static_cast<int>(i), own(i)});
  }
  MatrixXd drawn(Index columns) {
    return MatrixXd::NullaryExpr(kRows, columns, [this] { return normal_(random_); });
  }
  static MatrixXd own(Index pose) {
    MatrixXd columns = MatrixXd::Zero(kRows, 3);
    columns.middleRows<3>(3 * pose).setIdentity();
    return columns;
  }
  /// Everything refitted at once, from the rows.
  [[nodiscard]] CheckTests refitted(const std::vector<int>& bad) const {
    MatrixXd all = frames_;
    for (const int pose : bad) {
      all.conservativeResize(Eigen::NoChange, all.cols() + 3);
      all.rightCols<3>() = own(pose);
    }
    return CheckTests(covariance_, all, questions_);
  }

  std::mt19937_64 random_{3};
  std::normal_distribution<double> normal_;
  MatrixXd covariance_, frames_;
  Questions questions_;
};

TEST_F(BesidePoses, TheySeeWhatARefitOfAllRowsSees) {
  const CheckTests healthy = refitted({});
  const TestsBesidePoses tests(healthy.directions(), questions_.causes, healthy.rows().freedom());
  const VectorXd residual = drawn(1);
  const auto seen = tests.seen(healthy.rows().left(residual));
  for (const std::vector<int>& bad :
       {std::vector<int>{}, {4}, {0, 7}, {1, 3, 8}, {0, 1, 2, 3, 4, 5, 6}}) {
    const auto beside = tests.beside(bad);
    const auto left = beside.left(seen);
    const CheckTests expected = refitted(bad);
    const VectorXd expected_left = expected.rows().left(residual);
    ASSERT_EQ(beside.whole_freedom(), expected.rows().freedom());
    EXPECT_NEAR(left.square, expected_left.squaredNorm(), 1e-8);
    const double price = std::log(static_cast<double>(kRows));
    const std::vector<double> scores = expected.scores(expected_left);
    for (std::size_t h = 0; h < tests.size(); ++h) {
      ASSERT_EQ(beside.freedom(h), expected.freedom(h)) << h << " beside " << bad.size();
      EXPECT_NEAR(beside.explained(h, left), scores[h] + price * expected.freedom(h), 1e-8) << h;
    }
  }
}

}  // namespace
}  // namespace trammel::health
