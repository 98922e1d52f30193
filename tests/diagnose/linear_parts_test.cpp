#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "server/diagnose/evidence/background.h"
#include "server/diagnose/evidence/refine.h"
#include "server/diagnose/families/candidates.h"
#include "server/diagnose/search/folds.h"
#include "server/measurement/checked_batch.h"
#include "tests/support/three_reflectors.h"
#include "tests/support/virtual_robot.h"

namespace trammel::cause_search {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd random_matrix(Index rows, Index cols, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  MatrixXd m(rows, cols);
  for (double& value : m.reshaped()) value = normal(random);
  return m;
}

/// The chapter 5 robot in cell 7, calibrated by the list of the cell, and a linear problem about
/// it.
struct Calibrated {
  explicit Calibrated(int poses) : batch(test::measured(test::chapter_5_robot(cell), poses, 3)) {
    batch = MeasurementBatch(check_against_cell(batch, *cell)->rows());
    const CalibrationResult calibration = *calibrate(cell, cell->model.error_sources, batch, {});
    model.model = calibration.model;
    for (const IdentifiedParameter& one : calibration.parameters)
      model.priors.push_back(one.parameter);
  }
  LinearProblem problem() const {
    return {model.model, batch, model.priors, candidate_sources(*cell, batch, nullptr)};
  }
  std::shared_ptr<const Cell> cell = test::cell_7();
  MeasurementBatch batch;
  PriorModel model;
};

/// A linear problem about a calibration of three reflectors.
LinearProblem of_three_reflectors(const MeasurementBatch& batch) {
  const auto cell = test::cell_of_three_reflectors();
  const CalibrationResult calibration = *calibrate(cell, cell->model.error_sources, batch, {});
  std::vector<Parameter> priors;
  for (const IdentifiedParameter& one : calibration.parameters) priors.push_back(one.parameter);
  return {calibration.model, batch, priors, {}};
}

TEST(LinearProblem, ReflectorsThatShareWhatIsLeftOfAPoseWeighAndCountAsOne) {
  const MeasurementBatch shared = test::seen_by_three(70, 60e-6, 0, 6),
                         apart = test::seen_by_three(70, 0, 60e-6, 6);
  const LinearProblem one = of_three_reflectors(shared), three = of_three_reflectors(apart);
  EXPECT_NEAR(one.noise(), three.noise(), 0.15 * three.noise()) << "a row is off by as much";
  const double weight = one.weight().mean() * one.noise(),
               weight_apart = three.weight().mean() * three.noise();
  EXPECT_LT(weight, 0.72) << "as one of three";
  EXPECT_GT(weight_apart, 0.85);
  EXPECT_LT(one.position_spread().freedom, 0.55 * three.position_spread().freedom);
}

TEST(Background, ProjectsAsTheInverseOfItsCovarianceDoes) {
  const MatrixXd Z = 3 * random_matrix(40, 6, 4);
  const MatrixXd y = random_matrix(40, 2, 5);
  const MatrixXd S = MatrixXd::Identity(40, 40) + Z * Z.transpose();
  const Background background(Z);
  EXPECT_LT((background.project(y) - S.llt().solve(y)).cwiseAbs().maxCoeff(), 1e-10);
  EXPECT_LT((background.estimate(y) - Z.transpose() * S.llt().solve(y)).cwiseAbs().maxCoeff(),
            1e-10);
}

TEST(Background, OfSomeOfItsColumnsIsTheBackgroundOfThoseAlone) {
  const MatrixXd Z = 3 * random_matrix(40, 6, 4);
  const MatrixXd y = random_matrix(40, 2, 5);
  const std::vector<Index> some = {0, 2, 5};
  const Background alone(Z(Eigen::all, some));
  const Background part = Background(Z).part(some);
  EXPECT_LT((part.project(y) - alone.project(y)).cwiseAbs().maxCoeff(), 1e-10);
  EXPECT_LT((part.root() - alone.root()).cwiseAbs().maxCoeff(), 1e-10);
}

/// nat: the evidence of `columns`, per prior, beside the background.
double evidence_of(const MatrixXd& columns, const Background& background, const VectorXd& data) {
  const MatrixXd information = columns.transpose() * background.project(columns) +
                               MatrixXd::Identity(columns.cols(), columns.cols());
  const VectorXd right = columns.transpose() * background.project(data);
  const Eigen::LLT<MatrixXd> factor(information);
  return 0.5 * right.dot(factor.solve(right)) -
         MatrixXd(factor.matrixL()).diagonal().array().log().sum();
}

TEST(SmoothFamily, ChoosesItsSizeByTheEvidenceOfItsColumns) {
  const Calibrated calibrated(60);
  const LinearProblem problem = calibrated.problem();
  const Background background(problem.nuisance());
  for (const std::vector<int>& joints : {std::vector<int>{}, {1}, {2, 4}}) {
    const FamilyPtr family = make_anonymous_family(problem, joints);
    ASSERT_NE(family, nullptr);
    Best planted = family->typical();
    planted.size = 1e-4;
    const MatrixXd columns = family->columns(planted);
    const VectorXd data = problem.residual() + columns * random_matrix(columns.cols(), 1, 8);
    const Best best = family->scan({background}, background.project(data)).front();
    ASSERT_GT(best.evidence, 0);
    EXPECT_NEAR(best.evidence, evidence_of(family->columns(best), background, data),
                1e-6 * best.evidence);
  }
}

/// The best of every family in `data`.
std::vector<Best> best_of(const std::vector<FamilyPtr>& families, const View& view,
                          const VectorXd& data) {
  std::vector<Best> all;
  for (const FamilyPtr& family : families)
    all.push_back(family->scan(view, view.background.project(data)).front());
  return all;
}

TEST(Families, SayTheSameBesideABackgroundWhateverWasScannedBefore) {
  const Calibrated calibrated(60);
  const LinearProblem problem = calibrated.problem();
  const Background first(problem.nuisance());
  const Background second(problem.nuisance().leftCols(problem.nuisance().cols() / 2));
  VectorXd keep = VectorXd::Ones(problem.rows());
  keep.segment(problem.first_row(20), problem.row_count(20)).setZero();
  const Background some_rows(keep.asDiagonal() * problem.nuisance());
  const VectorXd data = 3 * random_matrix(problem.rows(), 1, 7);
  const std::vector<FamilyPtr> families = make_families(problem);
  for (const View& view : {View{first}, View{first}, View{some_rows, &keep}, View{second},
                           View{some_rows, &keep}, View{second}}) {
    const std::vector<Best> now = best_of(families, view, data),
                            anew = best_of(make_families(problem), view, data);
    for (std::size_t f = 0; f < families.size(); ++f) {
      EXPECT_EQ(now[f].strength, anew[f].strength) << families[f]->label();
      EXPECT_EQ(now[f].evidence, anew[f].evidence) << families[f]->label();
    }
  }
}

TEST(LogEvidence, IsInvertedByStrengthFor) {
  for (const double freedom : {1.0, 2.0, 6.0, 30.0}) {
    EXPECT_NEAR(log_evidence(strength_for(12, freedom), freedom), 12, 1e-6);
    EXPECT_EQ(log_evidence(freedom, freedom), 0);
  }
}

TEST(Folds, PredictAHeldOutPoseFromTheOthersOnly) {
  const Calibrated calibrated(40);
  const LinearProblem problem = calibrated.problem();
  const Folds folds(problem, problem.nuisance());
  const VectorXd left = folds.held_out_residual(problem.residual());
  // What is measured at a pose does not change what the others say of it.
  VectorXd moved = problem.residual();
  moved.segment(problem.first_row(7), problem.row_count(7)).array() += 50;
  const VectorXd change = folds.held_out_residual(moved) - left;
  EXPECT_LT(
      (change.segment(problem.first_row(7), problem.row_count(7)).array() - 50).abs().maxCoeff(),
      1e-6);
  EXPECT_GT((change.array().abs() > 1e-3).count(), 20);
}

TEST(Folds, WithoutAnyColumnLeaveTheDataAsTheyAre) {
  const Calibrated calibrated(40);
  const LinearProblem problem = calibrated.problem();
  const Folds folds(problem, problem.nuisance());
  EXPECT_EQ(folds.held_out_residual(problem.residual(), {}), problem.residual());
}

TEST(GearFamily, FindsTheOrderThatWasPlantedInTheRowsHoweverManyTeethMesh) {
  const Calibrated calibrated(120);
  const LinearProblem problem = calibrated.problem();
  const FamilyPtr gear = make_order_family(problem, {"gear_transmission", 2});
  ASSERT_NE(gear, nullptr);
  const Background background(problem.nuisance());
  for (const double order :
       {2.7, 37.3, 202.0, 320.0}) {  // two waves a motor turn at ratios of 101 and of 160
    Best planted = gear->typical();
    planted.order = order;
    const VectorXd effect = gear->columns(planted) * Eigen::Vector2d(0.03, -0.04);
    const Best found =
        gear->scan({background}, background.project(problem.residual() + effect)).front();
    EXPECT_NEAR(found.order, order, 0.1);
    const double strength = effect.dot(background.project(effect).col(0));
    EXPECT_NEAR(found.strength, strength, 5 * std::sqrt(strength)) << order;
  }
}

TEST(Refine, LeavesACalibratedModelWhereItIs) {
  Calibrated calibrated(80);
  const VectorXd before = calibrated.model.model.values;
  refine(calibrated.model, calibrated.batch, {});
  VectorXd moved = calibrated.model.model.values - before;
  for (Index k = 0; k < moved.size(); ++k)
    moved(k) /= calibrated.model.priors[static_cast<std::size_t>(k)].prior_scale;
  EXPECT_LT(moved.cwiseAbs().maxCoeff(), 0.05);
}

TEST(Refine, AddsAndRemovesASourceWithItsPriors) {
  Calibrated calibrated(60);
  const VectorXd before = calibrated.model.model.values;
  const std::size_t priors = calibrated.model.priors.size();
  ASSERT_TRUE(add_to(calibrated.model, "encoder_eccentricity:2"));
  EXPECT_EQ(calibrated.model.priors.size(), priors + 2);
  EXPECT_EQ(calibrated.model.priors.size(),
            static_cast<std::size_t>(calibrated.model.model.parameter_count()));
  remove_from(calibrated.model, "encoder_eccentricity:2");
  EXPECT_EQ(calibrated.model.model.values, before);
  EXPECT_EQ(calibrated.model.priors.size(), priors);
}

TEST(Chance, LetsTheBestOfAllPassThreeTimesInAThousand) {
  const Calibrated calibrated(40);
  const LinearProblem problem = calibrated.problem();
  const std::vector<FamilyPtr> families = make_families(problem);
  const Background background(problem.nuisance());
  const Chance chance = chance_of(families, background, 300, 1);
  const Winners fresh = winners(families, background, draw_null(background, 300, 99), chance);
  const auto above = [&](double limit) {
    return std::count_if(fresh.score.begin(), fresh.score.end(),
                         [&](double score) { return score > limit; });
  };
  EXPECT_LE(above(chance.limit), 5);            // 0.9 expected, 5 in 1 of 400
  EXPECT_GE(above(chance.limit_at(0.09)), 10);  // 27 expected
  EXPECT_LE(chance.p_value(chance.limit + 20), 1e-6);
}

}  // namespace
}  // namespace trammel::cause_search
