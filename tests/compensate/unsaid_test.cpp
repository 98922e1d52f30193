#include <gtest/gtest.h>

#include "server/compensate/compensated_model.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

/// The model of cell-7 with that source at those values, everything else known.
CompensatedModel model_of(const std::string& source, const std::vector<double>& values) {
  CompensatedModel::Parts parts;
  parts.physics = test::demand(make_physical_model(test::cell_7(), {source}));
  parts.physics.values =
      Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  parts.q_min = JointVector::Constant(6, -1);
  parts.q_max = JointVector::Constant(6, 1);
  for (const Parameter& parameter : parts.physics.parameters())
    parts.parameters.push_back({parameter, 0, 0, true});
  const auto P = parts.physics.parameter_count();
  parts.covariance = Eigen::MatrixXd::Zero(P, P);
  parts.trained_with = {{"spindle", "spindle"}};
  return test::demand(CompensatedModel::make(std::move(parts)));
}

TEST(Unsaid, WhereARobotComesFromIsUncertaintyToBothSides) {
  constexpr double kHalfWidth = 2e-4;
  const CompensatedModel model = model_of("hysteresis:2", {kHalfWidth, 0.01});
  PoseContext asked;
  asked.q = JointVector::LinSpaced(6, -0.5, 0.6);
  asked.tool = asked.payload = "spindle";
  asked.served = true;
  const ErrorPrediction unsaid = model.predict_all({asked}).front();
  EXPECT_LT(unsaid.error_B.norm(), 1e-9);
  asked.before = asked.q + JointVector::Constant(6, 2);
  const ErrorPrediction from_above = model.predict_all({asked}).front();
  EXPECT_NEAR(unsaid.true_stddev_B.norm(), from_above.error_B.norm(),
              0.01 * from_above.error_B.norm());
  EXPECT_GT(from_above.error_B.norm(), kHalfWidth * 0.8) << "more than half a metre from the axis";
  EXPECT_LT(from_above.true_stddev_B.norm(), 1e-6);
  asked.before = asked.q - JointVector::Constant(6, 2);
  EXPECT_LT((model.predict_all({asked}).front().error_B + from_above.error_B).norm(), 1e-6);
}

TEST(Unsaid, WhatWasMeasuredTooEarlyIsNoDoubtOfWhatIsServed) {
  const CompensatedModel model = model_of("early_reading", std::vector<double>(6, 1e-3));
  PoseContext asked;
  asked.q = JointVector::LinSpaced(6, -0.5, 0.6);
  asked.tool = asked.payload = "spindle";
  asked.served = true;
  const ErrorPrediction prediction = model.predict_all({asked}).front();
  EXPECT_LT(prediction.error_B.norm(), 1e-9);
  EXPECT_LT(prediction.true_stddev_B.norm(), 1e-6);
}

}  // namespace
}  // namespace trammel
