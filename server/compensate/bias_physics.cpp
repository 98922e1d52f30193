#include "server/compensate/bias_physics.h"

#include <algorithm>

#include "server/base/check.h"
#include "server/calibrate/frames/frames.h"

namespace trammel {

namespace {

/// In any of its forms.
bool has_source(const PhysicalModel& physics, const std::string& name) {
  return std::any_of(
      physics.sources.begin(), physics.sources.end(),
      [&](const ErrorSourcePtr& source) { return &source->cause() == find_cause(name); });
}

ArmState served_arm(const PhysicalModel& physics, const std::string& tool) {
  PoseContext anywhere;
  anywhere.q = JointVector::Zero(physics.cell->robot.size());
  anywhere.tool = tool;
  anywhere.served = true;
  return physics.state(anywhere);
}

PhysicalModel with_standard_sources(PhysicalModel physics) {
  for (const std::string& name : with_unknown_tool(standard_sources(), *physics.cell)) {
    if (has_source(physics, name)) continue;
    Result<ErrorSourcePtr> source = make_error_source(name, *physics.cell);
    TRAMMEL_CHECK(source.has_value());
    const auto count = static_cast<Eigen::Index>((*source)->parameters().size());
    const Eigen::Index first = add_source(physics, *std::move(source));
    physics.values.segment(first, count)
        .setZero();  // not at the priors, since the residual was computed without them
  }
  return physics;
}

}  // namespace

BiasFeatures turned(const BiasFeatures& features) {
  const auto swapped = [](const Eigen::MatrixXd& rows) {
    Eigen::MatrixXd other(6, rows.cols());
    other << rows.bottomRows<3>(), rows.topRows<3>();
    return other;
  };
  return {swapped(features.by_joint), swapped(features.by_parameter), features.lever_F,
          features.R_BF, features.gears};
}

BiasPhysics::BiasPhysics(const PhysicalModel& physics)
    : BiasPhysics(with_standard_sources(physics), AsItIs{}) {}

BiasPhysics::BiasPhysics(PhysicalModel whole, AsItIs) : whole_(std::move(whole)) {
  const std::vector<Parameter> parameters = whole_.parameters();
  prior_stddev_.resize(static_cast<Eigen::Index>(parameters.size()));
  for (std::size_t k = 0; k < parameters.size(); ++k)
    prior_stddev_(static_cast<Eigen::Index>(k)) = parameters[k].prior_scale;
}

Pose served_base(const PhysicalModel& physics) {
  return served_arm(physics, physics.tools.begin()->first).X_WB;
}

Pose served_tool(const PhysicalModel& physics, const std::string& tool) {
  return served_arm(physics, tool).X_FT;
}

Matrix3 BiasPhysics::turn_to(const PhysicalModel& now) const {
  const auto turned_in_B = [](const PhysicalModel& physics) -> Matrix3 {
    return physics.X_WB.linear().transpose() * served_base(physics).linear();
  };
  return turned_in_B(now) * turned_in_B(whole_).transpose();
}

BiasPhysics BiasPhysics::with_tools_of(const PhysicalModel& now) const {
  PhysicalModel moved = whole_;
  for (auto& [name, X_FT] : moved.tools) {
    const Pose X_FT_now = served_tool(now, name);
    const Pose X_FT_then = served_tool(whole_, name);
    if (X_FT_now.matrix() == X_FT_then.matrix()) continue;
    X_FT = X_FT * X_FT_then.inverse() *
           X_FT_now;  // the errors of a tool come before its nominal frame
  }
  return BiasPhysics(std::move(moved), {});
}

Vector3 BiasPhysics::beyond_first_order(const PoseContext& context,
                                        const Eigen::VectorXd& shift) const {
  Eigen::MatrixXd J_W;
  const Eigen::VectorXd moved = prior_stddev_.cwiseProduct(shift);
  const Vector3 p_W = whole_.pose_W(context, whole_.values, &J_W).translation();
  const Vector3 moved_W =
      whole_.pose_W(context, whole_.values + moved, nullptr).translation() - p_W;
  return whole_.X_WB.linear().transpose() * (moved_W - J_W.topRows<3>() * moved);
}

BiasFeatures BiasPhysics::at(const PoseContext& context) const {
  Eigen::MatrixXd J_W;
  const Matrix3 R_WT = whole_.pose_W(context, whole_.values, &J_W).linear();
  const ArmState state = whole_.state(context);
  const Eigen::MatrixXd by_deflection_W = ArmKinematics(state).deflection_jacobian();
  const Matrix3 R_BW = whole_.X_WB.linear().transpose();
  const auto in_B = [&](const Eigen::MatrixXd& of_W) {
    Eigen::MatrixXd of_B(6, of_W.cols());
    of_B.topRows<3>() = R_BW * of_W.topRows<3>();
    of_B.bottomRows<3>() = R_BW * of_W.bottomRows<3>();
    return of_B;
  };
  BiasFeatures features{in_B(by_deflection_W), in_B(J_W * prior_stddev_.asDiagonal())};
  features.lever_F = state.X_FT.translation();
  features.R_BF = R_BW * R_WT * state.X_FT.linear().transpose();
  const Chain& robot = whole_.cell->robot;
  if (!robot.counts_gears()) features.gears = robot.gear_angles(context.q);
  for (int j = 0; j < robot.size(); ++j) {
    if (robot.joint(j).type != JointType::kRevolute) features.by_joint.col(j).setZero();
  }
  return features;
}

}  // namespace trammel
