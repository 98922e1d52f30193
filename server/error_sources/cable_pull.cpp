#include <algorithm>
#include <array>
#include <cmath>

#include "server/base/units.h"
#include "server/error_sources/other_joint.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

constexpr int kDegrees = 5;
constexpr double kTorquePerArea = 2;  // Nm/m^2: of a hose package, over the square of the reach

/// Angles between which something lies, rad.
struct Range {
  double lower = 0, upper = 0;
};

/// A cable or hose package that two joints wind up together, such as joints 4 and 6 of a wrist. It
/// pulls by the sum s of their angles, so its energy is U(s), and both joints feel the torque
/// -U'(s). Their gearboxes deflect under it. The torque is a Chebyshev polynomial of s over the
/// range that the joints' limits allow, and constant beyond it. Its constant part is the zeros of
/// the two joints.
class CablePull final : public ErrorSource {
 public:
  CablePull(const SourceSpec& spec, int other, const Chain& chain)
      : name_(spec.text), joint_(spec.joint), other_(other) {
    sum_ = chain.drive().row(joint_) + chain.drive().row(other_);
    pulled_ = chain.bars().row(joint_) + chain.bars().row(other_);
    range_ = range_of(chain);
    double reach = 0;
    for (int i = 0; i < chain.size(); ++i)
      reach += std::hypot(chain.joint(i).link.d, chain.joint(i).link.a);
    for (int k = 1; k <= kDegrees; ++k) {
      parameters_.push_back({fmt::format("pull{}.{}_{}", joint_ + 1, other_ + 1, k), "Nm", 1, 0,
                             kTorquePerArea * reach * reach / (k * k)});
    }
  }
  const CauseRecord& cause() const override { return causes::cable_pull(); }
  std::string name() const override { return name_; }
  int joint() const override { return joint_; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override {
    return fmt::format("cables that joints {} and {} wind up together pull at both", joint_ + 1,
                       other_ + 1);
  }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
    if (state.spring_torque.size() == 0)
      state.spring_torque = JointArray::Zero(state.chain->size());
    const std::array<double, kDegrees> polynomials = polynomials_at(sum_.dot(context.q));
    for (int k = 0; k < kDegrees; ++k) {
      for (int joint = 0; joint < state.chain->size(); ++joint) {
        const double rate = pulled_(joint) * polynomials[static_cast<std::size_t>(k)];
        if (rate == 0) continue;
        state.spring_torque(joint) += rate * values(k);
        if (jacobian != nullptr)
          jacobian->add(jacobian->rows.spring(joint), first_column + k, rate);
      }
    }
  }

 private:
  Range range_of(const Chain& chain) const {
    Range sum;
    for (int k = 0; k < chain.size(); ++k) {
      const Joint& joint = chain.joint(k);
      const double rate = chain.transmission()(joint_, k) + chain.transmission()(other_, k);
      if (rate == 0) continue;
      const double ends[] = {rate * (std::isfinite(joint.lower) ? joint.lower : -kPi),
                             rate * (std::isfinite(joint.upper) ? joint.upper : kPi)};
      sum.lower += std::min(ends[0], ends[1]);
      sum.upper += std::max(ends[0], ends[1]);
    }
    return sum;
  }

  /// T1(u), T2(u), ... with u from -1 to 1 over the range.
  std::array<double, kDegrees> polynomials_at(double sum) const {
    const double half = (range_.upper - range_.lower) / 2;
    const double u = half > 0 ? std::clamp((sum - range_.lower) / half - 1, -1.0, 1.0) : 0;
    std::array<double, kDegrees> all{};
    for (int k = 0; k < kDegrees; ++k)
      all[static_cast<std::size_t>(k)] = std::cos((k + 1) * std::acos(u));
    return all;
  }

  std::string name_;
  int joint_;
  int other_;
  Eigen::RowVectorXd sum_;     ///< of both axes, by the angle of each gear
  Eigen::RowVectorXd pulled_;  ///< the share of the torque about both axes that loads each gear
  Range range_;
  std::vector<Parameter> parameters_;
};

Result<ErrorSourcePtr> make(const SourceSpec& spec, const Cell& cell) {
  return other_joint(spec, cell.robot).map([&](int other) -> ErrorSourcePtr {
    return std::make_shared<CablePull>(spec, other, cell.robot);
  });
}

}  // namespace

const CauseRecord& causes::cable_pull() {
  static const CauseRecord record = {
      .spelling = "cable_pull",
      .plain_name = "pull of cables",
      .plain_name_of_joint = "pull of cables at joint {} and another",
      .scope = Scope::kJoint,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kNone,
      .acts = {ActsOn::kJoints, 11},
      .forms = {{"cable_pull", make}},
      .rivals = {{.cause = "joint_coupling"},
                 {.cause = "balancer"},
                 {.cause = "joint_map"},
                 {.cause = "compliance"}},
      .told_apart_by = remedies::kWiderRange,
      .shown_by =
          "poses over the range of both joints, and gearbox compliance among the error sources",
      .action =
          "give the cables more slack, or compensate their pull; identify again when they are laid "
          "anew",
      .figures = {{"pull", "Nm", "torque with a polynomial of the sum of both angles"}},
      .takes_numbers = true,
      .of_turning_joint = true,
  };
  return record;
}

}  // namespace trammel
