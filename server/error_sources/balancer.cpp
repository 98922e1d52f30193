#include <cmath>

#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

constexpr int kHarmonics = 6;
constexpr double kTorquePerLength =
    100;  // Nm/m^4: of a balancer's first harmonic, over the fourth power of the reach

/// A spring, a gas spring or a counterweight that holds a joint. Its torque is a function of the
/// joint's angle alone, written as a Fourier series. The torque shows through the joint's
/// compliance. Its constant part is the joint's zero. Its first harmonic equals a link's weight as
/// long as the joint's axis stays level.
class Balancer final : public ErrorSource {
 public:
  Balancer(const SourceSpec& spec, const Chain& chain) : name_(spec.text), joint_(spec.joint) {
    double reach = 0;
    for (int i = 0; i < chain.size(); ++i)
      reach += std::hypot(chain.joint(i).link.d, chain.joint(i).link.a);
    for (int h = 1; h <= kHarmonics; ++h) {
      const double prior = kTorquePerLength * std::pow(reach, 4) / (h * h);
      parameters_.push_back({fmt::format("balance_sin{}.{}", joint_ + 1, h), "Nm", 1, 0, prior});
      parameters_.push_back({fmt::format("balance_cos{}.{}", joint_ + 1, h), "Nm", 1, 0, prior});
    }
  }
  const CauseRecord& cause() const override { return causes::balancer(); }
  std::string name() const override { return name_; }
  int joint() const override { return joint_; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override {
    return fmt::format("a spring or counterweight loads joint {}, by the joint's angle",
                       joint_ + 1);
  }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
    if (state.spring_torque.size() == 0)
      state.spring_torque = JointArray::Zero(state.chain->size());
    for (int h = 1; h <= kHarmonics; ++h) {
      const double rate[] = {std::sin(h * context.q(joint_)), std::cos(h * context.q(joint_))};
      for (int k = 0; k < 2; ++k) {
        const int column = 2 * h - 2 + k;
        state.spring_torque(joint_) += rate[k] * values(column);
        if (jacobian != nullptr)
          jacobian->add(jacobian->rows.spring(joint_), first_column + column, rate[k]);
      }
    }
  }

 private:
  std::string name_;
  int joint_;
  std::vector<Parameter> parameters_;
};

Result<ErrorSourcePtr> make(const SourceSpec& spec, const Cell& cell) {
  if (cell.robot.joint(spec.joint).type != JointType::kRevolute)
    return refused("error source '{}': joint {} does not turn", spec.text, spec.joint + 1);
  return std::make_shared<Balancer>(spec, cell.robot);
}

}  // namespace

const CauseRecord& causes::balancer() {
  static const CauseRecord record = {
      .spelling = "balancer",
      .plain_name = "balancer",
      .plain_name_of_joint = "balancer of joint {}",
      .scope = Scope::kJoint,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kNone,
      .acts = {ActsOn::kLoad, 3},
      .forms = {{"balancer", make}},
      .rivals = {{.cause = "joint_map"},
                 {.cause = "encoder_eccentricity"},
                 {.cause = "self_weight"}},
      .told_apart_by = remedies::kWiderRange,
      .shown_by = "more poses over this joint's range",
      .action = "have the balancer's pressure or spring checked, or compensate it",
      .figures = {{"balance_sin", "Nm", "torque with the sine of a multiple of the joint's angle"},
                  {"balance_cos", "Nm", "with its cosine"}},
      .of_turning_joint = true,
  };
  return record;
}

}  // namespace trammel
