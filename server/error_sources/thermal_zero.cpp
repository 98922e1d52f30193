#include "server/error_sources/shipped_causes.h"
#include "server/error_sources/warming.h"

namespace trammel {

namespace {

constexpr double kRate = 1e-5;  // rad/K, prior

/// The zero of a joint depends on the temperature of its gearbox, which follows the recorded
/// temperature with a lag: delta q = z (T_lag - 20). Without a history of the temperature the
/// gearbox is as warm as the thermometer.
class ThermalZero final : public ErrorSource {
 public:
  explicit ThermalZero(const SourceSpec& spec)
      : name_(spec.text),
        joint_(spec.joint),
        parameters_({{fmt::format("zero_rate{}", spec.joint + 1), "urad/K", 1e6, 0, kRate},
                     heat_lag_parameter(fmt::format("heat_lag{}", spec.joint + 1))}) {}
  const CauseRecord& cause() const override { return causes::thermal_zero(); }
  std::string name() const override { return name_; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  int joint() const override { return joint_; }
  std::string explanation() const override {
    return fmt::format("the zero of joint {} goes with the temperature of its gearbox", joint_ + 1);
  }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
    const std::optional<Warming> felt = warming_at(context, values(1));
    if (!felt) return;
    state.add_to_joint(joint_, values(0) * felt->kelvin);
    if (jacobian == nullptr) return;
    jacobian->add_to_joint(joint_, first_column, felt->kelvin);
    jacobian->add_to_joint(joint_, first_column + 1, values(0) * felt->by_lag);
  }

 private:
  std::string name_;
  int joint_;
  std::vector<Parameter> parameters_;
};

Result<ErrorSourcePtr> make(const SourceSpec& spec, const Cell& cell) {
  if (cell.robot.joint(spec.joint).type != JointType::kRevolute)
    return refused("error source '{}': joint {} does not turn", spec.text, spec.joint + 1);
  return std::make_shared<ThermalZero>(spec);
}

}  // namespace

const CauseRecord& causes::thermal_zero() {
  static const CauseRecord record = {
      .spelling = "thermal_zero",
      .plain_name = "joint zero with temperature",
      .plain_name_of_joint = "zero of joint {} with temperature",
      .scope = Scope::kJoint,
      .lasting = Lasting::kAlways,
      .needs = {.temperature = true, .history = true},
      .search = SearchFamily::kNone,
      .acts = {ActsOn::kJoints, 14},
      .forms = {{"thermal_zero", make}},
      .rivals = {{.cause = "geometry", .parameter = "q{}"},
                 {.cause = "thermal_growth"},
                 {.cause = "tracker_drift"},
                 {.cause = "joint_slip"}},
      .told_apart_by = remedies::kOtherTemperature,
      .shown_by = "temperature and time of every pose, over a warm-up and a cooling",
      .action = "warm the robot up before work, or record its temperature with every job",
      .figures = {{"zero_rate", "urad/K", "how far the zero goes with each degree"},
                  {"heat_lag", "min",
                   "how long the gearbox takes to follow the recorded temperature"}},
      .of_turning_joint = true,
  };
  return record;
}

}  // namespace trammel
