#include "server/tasks/train/leftover.h"

namespace trammel {

BiasProblem leftover(const PhysicalModel& physics, const MeasurementBatch& batch) {
  const auto n = static_cast<Eigen::Index>(batch.measurements.size());
  BiasProblem problem{Eigen::MatrixXd(n, physics.cell->robot.size()), Eigen::MatrixXd(n, 3),
                      Eigen::VectorXd(n)};
  const Matrix3 R_BW = physics.X_WB.linear().transpose();
  for (Eigen::Index i = 0; i < n; ++i) {
    const Measurement& m = batch.measurements[static_cast<std::size_t>(i)];
    problem.q.row(i) = m.context.q.transpose();
    problem.residual_B.row(i) =
        (R_BW * (m.p_W - physics.pose_W(m.context).translation())).transpose();
    problem.sigma(i) = m.sigma.value_or(physics.cell->tracker.sigma);
  }
  return problem;
}

}  // namespace trammel
