#include "server/plan/optimal_design.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

#include "server/base/units.h"
#include "server/calibrate/calibrate.h"
#include "server/plan/plan.h"
#include "tests/support/figure.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using test::cell_7;

const std::vector<std::string> kM3 = {"base", "geometry", "compliance"};

PhysicalModel m3_model() {
  PhysicalModel model = make_physical_model(cell_7(), kM3).value();
  model.values = planning_values(model);
  return model;
}

std::vector<PoseContext> hypercube(int count, std::uint64_t seed) {
  std::vector<PoseContext> contexts;
  const Eigen::MatrixXd q = plan_poses(*cell_7(), {count, seed}).value();
  for (Eigen::Index i = 0; i < q.rows(); ++i) {
    PoseContext context;
    context.q = q.row(i).transpose();
    context.tool = "spindle";
    context.payload = "spindle";
    contexts.push_back(std::move(context));
  }
  return contexts;
}

Eigen::MatrixXd prior() { return Eigen::MatrixXd::Identity(36, 36); }

double criterion_of(const std::vector<PoseContext>& poses) {
  return log_det(prior() + information_of(m3_model(), poses, true));
}

TEST(OptimalDesign, RowsAreMeasuredInSigmasByPriorUnits) {
  // A base that stands one prior scale (2 mm) elsewhere moves every measured x by 2 mm: so many
  // sigmas.
  const PhysicalModel model = m3_model();
  const PoseContext context = hypercube(1, 1).front();
  const Eigen::MatrixXd J = whitened_jacobian(model, context, true);
  ASSERT_EQ(J.rows(), 6);
  ASSERT_EQ(J.cols(), 36);
  EXPECT_NEAR(J(0, 0), 2 / 0.013, 1e-6);
  EXPECT_NEAR(J.block(3, 3, 3, 1).norm(), 5e-3 / from_deg(0.0035), 1e-6);
  EXPECT_EQ(whitened_jacobian(model, context, false), J.topRows(3));
}

TEST(OptimalDesign, BestOfATinyProblemIsFoundAgainstEverySubset) {
  // 3 of 9 rows in the plane: greedy and exchange against all 84 subsets.
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(0, 1);
  int found = 0;
  for (int trial = 0; trial < 20; ++trial) {
    DesignCandidates candidates{Eigen::MatrixXd::NullaryExpr(9, 2, [&] { return normal(random); }),
                                1};
    const Eigen::MatrixXd start = Eigen::MatrixXd::Identity(2, 2) * 1e-3;
    const Design design = optimal_design(candidates, start, 3).value();
    double best = -1e9;
    for (int a = 0; a < 9; ++a) {
      for (int b = 0; b < a; ++b) {
        for (int c = 0; c < b; ++c) {
          const Eigen::MatrixXd rows = candidates.rows(std::vector<int>{a, b, c}, Eigen::all);
          best = std::max(best, log_det(start + rows.transpose() * rows));
        }
      }
    }
    EXPECT_LE(design.criterion, best + 1e-9);
    const Eigen::MatrixXd rows = candidates.rows(design.chosen, Eigen::all);
    EXPECT_NEAR(design.criterion, log_det(start + rows.transpose() * rows), 1e-9);
    found += design.criterion > best - 1e-3 ? 1 : 0;
  }
  EXPECT_GE(found, 18);
}

TEST(OptimalDesign, BeatsEveryRandomSetAndEveryLatinHypercube) {
  const std::vector<PoseContext> candidates = hypercube(1000, 1);
  const auto chosen = next_best_poses(m3_model(), prior(), candidates, 40).value();
  ASSERT_EQ(std::set<std::size_t>(chosen.begin(), chosen.end()).size(), 40u);
  std::vector<PoseContext> planned;
  for (const std::size_t i : chosen) planned.push_back(candidates[i]);
  const double reached = criterion_of(planned);
  double best_random = -1e9;
  double best_hypercube = -1e9;
  for (std::uint64_t seed = 0; seed < 30; ++seed) {
    std::vector<PoseContext> drawn;
    std::mt19937_64 random(seed);
    std::sample(candidates.begin(), candidates.end(), std::back_inserter(drawn), 40, random);
    best_random = std::max(best_random, criterion_of(drawn));
    best_hypercube = std::max(best_hypercube, criterion_of(hypercube(40, 100 + seed)));
  }
  EXPECT_GT(reached, best_random + 4);
  EXPECT_GT(reached, best_hypercube + 4);
}

