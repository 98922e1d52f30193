#include "server/numerics/numerics.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "server/numerics/builds/builds.h"
#include "server/numerics/product.h"
#include "tests/bias/bias_data.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Every build that this processor runs must agree with Eigen.
std::vector<const Numerics*> runnable_builds() {
  std::vector<const Numerics*> builds = {&numerics_baseline()};
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
    builds.push_back(&numerics_avx2());
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq"))
    builds.push_back(&numerics_avx512());
  return builds;
}

class EveryBuild : public testing::TestWithParam<const Numerics*> {
 protected:
  const Numerics& build() const { return *GetParam(); }
};

MatrixXd positive_definite(Index n, std::uint64_t seed) {
  const MatrixXd a = random_joints(n, seed, n);
  return a * a.transpose() + 0.5 * MatrixXd::Identity(n, n);
}

MatrixXd augmented(const MatrixXd& m, const MatrixXd& y) {
  const Index n = m.rows();
  const Index rows = padded_rows(n + y.cols());
  MatrixXd a = MatrixXd::Zero(rows, rows);
  a.topLeftCorner(n, n) = m.triangularView<Eigen::Lower>();
  a.block(n, 0, y.cols(), n) = y.transpose();
  return a;
}

TEST_P(EveryBuild, SweepInvertsAndSolves) {
  for (const Index n : {1, 7, 32, 33, 100, 401, 450}) {
    const MatrixXd m = positive_definite(n, 41);
    const MatrixXd y = random_joints(n, 42, 3);
    MatrixXd a = augmented(m, y);
    VectorXd work(build().work_size(n + 3));
    double log_det = 0;
    ASSERT_TRUE(build().sweep(n, 3, a.data(), a.rows(), work.data(), &log_det));
    const MatrixXd inverse = a.topLeftCorner(n, n).selfadjointView<Eigen::Lower>();
    EXPECT_LT((inverse * m + MatrixXd::Identity(n, n)).norm(), 1e-9 * static_cast<double>(n)) << n;
    EXPECT_LT((m * a.block(n, 0, 3, n).transpose() - y).norm(), 1e-8) << n;
    const double expected = 2.0 * MatrixXd(m.llt().matrixL()).diagonal().array().log().sum();
    EXPECT_NEAR(log_det, expected, 1e-8 * (1.0 + std::abs(expected))) << n;
  }
}

TEST_P(EveryBuild, InverseRootIsTheInverseOfTheCholeskyFactor) {
  for (const Index n : {1, 7, 32, 33, 100, 401, 450}) {
    const MatrixXd m = positive_definite(n, 43);
    const MatrixXd y = random_joints(n, 44, 1);
    MatrixXd a = augmented(m, y);
    VectorXd work(build().work_size(n + 1));
    double log_det = 0;
    ASSERT_TRUE(build().inverse_root(n, 1, a.data(), a.rows(), work.data(), &log_det));
    const MatrixXd root = a.topLeftCorner(n, n).triangularView<Eigen::Lower>();
    const MatrixXd lower = m.llt().matrixL();
    EXPECT_LT((root * lower - MatrixXd::Identity(n, n)).norm(), 1e-9 * static_cast<double>(n)) << n;
    EXPECT_LT((m * a.row(n).head(n).transpose() + y).norm(), 1e-8) << n;

    std::vector<double> packed(static_cast<std::size_t>(build().packed_size(n)));
    for (Index first = 0; first < n; first += build().packed_rows)
      build().pack_lower(n, first, a.data(), a.rows(), packed.data() + build().packed_size(first));
    const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> k =
        random_joints(n, 45, kTargetBlock);
    double norms[kTargetBlock];
    build().square_norms(n, packed.data(), kTargetBlock, k.data(), norms);
    for (Index j = 0; j < kTargetBlock; ++j) {
      const double expected = (root * k.col(j)).squaredNorm();
      EXPECT_NEAR(norms[j], expected, 1e-9 * expected);
      const VectorXd column = k.col(j);
      double alone = 0;
      build().square_norms(n, packed.data(), 1, column.data(), &alone);
      EXPECT_NEAR(alone, expected, 1e-9 * expected);
    }
  }
}

