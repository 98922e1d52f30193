#include "server/numerics/chi_square.h"

#include <gtest/gtest.h>

namespace trammel {
namespace {

TEST(ChiSquare, TailsAreThoseOfTheTables) {
  EXPECT_NEAR(chi_square_tail(3.841, 1), 0.05, 1e-4);
  EXPECT_NEAR(chi_square_tail(5.991, 2), 0.05, 1e-4);
  EXPECT_NEAR(chi_square_tail(18.307, 10), 0.05, 1e-4);
  EXPECT_NEAR(chi_square_tail(50.892, 30), 0.01, 1e-4);
  EXPECT_NEAR(chi_square_limit(0.01, 30), 50.892, 1e-2);
}

TEST(ChiSquare, AShiftedMeanMakesTheTailsHeavierAsTheNoncentralDistributionHasIt) {
  // One degree of freedom: P(|z + d| > x) by the normal distribution, d = 3, x² = 6.
  EXPECT_NEAR(chi_square_tail(6, 1, 9), 0.709015, 1e-4);
  // By 400000 draws: 4 degrees of freedom, noncentrality 20, above 18.467.
  EXPECT_NEAR(chi_square_tail(18.467, 4, 20), 0.6986, 3e-3);
  EXPECT_NEAR(chi_square_tail(900, 3, 1000), 0.9513, 2e-3);
}

}  // namespace
}  // namespace trammel