TEST(OptimalDesign, ExchangeImprovesOnGreed) {
  const std::vector<PoseContext> candidates = hypercube(500, 2);
  const DesignCandidates rows = design_candidates(m3_model(), candidates, true);
  const Design design = optimal_design(rows, prior(), 12).value();
  EXPECT_GT(design.exchanges, 0);
  // No single swap is left that gains.
  double best_swap = -1e9;
  for (const std::size_t out : design.chosen) {
    Eigen::MatrixXd others = prior();
    for (const std::size_t i : design.chosen) {
      const auto J = rows.rows.middleRows(6 * static_cast<Eigen::Index>(i), 6);
      if (i != out) others += J.transpose() * J;
    }
    for (std::size_t in = 0; in < candidates.size(); in += 7) {
      if (std::find(design.chosen.begin(), design.chosen.end(), in) != design.chosen.end())
        continue;
      const auto J = rows.rows.middleRows(6 * static_cast<Eigen::Index>(in), 6);
      best_swap = std::max(best_swap, log_det(others + J.transpose() * J));
    }
  }
  EXPECT_LE(best_swap, design.criterion + 2e-3);
}

TEST(OptimalDesign, TheMostTellingPosesComeFirst) {
  const std::vector<PoseContext> candidates = hypercube(300, 3);
  const auto chosen = next_best_poses(m3_model(), prior(), candidates, 20).value();
  std::vector<PoseContext> first_half, last_half;
  for (std::size_t i = 0; i < 20; ++i)
    (i < 10 ? first_half : last_half).push_back(candidates[chosen[i]]);
  EXPECT_GT(criterion_of(first_half), criterion_of(last_half));
}

TEST(OptimalDesign, NextPosesFillWhatTheMeasuredOnesLeftOpen) {
  // Measured with axes 4 to 6 at rest: the next poses must move them more than those that start
  // from nothing.
  std::vector<PoseContext> measured = hypercube(60, 4);
  for (PoseContext& context : measured) context.q.tail(3).setZero();
  const PhysicalModel model = m3_model();
  const Eigen::MatrixXd known = prior() + information_of(model, measured, true);
  const std::vector<PoseContext> candidates = hypercube(1000, 5);
  const auto gain = [&](const std::vector<std::size_t>& chosen) {
    std::vector<PoseContext> poses;
    for (const std::size_t i : chosen) poses.push_back(candidates[i]);
    return log_det(known + information_of(model, poses, true)) - log_det(known);
  };
  const auto next = next_best_poses(model, known, candidates, 5).value();
  const auto regardless = next_best_poses(model, prior(), candidates, 5).value();
  EXPECT_GT(gain(next), gain(regardless) + 0.5);
}

TEST(OptimalDesign, RefusesMorePosesThanCandidatesAndInformationWithoutPrior) {
  const std::vector<PoseContext> candidates = hypercube(5, 1);
  EXPECT_FALSE(next_best_poses(m3_model(), prior(), candidates, 6));
  EXPECT_FALSE(next_best_poses(m3_model(), prior(), candidates, 0));
  EXPECT_FALSE(next_best_poses(m3_model(), Eigen::MatrixXd::Zero(36, 36), candidates, 2));
  EXPECT_FALSE(next_best_poses(m3_model(), prior() * std::nan(""), candidates, 2));
}

MeasurementBatch measured_at(const VirtualRobot& robot, const Plan& plan, std::uint64_t seed,
                             bool orientation) {
  Eigen::MatrixXd q(static_cast<Eigen::Index>(plan.poses.size()), 6);
  for (Eigen::Index i = 0; i < q.rows(); ++i)
    q.row(i) = plan.poses[static_cast<std::size_t>(i)].context.q.transpose();
  SimulateOptions options;
  options.seed = seed;
  options.orientation = orientation;
  return simulate(robot, q, options).value();
}

/// Root mean square over seeds of the M3 error at 1000 fresh poses, measured with noise, after 40
/// planned ones: mm.
double validation_rms_mm(bool orientation, std::uint64_t seeds) {
  const auto cell = cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const MeasurementBatch fresh = test::measured(robot, 1000, 77);
  double sum = 0;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    PlanOptions options{40, seed, PlanCriterion::kObservability};
    options.orientation = orientation;
    const Plan plan = make_plan(cell, options).value();
    const CalibrationResult result =
        calibrate(cell, kM3, measured_at(robot, plan, 500 + seed, orientation), {}).value();
    double square = 0;
    for (const Measurement& m : fresh.measurements) {
      square += (m.p_W - result.model.pose_W(m.context).translation()).squaredNorm();
    }
    sum += square / static_cast<double>(fresh.measurements.size());
  }
  return to_mm(std::sqrt(sum / static_cast<double>(seeds)));
}

TEST(OptimalDesign, FortyPlannedPosesCalibrateToTheNoise) {
  for (const bool orientation : {true, false}) {
    const double planned = validation_rms_mm(orientation, 4);
    test::tell_figure(orientation ? "M3, 40 planned poses, mm" : "M3, 40 planned positions, mm",
                      planned);
    EXPECT_LE(planned, 0.0265) << "orientation " << orientation;
  }
}

}  // namespace
}  // namespace trammel