TEST_P(EveryBuild, MultipliesByATranspose) {
  struct Size {
    Index rows, cols, depth;
  };
  for (const auto& [rows, cols, depth] :
       {Size{1, 1, 1}, {24, 8, 96}, {50, 31, 97}, {7, 130, 200}}) {
    MatrixXd a = MatrixXd::Zero(padded_rows(rows), depth);
    MatrixXd b = MatrixXd::Zero(padded_rows(cols), depth);
    MatrixXd c = MatrixXd::Zero(padded_rows(rows), padded_rows(cols));
    a.topRows(rows) = random_joints(rows, 47, depth);
    b.topRows(cols) = random_joints(cols, 48, depth);
    c.topLeftCorner(rows, cols) = random_joints(rows, 49, cols);
    const MatrixXd expected = c - a * b.transpose();
    VectorXd work(build().multiply_work_size(rows, cols));
    build().multiply_transposed(rows, cols, depth, -1.0, a.data(), a.rows(), b.data(), b.rows(),
                                false, c.data(), c.rows(), work.data());
    EXPECT_LT((c - expected).cwiseAbs().maxCoeff(), 1e-12);
  }
}

TEST_P(EveryBuild, MultipliesAPackedTriangleInSinglePrecisionByVectors) {
  for (const Index n : {1, 7, 33, 401}) {
    const MatrixXd triangle = random_joints(n, 55, n).triangularView<Eigen::Lower>();
    const MatrixXd rounded = triangle.cast<float>().cast<double>();
    std::vector<double> packed(static_cast<std::size_t>(build().packed_size(n)));
    for (Index first = 0; first < n; first += build().packed_rows)
      build().pack_lower(n, first, triangle.data(), n, packed.data() + build().packed_size(first));
    const std::vector<float> singles(packed.begin(), packed.end());
    const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> k =
        random_joints(n, 56, kTargetBlock);
    double norms[kTargetBlock];
    build().square_norms_single(n, singles.data(), kTargetBlock, k.data(), norms);
    for (Index j = 0; j < kTargetBlock; ++j) {
      const VectorXd column = k.col(j);
      const double expected = (rounded * column).squaredNorm();
      EXPECT_NEAR(norms[j], expected, 1e-12 * expected) << n;
      double alone = 0;
      build().square_norms_single(n, singles.data(), 1, column.data(), &alone);
      EXPECT_NEAR(alone, expected, 1e-12 * expected) << n;
    }
  }
}

TEST_P(EveryBuild, MultipliesATransposeByAMatrix) {
  for (const auto& [k, m, n] : {std::tuple{1, 1, 1}, {7, 5, 3}, {1033, 9, 6}, {64, 4, 4}}) {
    const MatrixXd a = random_joints(k, 53, m);
    const MatrixXd b = random_joints(k, 54, n);
    MatrixXd c = MatrixXd::Constant(m, n, -7);
    build().transposed_product(k, m, a.data(), k, n, b.data(), k, c.data(), m);
    EXPECT_LT((c - a.transpose() * b).cwiseAbs().maxCoeff(), 1e-11 * k);
    EXPECT_LT((transposed_product(a, b) - c).cwiseAbs().maxCoeff(), 1e-11 * k);
  }
}

TEST(Triangles, AreMultipliedAndInvertedAsEigenDoes) {
  for (const Index n : {1, 5, 32, 70, 131}) {
    const MatrixXd a = random_joints(n + 40, 55, static_cast<int>(n));
    const MatrixXd expected = a.transpose() * a;
    EXPECT_LT((gram(a) - expected).cwiseAbs().maxCoeff(), 1e-11 * static_cast<double>(n));
    const MatrixXd m = expected + MatrixXd::Identity(n, n);
    const auto inverse = inverse_factor(m);
    ASSERT_TRUE(inverse);
    EXPECT_LT(
        (*inverse * m * inverse->transpose() - MatrixXd::Identity(n, n)).cwiseAbs().maxCoeff(),
        1e-9);
    EXPECT_EQ(MatrixXd(inverse->triangularView<Eigen::StrictlyUpper>()).cwiseAbs().maxCoeff(), 0);
    const MatrixXd product = a * inverse->transpose();
    EXPECT_LT((times_lower_transposed(a, *inverse) - product).cwiseAbs().maxCoeff(),
              1e-11 * static_cast<double>(n));
  }
  EXPECT_FALSE(inverse_factor(-MatrixXd::Identity(3, 3)));
}

