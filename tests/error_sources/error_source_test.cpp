#include "server/error_sources/error_source.h"

#include <gtest/gtest.h>

#include <memory>
#include <random>

#include "server/base/units.h"
#include "server/error_sources/physical_model.h"

namespace trammel {
namespace {

std::shared_ptr<const Cell> cell_7() {
  return std::make_shared<const Cell>(*read_cell(std::string(TRAMMEL_SOURCE_DIR) + "/config/cell-7.yaml"));
}

PoseContext some_pose(const Cell& cell, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> angle(-1, 1);
  PoseContext context;
  context.q.resize(cell.robot.size());
  for (int i = 0; i < cell.robot.size(); ++i) context.q(i) = angle(random);
  context.tool = "spindle";
  context.payload = "spindle";
  return context;
}

/// Values as large as real ones, so that second-order terms would show.
Eigen::VectorXd plausible_values(const PhysicalModel& model, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(0.2, 0.9);
  Eigen::VectorXd values = model.prior_values();
  const std::vector<Parameter> parameters = model.parameters();
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    values(static_cast<Eigen::Index>(i)) += unit(random) * parameters[i].prior_scale;
  }
  return values;
}

TEST(ErrorSources, EveryJacobianFitsCentralDifferencesAloneAndTogether) {
  const auto cell = cell_7();
  const std::vector<std::vector<std::string>> lists = {{"base"},
                                                       {"tool"},
                                                       {"geometry"},
                                                       {"compliance_first_order"},
                                                       {"compliance_equilibrium"},
                                                       {"compliance_linear"},
                                                       {"base", "geometry", "tool", "compliance_first_order"},
                                                       {"base", "geometry", "tool", "compliance_equilibrium"},
                                                       {"base", "geometry", "tool", "compliance_linear"}};
  for (const auto& specs : lists) {
    const PhysicalModel model = *make_physical_model(cell, specs);
    const Eigen::VectorXd values = plausible_values(model, 5);
    const PoseContext context = some_pose(*cell, 6);
    Eigen::MatrixXd J;
    model.pose_W(context, values, &J);
    const std::vector<Parameter> parameters = model.parameters();
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      const double step = 1e-3 * parameters[static_cast<std::size_t>(i)].prior_scale;
      Eigen::VectorXd ahead = values;
      Eigen::VectorXd behind = values;
      ahead(i) += step;
      behind(i) -= step;
      const Vector6 change =
          pose_difference(model.pose_W(context, ahead, nullptr), model.pose_W(context, behind, nullptr)) / (2 * step);
      EXPECT_LT((J.col(i) - change).norm(), 1e-6 * (1 + change.norm()))
          << specs.back() << " of " << specs.size() << ", " << parameters[static_cast<std::size_t>(i)].name;
    }
  }
}

TEST(ErrorSources, ThreeFormsOfComplianceAgreeToFirstOrderAndDifferBySquares) {
  const auto cell = cell_7();
  const PoseContext context = some_pose(*cell, 7);
  const auto deflected = [&](const char* form, double stiffness_factor) {
    PhysicalModel model = *make_physical_model(cell, {form});
    model.values.setConstant(from_rad_per_nmm(2e-9) * stiffness_factor);
    return Vector3(model.pose_W(context).translation() - model.nominal_pose_W(context).translation());
  };
  for (const char* form : {"compliance_equilibrium", "compliance_linear"}) {
    const double soft = (deflected(form, 1) - deflected("compliance_first_order", 1)).norm();
    const double stiff = (deflected(form, 0.1) - deflected("compliance_first_order", 0.1)).norm();
    EXPECT_GT(soft, 1e-6) << form;              // a micrometre and more: worth telling apart
    EXPECT_NEAR(soft / stiff, 100, 5) << form;  // quadratic in the compliance
    EXPECT_LT(soft, 0.02 * deflected(form, 1).norm());
  }
}

TEST(ErrorSources, WithoutValuesTheModelIsNominal) {
  const auto cell = cell_7();
  const PhysicalModel model = *make_physical_model(cell, {"base", "geometry", "compliance", "tool"});
  const PoseContext context = some_pose(*cell, 8);
  EXPECT_LT(pose_difference(model.pose_W(context), model.nominal_pose_W(context)).norm(), 1e-12);
}

TEST(ErrorSources, GeometryHasTheParametersOfTheSource) {
  const PhysicalModel model = *make_physical_model(cell_7(), {"geometry"});
  std::string names;
  for (const Parameter& parameter : model.parameters()) names += parameter.name + " ";
  EXPECT_EQ(names,
            "q1 d1 a1 alpha1 q2 a2 alpha2 beta2 q3 d3 a3 alpha3 q4 d4 a4 alpha4 q5 d5 a5 alpha5 q6 d6 a6 alpha6 ");
}

TEST(ErrorSources, LevelsAreListsOfSources) {
  using List = std::vector<std::string>;
  EXPECT_EQ(*parse_level("M0"), List{});
  EXPECT_EQ(*parse_level("M1"), List{"base"});
  EXPECT_EQ(*parse_level("M3"), (List{"base", "geometry", "compliance"}));
  EXPECT_EQ(*parse_level("M2, tool"), (List{"base", "geometry", "tool"}));
  EXPECT_FALSE(parse_level(""));
  EXPECT_FALSE(parse_level("M2,,tool"));
  EXPECT_FALSE(parse_level("M2,base"));
}

TEST(ErrorSources, UnknownNamesAreRefusedWithTheKnownOnes) {
  const auto cell = cell_7();
  const Result<ErrorSourcePtr> unknown = make_error_source("gremlins", *cell);
  ASSERT_FALSE(unknown);
  EXPECT_NE(unknown.error().message.find("geometry"), std::string::npos);
  EXPECT_FALSE(make_error_source("geometry:3", *cell));
}

}  // namespace
}  // namespace trammel
