#include "server/compensate/budget/effects.h"

#include <map>

namespace trammel {

namespace {

constexpr double kNoMotion = 1e-9;  // share of the largest: a frame's motion that another frame can
                                    // also make

Eigen::Matrix3Xd positions_by(const PhysicalModel& model, const MeasurementBatch& rows) {
  Eigen::Matrix3Xd all(3, std::ssize(rows.measurements));
  for (Eigen::Index i = 0; i < all.cols(); ++i)
    all.col(i) = model.pose_W(rows.measurements[static_cast<std::size_t>(i)].context).translation();
  return all;
}

}  // namespace

Effects effects_of(const LeftAt& left, const Datum& datum, const std::vector<BudgetItem>& items,
                   const MeasurementBatch& positions) {
  const PhysicalModel& physics = datum.model;
  const Eigen::Matrix3Xd whole = positions_by(physics, positions);
  const PhysicalModel told_load = with_told_load(physics);
  const bool other_load = told_load.sources.size() != physics.sources.size();
  const Eigen::Matrix3Xd whole_of_told_load =
      other_load ? positions_by(told_load, positions) : whole;

  Effects effects;
  effects.total = left.drawing;
  effects.rest = left.all;
  effects.learned = left.physics - left.all;
  effects.together = effects.total - effects.rest - effects.learned;
  for (const BudgetItem& item : items) {
    const bool of_gearbox = other_load && item.line.kind == LineKind::kJointCompliance;
    const Eigen::Matrix3Xd rest =
        of_gearbox ? positions_by(without(told_load, in_told_load(physics, item)), positions)
                   : positions_by(without(physics, item), positions);
    effects.lines.push_back((of_gearbox ? whole_of_told_load : whole) - rest);
    effects.together -= effects.lines.back();
  }
  return effects;
}

Eigen::Matrix3Xd effect_of_all(const PhysicalModel& model,
                               const std::vector<const BudgetItem*>& items,
                               const MeasurementBatch& positions) {
  PhysicalModel rest = model;
  for (const BudgetItem* item : items)
    for (const Eigen::Index place : item->places) rest.values(place) = 0;
  return positions_by(model, positions) - positions_by(rest, positions);
}

BeyondFrames::BeyondFrames(const PhysicalModel& model, const MeasurementBatch& positions) {
  const auto n = std::ssize(positions.measurements);
  std::map<std::string, Eigen::Index> tools;  // first column of each
  for (const Measurement& m : positions.measurements)
    tools.try_emplace(m.context.tool, 6 + 3 * std::ssize(tools));
  Eigen::MatrixXd motions = Eigen::MatrixXd::Zero(3 * n, 6 + 3 * std::ssize(tools));
  for (Eigen::Index i = 0; i < n; ++i) {
    const PoseContext& context = positions.measurements[static_cast<std::size_t>(i)].context;
    const Pose X_WT = model.nominal_pose_W(context);
    const Vector3 lever = X_WT.translation() - model.X_WB.translation();
    motions.block<3, 3>(3 * i, 0).setIdentity();
    for (int k = 0; k < 3; ++k) motions.block<3, 1>(3 * i, 3 + k) = Vector3::Unit(k).cross(lever);
    motions.block<3, 3>(3 * i, tools.at(context.tool)) = X_WT.linear();
  }
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(motions);
  qr.setThreshold(kNoMotion);
  basis_ = qr.householderQ() * Eigen::MatrixXd::Identity(3 * n, qr.rank());
}

Eigen::Matrix3Xd BeyondFrames::operator()(const Eigen::Matrix3Xd& vectors) const {
  const Eigen::VectorXd flat = vectors.reshaped();
  const Eigen::VectorXd rest = flat - basis_ * (basis_.transpose() * flat);
  return rest.reshaped(3, vectors.cols());
}

}  // namespace trammel
