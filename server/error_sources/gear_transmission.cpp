#include <cmath>

#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

constexpr double kAmplitudePrior = 1e-4;  // rad
constexpr double kLowestOrder = 2;        // below lie eccentricity and geometry
constexpr double kHighestOrder =
    400;  // cycles a joint turn: two waves a motor turn at a ratio of 200

/// Teeth that mesh unevenly: the joint oscillates `order` times a turn of its own, delta q = s
/// sin(order q) + c cos(order q). The order need not be whole. Several orders of one joint are
/// several triples.
class GearTransmission final : public ErrorSource {
 public:
  GearTransmission(const SourceSpec& spec, double range)
      : name_(spec.text), joint_(spec.joint), range_(range) {
    searched_ = spec.at.empty();
    const std::vector<double> orders = searched_ ? std::vector<double>{kLowestOrder} : spec.at;
    // Over this range of angles, orders can be resolved to 2 pi / range. The prior stays well
    // within that.
    const double spread = 0.25 * 2 * kPi / range_;
    for (std::size_t k = 0; k < orders.size(); ++k) {
      const std::string which =
          fmt::format("{}{}", joint_ + 1, orders.size() > 1 ? fmt::format("_{}", k + 1) : "");
      parameters_.push_back({"order" + which, "", 1, orders[k], spread, 0.0, true});
      parameters_.push_back(angle_parameter("gear_sin" + which, kAmplitudePrior));
      parameters_.push_back(angle_parameter("gear_cos" + which, kAmplitudePrior));
    }
  }

  const CauseRecord& cause() const override { return causes::gear_transmission(); }
  std::string name() const override { return name_; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  int joint() const override { return joint_; }
  std::string explanation() const override {
    return fmt::format("the gear of joint {} turns unevenly, so many times a turn", joint_ + 1);
  }
  std::optional<Search> search() const override {
    if (!searched_) return std::nullopt;
    return Search{kLowestOrder, kHighestOrder, 0.2 * 2 * kPi / range_};
  }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
    const double q = context.q(joint_);
    for (int k = 0; k < static_cast<int>(parameters_.size()); k += 3) {
      const double sine = std::sin(values(k) * q);
      const double cosine = std::cos(values(k) * q);
      state.add_to_joint(joint_, values(k + 1) * sine + values(k + 2) * cosine);
      if (jacobian == nullptr) continue;
      jacobian->add_to_joint(joint_, first_column + k,
                             q * (values(k + 1) * cosine - values(k + 2) * sine));
      jacobian->add_to_joint(joint_, first_column + k + 1, sine);
      jacobian->add_to_joint(joint_, first_column + k + 2, cosine);
    }
  }

 private:
  std::string name_;
  int joint_;
  double range_;
  bool searched_ = false;
  std::vector<Parameter> parameters_;
};

Result<ErrorSourcePtr> make(const SourceSpec& spec, const Cell& cell) {
  const Joint& joint = cell.robot.joint(spec.joint);
  if (joint.type != JointType::kRevolute)
    return refused("error source '{}': joint {} does not turn", spec.text, spec.joint + 1);
  double range = joint.upper - joint.lower;
  if (!cell.joint_ranges.empty()) {
    const auto& [lower, upper] = cell.joint_ranges[static_cast<std::size_t>(spec.joint)];
    range = upper - lower;
  }
  if (!(range > 0))
    return refused("error source '{}': joint {} does not move in this cell", spec.text,
                   spec.joint + 1);
  return std::make_shared<GearTransmission>(spec, std::min(range, 4 * kPi));
}

}  // namespace

const CauseRecord& causes::gear_transmission() {
  static const CauseRecord record = {
      .spelling = "gear_transmission",
      .plain_name = "gear ripple",
      .plain_name_of_joint = "gear ripple in joint {}",
      .scope = Scope::kJoint,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kOrder,
      .acts = {ActsOn::kJoints, 0},
      .forms = {{"gear_transmission", make}},
      .rivals = {{.cause = "joint_map"}, {.cause = "encoder_eccentricity"}},
      .told_apart_by = remedies::kWiderRange,
      .shown_by = "a wider range of this joint",
      .action = "compensate it, and have the gear of this joint looked at if it grows",
      .figures = {{"order", "", "cycles a turn of the joint"},
                  {"amplitude", "urad", "half of what the joint is off from one end to the other"},
                  {"gear_sin", "rad", "its sine"},
                  {"gear_cos", "rad", "its cosine"}},
      .summary = Summary::kOrderAndAmplitude,
      .takes_numbers = true,
      .of_turning_joint = true,
      .example = Example{1, -1},
  };
  return record;
}

}  // namespace trammel
