#include <cmath>

#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

constexpr double kPrior = 5e-11;  // rad/Nmm: a twentieth of a gearbox's compliance

/// Teeth whose stiffness changes around the gear: the gearbox deflects under the torque by tau /
/// k(q), where k(q) oscillates `order` times a turn of the joint. So delta q = tau (s sin(order q)
/// + c cos(order q)). The ripple is proportional to the torque and changes sign with it. A ripple
/// without torque is `gear_transmission`, and the mean of 1/k is the joint's compliance.
class LoadedRipple final : public ErrorSource {
 public:
  LoadedRipple(const SourceSpec& spec, double range) : name_(spec.text), joint_(spec.joint) {
    const double spread = 0.25 * 2 * kPi / range;  // as of gear ripple
    for (std::size_t k = 0; k < spec.at.size(); ++k) {
      const std::string which =
          fmt::format("{}{}", joint_ + 1, spec.at.size() > 1 ? fmt::format("_{}", k + 1) : "");
      parameters_.push_back({"order" + which, "", 1, spec.at[k], spread, 0.0, true});
      for (const char* wave : {"loaded_sin", "loaded_cos"})
        parameters_.push_back(
            {wave + which, "rad/Nmm", to_rad_per_nmm(1), 0, from_rad_per_nmm(kPrior)});
    }
  }
  const CauseRecord& cause() const override { return causes::loaded_ripple(); }
  std::string name() const override { return name_; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  int joint() const override { return joint_; }
  std::string explanation() const override {
    return fmt::format(
        "the gear of joint {} gives way unevenly, so many times a turn, the more the more it "
        "carries",
        joint_ + 1);
  }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
    const ArmKinematics kinematics(state);
    const double torque = kinematics.gravity_torque()(joint_);
    const double q = context.q(joint_);
    double by_torque = 0;
    for (int k = 0; k < static_cast<int>(parameters_.size()); k += 3) {
      const double sine = std::sin(values(k) * q);
      const double cosine = std::cos(values(k) * q);
      by_torque += values(k + 1) * sine + values(k + 2) * cosine;
    }
    if (jacobian != nullptr) {
      if (by_torque != 0)
        jacobian->pass_on_to_joint(joint_,
                                   by_torque * kinematics.gravity_torque_jacobian().row(joint_));
      add_columns(torque, q, values, *jacobian, first_column);
    }
    state.add_to_joint(joint_, torque * by_torque);
  }

 private:
  void add_columns(double torque, double q, const Eigen::Ref<const Eigen::VectorXd>& values,
                   StateJacobian& jacobian, int first_column) const {
    for (int k = 0; k < static_cast<int>(parameters_.size()); k += 3) {
      const double sine = torque * std::sin(values(k) * q);
      const double cosine = torque * std::cos(values(k) * q);
      jacobian.add_to_joint(joint_, first_column + k,
                            q * (values(k + 1) * cosine - values(k + 2) * sine));
      jacobian.add_to_joint(joint_, first_column + k + 1, sine);
      jacobian.add_to_joint(joint_, first_column + k + 2, cosine);
    }
  }

  std::string name_;
  int joint_;
  std::vector<Parameter> parameters_;
};

constexpr double kUsualOrder = 2;  // cycles a turn of the motor: a strain wave gear's

/// Without orders: two waves per turn of the motor, if the robot file has the gear's ratio.
Result<SourceSpec> with_orders(SourceSpec spec, const Joint& joint) {
  if (!spec.at.empty()) return spec;
  if (!(joint.gear_ratio > 0)) {
    return failure(ErrorCode::kUsage,
                   "error source '{}': expected {}@orders, cycles a turn of the joint", spec.text,
                   spec.text);
  }
  spec.at.push_back(kUsualOrder * joint.gear_ratio);
  return spec;
}

Result<ErrorSourcePtr> make(const SourceSpec& spec, const Cell& cell) {
  const Joint& joint = cell.robot.joint(spec.joint);
  if (joint.type != JointType::kRevolute)
    return refused("error source '{}': joint {} does not turn", spec.text, spec.joint + 1);
  const double range = std::min(joint.upper - joint.lower, 4 * kPi);
  return with_orders(spec, joint).map([&](const SourceSpec& full) -> ErrorSourcePtr {
    return std::make_shared<LoadedRipple>(full, range);
  });
}

}  // namespace

const CauseRecord& causes::loaded_ripple() {
  static const CauseRecord record = {
      .spelling = "loaded_ripple",
      .plain_name = "gear ripple under load",
      .plain_name_of_joint = "gear ripple under load in joint {}",
      .scope = Scope::kJoint,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kNone,
      .acts = {ActsOn::kLoadedArm, 0},
      .forms = {{"loaded_ripple", make}},
      .rivals = {{.cause = "gear_transmission"}, {.cause = "joint_map"}, {.cause = "compliance"}},
      .told_apart_by = remedies::kOtherLoad,
      .shown_by =
          "the same angles of this joint under different torques: other postures, a second payload "
          "or none",
      .action = "compensate it; have the gear of this joint looked at if it grows",
      .figures = {{"order", "", "cycles a turn of the joint"},
                  {"loaded_sin", "rad/Nmm", "its sine for each unit of torque"},
                  {"loaded_cos", "rad/Nmm", "its cosine"}},
      .takes_numbers = true,
      .of_turning_joint = true,
  };
  return record;
}

}  // namespace trammel