TEST_P(EveryBuild, MultipliesTheLowerTriangleAlone) {
  const MatrixXd a = random_joints(72, 50, 60);
  MatrixXd c = MatrixXd::Zero(72, 72);
  VectorXd work(build().multiply_work_size(72, 72));
  build().multiply_transposed(72, 72, 60, 1.0, a.data(), 72, a.data(), 72, true, c.data(), 72,
                              work.data());
  const MatrixXd difference = (c - a * a.transpose()).triangularView<Eigen::Lower>();
  EXPECT_LT(difference.cwiseAbs().maxCoeff(), 1e-12);
}

TEST_P(EveryBuild, TrianglesSurvivePacking) {
  for (const Index n : {1, 23, 24, 25, 100}) {
    const VectorXd triangle = random_joints(n * (n + 1) / 2, 51, 1);
    VectorXd packed(build().packed_size(n));
    VectorXd back(triangle.size());
    build().pack_triangle(n, triangle.data(), packed.data());
    build().unpack_triangle(n, packed.data(), back.data());
    EXPECT_EQ(triangle, back) << n;
  }
}

// A model that one processor learns predicts on another.
TEST_P(EveryBuild, AgreesWithTheBaselineToRounding) {
  const Index n = 200;
  MatrixXd a = MatrixXd::Zero(padded_rows(n), 7);
  a.topLeftCorner(n, 6) = random_joints(n, 52);
  a.col(6) = 0.5 * a.leftCols(6).rowwise().squaredNorm();
  for (const RadialShape shape :
       {RadialShape::kSquaredExponential, RadialShape::kMatern32, RadialShape::kMatern52}) {
    const auto inverse_of = [&](const Numerics& numerics) {
      MatrixXd m = MatrixXd::Zero(padded_rows(n), padded_rows(n));
      numerics.radial_tile(shape, 6, n, a.data(), a.rows(), n, a.data(), a.rows(), m.data(),
                           m.rows());
      m.diagonal().head(n).array() += 0.01;
      m.bottomRows(m.rows() - n).setZero();
      VectorXd work(numerics.work_size(n));
      double log_det = 0;
      EXPECT_TRUE(numerics.sweep(n, 0, m.data(), m.rows(), work.data(), &log_det));
      return MatrixXd(m.topLeftCorner(n, n).triangularView<Eigen::Lower>());
    };
    const MatrixXd expected = inverse_of(numerics_baseline());
    EXPECT_LT((inverse_of(build()) - expected).norm(), 1e-11 * expected.norm());
  }
}

TEST_P(EveryBuild, SaysWhenAMatrixIsNotPositiveDefinite) {
  MatrixXd m = positive_definite(50, 46);
  m(40, 40) = -1.0;
  MatrixXd a = augmented(m, MatrixXd::Zero(50, 1));
  VectorXd work(build().work_size(51));
  double log_det = 0;
  EXPECT_FALSE(build().sweep(50, 1, a.data(), a.rows(), work.data(), &log_det));
  a = augmented(m, MatrixXd::Zero(50, 1));
  EXPECT_FALSE(build().inverse_root(50, 1, a.data(), a.rows(), work.data(), &log_det));
}

TEST_P(EveryBuild, KernelIsAccurateFromZeroToFarAway) {
  MatrixXd a = MatrixXd::Zero(kRowPadding, 2);
  const double distances[] = {0, 1e-9, 1e-4, 0.1, 0.5, 1, 2, 5, 10, 20, 30, 37, 100};
  for (Index i = 0; i < 13; ++i) a(i, 0) = distances[i];
  a.col(1) = 0.5 * a.col(0).cwiseAbs2();
  const double origin[] = {0, 0};
  double k[kRowPadding];
  build().radial_tile(RadialShape::kSquaredExponential, 1, 13, a.data(), a.rows(), 1, origin, 1, k,
                      kRowPadding);
  for (Index i = 0; i < 13; ++i) {
    const double expected = std::exp(-0.5 * distances[i] * distances[i]);
    EXPECT_NEAR(k[i], expected,
                2e-15 * std::max(1.0, 0.5 * distances[i] * distances[i]) * expected + 1e-300);
  }
}

INSTANTIATE_TEST_SUITE_P(Builds, EveryBuild, testing::ValuesIn(runnable_builds()),
                         [](const auto& test) { return std::string(test.param->name); });

}  // namespace
}  // namespace trammel
