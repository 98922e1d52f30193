#include "server/bias/hyperparameter_search.h"

#include <gtest/gtest.h>

#include "server/calibrate/calibrate.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using Eigen::Index;

/// What geometry alone leaves over of the virtual robot: its compliance, in all joints' full ranges.
GpData sag_of_the_virtual_robot(int poses) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const MeasurementBatch batch = test::measured(robot, poses, 5);
  const PhysicalModel model = test::demand(calibrate(cell, {"base", "geometry"}, batch, {})).model;
  const Index n = poses;
  GpData data{Eigen::MatrixXd(n, 6), Eigen::MatrixXd(n, 3), Eigen::VectorXd::Ones(n)};
  for (Index i = 0; i < n; ++i) {
    const Measurement& m = batch.measurements[static_cast<std::size_t>(i)];
    data.q.row(i) = m.context.q.transpose();
    data.y.row(i) = (m.p_W - model.pose_W(m.context).translation()).transpose();
  }
  data.y.rowwise() -= data.y.colwise().mean().eval();
  return data;
}

// 300 poses cannot tell the fine influence of joint 4 on the height from 0.7 mm of noise; 700 can, by 90 nats.
TEST(HyperparameterSearch, FindsAFineInfluenceThatFewPosesTakeForNoise) {
  const GpData data = sag_of_the_virtual_robot(700);
  for (const std::uint64_t seed : {1, 2}) {
    SearchOptions options;
    options.seed = seed;
    const auto found = search_hyperparameters(make_kernel("se"), data, 13e-6, options);
    ASSERT_TRUE(found.has_value());
    EXPECT_LT(std::exp(found->outputs[2].log_noise_stddev), 300e-6) << "seed " << seed;
    EXPECT_LT(std::exp(found->outputs[2].kernel[3]), 4.0) << "rad, seed " << seed;
  }
}

}  // namespace
}  // namespace trammel
