#include "server/plan/separation.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "server/plan/optimal_design.h"
#include "server/plan/plan.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using test::cell_7;

Plan separating(const std::shared_ptr<const Cell>& cell, const std::string& cause,
                const std::string& other, bool bidirectional = false,
                std::vector<std::string> payloads = {}) {
  PlanOptions options{30, 1, PlanCriterion::kSeparation, cause, other, bidirectional};
  options.payloads = std::move(payloads);
  Result<Plan> plan = make_plan(cell, options);
  EXPECT_TRUE(plan) << plan.error().message;
  return *plan;
}

const ParameterSeparation& of(const Separability& separability, const std::string& parameter) {
  const auto found =
      std::find_if(separability.parameters.begin(), separability.parameters.end(),
                   [&](const ParameterSeparation& p) { return p.parameter == parameter; });
  EXPECT_NE(found, separability.parameters.end()) << parameter;
  return *found;
}

TEST(Separation, IsWhatALeastSquaresFitOfTheRestLeaves) {
  // Against the residual of a regularised fit of the effect's column by the columns of all others.
  const CausePair pair = make_cause_pair(cell_7(), "encoder_eccentricity:2", "payload").value();
  PlanOptions options{50, 1};
  std::vector<PoseContext> poses;
  const Plan plan = make_plan(cell_7(), options).value();
  for (const PlannedPose& pose : plan.poses) poses.push_back(pose.context);
  const Eigen::MatrixXd J = design_candidates(pair.model, poses, true).rows;
  std::vector<Eigen::Index> all_others = pair.rest;
  all_others.insert(all_others.end(), pair.columns.begin() + 1, pair.columns.end());
  const auto others = static_cast<Eigen::Index>(all_others.size());
  Eigen::MatrixXd A(J.rows() + others, others);
  A << J(Eigen::all, all_others), Eigen::MatrixXd::Identity(others, others);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(A.rows());
  b.head(J.rows()) = J.col(pair.columns.front());
  const double left = (b - A * A.colPivHouseholderQr().solve(b)).squaredNorm();
  const Separability told = separability(pair, J.transpose() * J);
  ASSERT_EQ(told.parameters.size(), pair.columns.size());
  EXPECT_NEAR(told.parameters.front().strength / left, 1, 1e-6);
  EXPECT_NEAR(told.parameters.front().share, std::sqrt(left) / b.norm(), 1e-6);
}

TEST(Separation, PlannedPosesSeparateBetterThanALatinHypercube) {
  for (const auto& [cause, other] :
       {std::pair("encoder_eccentricity:2", "payload"), std::pair("payload", "compliance"),
        std::pair("wrist_coupling", "geometry")}) {
    const Plan plan = separating(cell_7(), cause, other);
    ASSERT_TRUE(plan.separation);
    EXPECT_GT(plan.separation->plan.strength, 1.3 * plan.separation->latin_hypercube.strength)
        << cause;
    EXPECT_GT(plan.criterion, plan.criterion_of_latin_hypercube) << cause;
  }
}

TEST(Separation, NoPoseTellsAPayloadsMassFromComplianceButAHeavierPayloadHelps) {
  const Plan one = separating(cell_7(), "payload", "compliance");
  EXPECT_EQ(one.separation->hopeless, std::vector<std::string>{"mass"});
  EXPECT_NE(one.separation->needs.find("second known payload"), std::string::npos);
  EXPECT_LT(of(one.separation->candidates, "mass").strength, 0.01);

  auto cell = std::make_shared<Cell>(*cell_7());
  cell->payloads["heavy"] = Payload{200, {0.1, 0.05, 0.2}};
  const Plan two = separating(cell, "payload", "compliance", false, {"spindle", "heavy"});
  // Known to 5 kg of 200, it tells what the joints give way by to 2.5 %, and that the first
  // weighs 2.5 kg more or less.
  EXPECT_NEAR(of(two.separation->candidates, "mass[spindle]").strength, 4, 0.5);
}

TEST(Separation, WhatNoPoseShowsIsSaidToBeHopeless) {
  const Plan plan = separating(cell_7(), "thermal_growth", "geometry");
  EXPECT_EQ(plan.separation->hopeless.size(), plan.separation->plan.parameters.size());
  EXPECT_EQ(plan.separation->plan.strength, 0);
  EXPECT_NE(plan.separation->needs.find("temperature"), std::string::npos);
}

TEST(Separation, TheOrderOfAGearIsNotAskedForBeforeItsAmplitude) {
  const Plan plan = separating(cell_7(), "gear_transmission:3@48", "geometry");
  EXPECT_TRUE(plan.separation->hopeless.empty());
  EXPECT_EQ(of(plan.separation->plan, "order3").effect, 0);
}

TEST(Separation, SaysWhichToolErrorsAreTheLastLinks) {
  const Plan plan = separating(cell_7(), "tool", "geometry");
  std::vector<std::string> hopeless = plan.separation->hopeless;
  std::sort(hopeless.begin(), hopeless.end());
  EXPECT_EQ(hopeless, (std::vector<std::string>{"trx", "trz", "tx", "tz"}));
  EXPECT_EQ(plan.separation->needs, "a second tool");
}

TEST(Separation, BacklashIsToldFromGeometrySinceAPlanGoesBothWays) {
  for (const bool twice : {false, true}) {
    const Plan plan = separating(cell_7(), "backlash:2", "geometry", twice);
    EXPECT_TRUE(plan.separation->hopeless.empty());
    EXPECT_TRUE(plan.separation->needs.empty());
    EXPECT_GT(of(plan.separation->plan, "b2").share, 0.5);
  }
  EXPECT_NE(what_would_separate("backlash:2", "geometry").find("--bidirectional"),
            std::string::npos);
}

TEST(Separation, RefusesACauseBesideItselfAndUnknownOnes) {
  EXPECT_FALSE(make_cause_pair(cell_7(), "compliance", "compliance"));
  EXPECT_FALSE(make_cause_pair(cell_7(), "gremlins", "compliance"));
  EXPECT_FALSE(make_cause_pair(cell_7(), "compliance", "backlash:9"));
  EXPECT_FALSE(make_cause_pair(cell_7(), "", "compliance"));
}

}  // namespace
}  // namespace trammel
