#include <cmath>

#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

/// Play in a gear: the joint lags behind its motor by half the play, and more under load: delta q =
/// -dir (b + k |tau|), where dir is the direction of approach. If all poses are approached from one
/// side, it cannot be separated from a joint zero.
class Backlash final : public ErrorSource {
 public:
  explicit Backlash(const SourceSpec& spec)
      : name_(spec.text),
        joint_(spec.joint),
        parameters_({angle_parameter(fmt::format("b{}", spec.joint + 1), 2e-4),
                     {fmt::format("bt{}", spec.joint + 1), "rad/Nmm", to_rad_per_nmm(1), 0,
                      from_rad_per_nmm(1e-10)}}) {}
  const CauseRecord& cause() const override { return causes::backlash(); }
  std::string name() const override { return name_; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  int joint() const override { return joint_; }
  std::string explanation() const override {
    return fmt::format(
        "the gear of joint {} has play: the joint depends on the side it is approached from",
        joint_ + 1);
  }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
    if (context.direction.empty()) return;
    // Approached upwards, the joint lags and stands below the angle of its motor.
    const double direction = -context.direction[static_cast<std::size_t>(joint_)];
    const ArmKinematics kinematics(state);
    const double torque = kinematics.gravity_torque()(joint_);
    if (jacobian != nullptr) {
      const double rate = direction * values(1) * std::copysign(1.0, torque);
      if (rate != 0)
        jacobian->pass_on_to_joint(joint_, rate * kinematics.gravity_torque_jacobian().row(joint_));
      jacobian->add_to_joint(joint_, first_column, direction);
      jacobian->add_to_joint(joint_, first_column + 1, direction * std::abs(torque));
    }
    state.add_to_joint(joint_, direction * (values(0) + values(1) * std::abs(torque)));
  }

 private:
  std::string name_;
  int joint_;
  std::vector<Parameter> parameters_;
};

Result<ErrorSourcePtr> make(const SourceSpec& spec, const Cell&) {
  return std::make_shared<Backlash>(spec);
}

}  // namespace

const CauseRecord& causes::backlash() {
  static const CauseRecord record = {
      .spelling = "backlash",
      .plain_name = "backlash",
      .plain_name_of_joint = "backlash in joint {}",
      .scope = Scope::kJoint,
      .lasting = Lasting::kAlways,
      .needs = {.direction = true},
      .search = SearchFamily::kPlay,
      .acts = {ActsOn::kLoadedArm, 0},
      .forms = {{"backlash", make}},
      .rivals = {{.cause = "geometry", .likeness = Likeness::kWhereConstant, .parameter = "q{}"},
                 {.cause = "compliance"}},
      .told_apart_by = remedies::kBothSides,
      .shown_by = "approaching the poses from both sides of this joint",
      .action = "approach every target from one side of this joint, or have its gear adjusted",
      .figures = {{"b", "rad", "half the play"},
                  {"bt", "rad/Nmm", "how much more of it for each unit of torque"}},
  };
  return record;
}

}  // namespace trammel
