#include "server/compensate/budget/between.h"

#include <algorithm>
#include <cmath>

#include "server/compensate/budget/error_budget.h"
#include "server/compensate/budget/items.h"
#include "server/error_sources/catalogue.h"

namespace trammel {

namespace {

bool has(const PhysicalModel& model, const std::string& source) {
  return std::any_of(model.sources.begin(), model.sources.end(),
                     [&](const ErrorSourcePtr& one) { return one->name() == source; });
}

/// The place of each parameter of `model` in `all`, which has the same sources and more; -1: not
/// there.
std::vector<Eigen::Index> places_in(const PhysicalModel& all, const PhysicalModel& model) {
  std::vector<Eigen::Index> places;
  for (const ErrorSourcePtr& source : model.sources) {
    Eigen::Index first = 0;
    for (const ErrorSourcePtr& other : all.sources) {
      if (other->name() == source->name()) break;
      first += std::ssize(other->parameters());
    }
    for (Eigen::Index k = 0; k < std::ssize(source->parameters()); ++k) places.push_back(first + k);
  }
  return places;
}

/// `sign`: 1 of the newer model, -1 of the older one.
void add(const ArmOfNow& parts, double sign, CalibrationResult& between) {
  const std::vector<Eigen::Index> places = places_in(between.model, parts.physics);
  const std::vector<Parameter> parameters = parts.physics.parameters();
  for (std::size_t i = 0; i < places.size(); ++i) {
    double& value = between.model.values(places[i]);
    const double own = parts.physics.values(static_cast<Eigen::Index>(i));
    // The order of a ripple gives its place. A difference of two ripples keeps the order of the
    // newer one.
    if (!parameters[i].is_place) value += sign * own;
    if (parameters[i].is_place && value == 0) value = own;
    for (std::size_t k = 0; k < places.size(); ++k)
      between.covariance(places[i], places[k]) +=
          parts.covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k));
  }
}

/// An arm whose errors are the difference between the two models.
CalibrationResult between(const ArmOfNow& before, const ArmOfNow& now) {
  CalibrationResult result;
  result.model = now.physics;
  for (const ErrorSourcePtr& source : before.physics.sources)
    if (!has(result.model, source->name())) add_source(result.model, source);
  const Eigen::Index count = result.model.parameter_count();
  result.model.values = Eigen::VectorXd::Zero(count);
  result.covariance = Eigen::MatrixXd::Zero(count, count);
  add(now, 1, result);
  add(before, -1, result);
  const std::vector<Parameter> parameters = result.model.parameters();
  for (Eigen::Index k = 0; k < count; ++k)
    result.parameters.push_back({parameters[static_cast<std::size_t>(k)], result.model.values(k),
                                 std::sqrt(std::max(result.covariance(k, k), 0.0)), true});
  return result;
}

/// The values of `physics` among the parameters of `all`; 0 where it has none.
Eigen::VectorXd values_in(const PhysicalModel& all, const PhysicalModel& physics) {
  Eigen::VectorXd values = Eigen::VectorXd::Zero(all.parameter_count());
  const std::vector<Eigen::Index> places = places_in(all, physics);
  for (std::size_t i = 0; i < places.size(); ++i)
    values(places[i]) = physics.values(static_cast<Eigen::Index>(i));
  return values;
}

std::vector<ParameterDifference> parameters_of(const CalibrationResult& found,
                                               const PhysicalModel& before,
                                               const PhysicalModel& now) {
  const Eigen::VectorXd old_values = values_in(found.model, before),
                        new_values = values_in(found.model, now);
  std::vector<ParameterDifference> all;
  for (std::size_t k = 0; k < found.parameters.size(); ++k) {
    const auto place = static_cast<Eigen::Index>(k);
    const Parameter& parameter = found.parameters[k].parameter;
    all.push_back({parameter.name, parameter.unit, parameter.scale * old_values(place),
                   parameter.scale * new_values(place),
                   2 * parameter.scale * found.parameters[k].stddev});
  }
  return all;
}

/// kg, of the payload `id`: the cell's value plus the identified correction.
BudgetNumber mass_of(const ModelParts& parts, const std::string& id) {
  BudgetNumber mass{"mass", 0, 0, "kg"};
  const auto payload = parts.physics.cell->payloads.find(id);
  if (payload != parts.physics.cell->payloads.end()) mass.value = payload->second.mass;
  for (const IdentifiedParameter& one : parts.parameters) {
    if (one.parameter.name != "mass" && one.parameter.name != "mass[" + id + "]") continue;
    mass.value += one.value;
    mass.u95 = 2 * one.stddev;
  }
  return mass;
}

/// Adds the part of the difference that comes from another load on the arm.
void add_load(const ModelParts& before, const ModelParts& now, PredictedDifference& predicted) {
  const PhysicalModel as_before = with_load_of(now.physics, before.physics);
  Eigen::Matrix3Xd load(3, std::ssize(predicted.poses));
  for (Eigen::Index i = 0; i < load.cols(); ++i) {
    const PoseContext& pose = predicted.poses[static_cast<std::size_t>(i)];
    load.col(i) = now.physics.pose_W(pose).translation() - as_before.pose_W(pose).translation();
  }
  if (load.isZero(0)) return;
  predicted.load = std::move(load);
  const std::string& id = predicted.poses.front().payload;
  const BudgetNumber old_mass = mass_of(before, id), new_mass = mass_of(now, id);
  predicted.load_change = BudgetNumber{"mass", new_mass.value - old_mass.value,
                                       std::hypot(old_mass.u95, new_mass.u95), "kg"};
}

}  // namespace

ModelDifference difference_between(const CompensatedModel& before, const CompensatedModel& now,
                                   const std::vector<PoseContext>& at) {
  std::vector<PoseContext> poses = at;
  for (PoseContext& pose : poses)
    pose.served = true;  // changes that began at a training pose have
                         // happened
  const ArmOfNow old_arm = arm_of_now(before.parts()), new_arm = arm_of_now(now.parts());
  const CalibrationResult found = between(old_arm, new_arm);
  ModelDifference difference;
  difference.parameters = parameters_of(found, old_arm.physics, new_arm.physics);
  const std::vector<ErrorPrediction> old_poses = before.predict_all(poses),
                                     new_poses = now.predict_all(poses);
  PredictedDifference predicted{poses,
                                Eigen::Matrix3Xd(3, std::ssize(poses)),
                                Eigen::Matrix3Xd(3, std::ssize(poses)),
                                {},
                                {}};
  const Pose X_BW_old = before.parts().physics.X_WB.inverse(),
             X_BW_new = now.parts().physics.X_WB.inverse();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Vector3 moved_B =
        new_poses[i].X_BT_predicted.translation() - old_poses[i].X_BT_predicted.translation();
    const Vector3 by_physics = (X_BW_new * now.parts().physics.pose_W(poses[i])).translation() -
                               (X_BW_old * before.parts().physics.pose_W(poses[i])).translation();
    difference.moved_B.push_back(moved_B);
    const auto column = static_cast<Eigen::Index>(i);
    predicted.all.col(column) = found.model.X_WB.linear() * moved_B;
    predicted.learned.col(column) = found.model.X_WB.linear() * (moved_B - by_physics);
  }
  add_load(before.parts(), now.parts(), predicted);
  difference.budget = error_budget(found, predicted);
  return difference;
}

}  // namespace trammel
