#include "server/fleet/fleet_prior.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using test::demand;

/// A model whose poses have said of every parameter of the arm what it is, to a tenth of `spread`.
class FleetTest : public testing::Test {
 protected:
  /// `values`: of parameters that are not the type's.
  [[nodiscard]] FleetMember member(
      int seed, const std::vector<std::pair<std::string, double>>& values = {}) const {
    std::mt19937_64 random(static_cast<std::uint64_t>(seed));
    std::normal_distribution<double> normal;
    ModelParts parts;
    parts.physics = demand(make_physical_model(cell_, {"base", "geometry", "compliance"}));
    const std::vector<Parameter> parameters = parts.physics.parameters();
    const auto P = static_cast<Eigen::Index>(parameters.size());
    parts.covariance = Eigen::MatrixXd::Zero(P, P);
    for (Eigen::Index k = 0; k < P; ++k) {
      const Parameter& parameter = parameters[static_cast<std::size_t>(k)];
      double value = (0.5 + kSpread * normal(random)) * parameter.prior_scale;
      for (const auto& [name, own] : values)
        if (name == parameter.name) value = own * parameter.prior_scale;
      const double stddev = 0.1 * kSpread * parameter.prior_scale;
      parts.physics.values(k) = value;
      parts.covariance(k, k) = stddev * stddev;
      parts.parameters.push_back({parameter, value, stddev, true});
    }
    const Eigen::Index joints = cell_->robot.size();
    parts.q_min = JointVector::Constant(joints, -1);
    parts.q_max = JointVector::Constant(joints, 1);
    return {std::to_string(seed), demand(CompensatedModel::make(std::move(parts)))};
  }
  [[nodiscard]] std::vector<FleetMember> fleet(int robots) const {
    std::vector<FleetMember> members;
    for (int k = 0; k < robots; ++k) members.push_back(member(k + 1));
    return members;
  }
  [[nodiscard]] double scale_of(const std::string& name) const {
    for (const Parameter& one :
         demand(make_physical_model(cell_, {"geometry", "compliance"})).parameters())
      if (one.name == name) return one.prior_scale;
    return 0;
  }

  static constexpr double kSpread = 0.05;  // of a prior's scale
  std::shared_ptr<const Cell> cell_ = test::cell_7();
};

TEST_F(FleetTest, MeanAndSpreadOfTheTypeAreLearned) {
  const FleetPrior prior = demand(learn_fleet_prior(cell_->robot, fleet(12)));
  EXPECT_EQ(prior.robots, 12);
  EXPECT_EQ(prior.find("x0"), nullptr) << "the base is no part of a robot's type";
  for (const std::string name : {"d4", "C3", "alpha2"}) {
    const FleetParameter* one = prior.find(name);
    ASSERT_NE(one, nullptr) << name;
    EXPECT_NEAR(one->mean, 0.5 * scale_of(name), 0.05 * scale_of(name)) << name;
    EXPECT_NEAR(one->spread, kSpread * scale_of(name), 0.4 * kSpread * scale_of(name)) << name;
  }
}

TEST_F(FleetTest, AnOddRobotIsNamedAndWidensNoSpread) {
  std::vector<FleetMember> members = fleet(12);
  const double usual = demand(learn_fleet_prior(cell_->robot, members)).find("C3")->spread;
  members.push_back(member(99, {{"C3", 1.5}}));
  const FleetPrior with_odd = demand(learn_fleet_prior(cell_->robot, members));
  EXPECT_LT(with_odd.find("C3")->spread, 1.6 * usual);
  const std::vector<Unlike> unlike = unlike_twins(members.back().model.parts(), with_odd);
  ASSERT_EQ(unlike.size(), 1u);
  EXPECT_EQ(unlike.front().parameter, "C3");
  EXPECT_GT(unlike.front().z, 4);
  EXPECT_NE(to_string(unlike.front()).find(" deg/kNm, its twins have "), std::string::npos)
      << to_string(unlike.front());
  EXPECT_TRUE(unlike_twins(member(50).model.parts(), with_odd).empty());
}

TEST_F(FleetTest, OfFleetsOfOneLawAtMostOneInTwentyHasARobotThatIsCalledUnlike) {
  constexpr int kFleets = 40;
  for (const int robots : {4, 8}) {
    int with_one = 0;
    for (int f = 0; f < kFleets; ++f) {
      bool any = false;
      for (int odd = 0; odd < robots; ++odd) {
        std::vector<FleetMember> others;
        for (int k = 0; k < robots; ++k)
          if (k != odd) others.push_back(member(1000 * robots + 20 * f + k));
        const FleetPrior prior = demand(learn_fleet_prior(cell_->robot, others));
        any |= !unlike_twins(member(1000 * robots + 20 * f + odd).model.parts(), prior).empty();
      }
      with_one += any;
    }
    EXPECT_LE(with_one, 5)
        << robots
        << " robots: of 40 fleets two are expected at the most, six in one of fifty tries";
  }
}

TEST_F(FleetTest, AnOddOneAmongEightIsStillNamed) {
  const FleetPrior prior = demand(learn_fleet_prior(cell_->robot, fleet(7)));
  const std::vector<Unlike> unlike = unlike_twins(member(99, {{"C3", 3.0}}).model.parts(), prior);
  ASSERT_EQ(unlike.size(), 1u);
  EXPECT_EQ(unlike.front().parameter, "C3");
}

TEST_F(FleetTest, TwoTwinsSayNothing) {
  const auto prior = learn_fleet_prior(cell_->robot, fleet(2));
  ASSERT_FALSE(prior);
  EXPECT_EQ(prior.error().code, ErrorCode::kRefused);
}

}  // namespace
}  // namespace trammel
