#include <cmath>

#include "server/error_sources/error_source.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

constexpr double kHalfWidth = 1e-4;  // rad, prior
constexpr double kWay = 0.02;        // rad: of friction before it slips
constexpr double kWaySpread = 0.01;
constexpr double kShortestWay = 1e-3;

/// Friction in a gear holds the joint back, by an amount that depends on the move to the pose:
/// delta q = -h m / sqrt(m^2 + w^2), m = q - q_before. For long moves this tends to `backlash`, a
/// step that depends on the direction alone; moves shorter than w cause less. The joint remembers
/// only the pose before. h is not negative: friction never takes a joint farther than commanded.
/// Where the pose before is unknown, the effect is set to 0, its mean over both directions.
class Hysteresis final : public ErrorSource {
 public:
  explicit Hysteresis(const SourceSpec& spec)
      : name_(spec.text),
        joint_(spec.joint),
        parameters_({{fmt::format("hyst{}", spec.joint + 1), "rad", 1, 0, kHalfWidth, 0.0},
                     {fmt::format("way{}", spec.joint + 1), "rad", 1, kWay, kWaySpread,
                      kShortestWay, true}}) {}
  const CauseRecord& cause() const override { return causes::hysteresis(); }
  std::string name() const override { return name_; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  int joint() const override { return joint_; }
  std::string explanation() const override {
    return fmt::format("friction holds joint {} back towards where it came from", joint_ + 1);
  }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
    if (!context.before) return;
    const double moved = context.q(joint_) - (*context.before)(joint_);
    const double length = std::hypot(moved, values(1));
    if (!(length > 0)) return;
    const double share = -moved / length;
    state.add_to_joint(joint_, values(0) * share);
    if (jacobian == nullptr) return;
    jacobian->add_to_joint(joint_, first_column, share);
    jacobian->add_to_joint(joint_, first_column + 1,
                           -values(0) * share * values(1) / (length * length));
  }

 private:
  std::string name_;
  int joint_;
  std::vector<Parameter> parameters_;
};

Result<ErrorSourcePtr> make(const SourceSpec& spec, const Cell& cell) {
  if (cell.robot.joint(spec.joint).type != JointType::kRevolute)
    return refused("error source '{}': joint {} does not turn", spec.text, spec.joint + 1);
  return std::make_shared<Hysteresis>(spec);
}

}  // namespace

const CauseRecord& causes::hysteresis() {
  static const CauseRecord record = {
      .spelling = "hysteresis",
      .plain_name = "hysteresis",
      .plain_name_of_joint = "hysteresis of joint {}",
      .scope = Scope::kJoint,
      .lasting = Lasting::kAlways,
      .needs = {.before = true},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kJoints, 13},
      .forms = {{"hysteresis", make}},
      .rivals = {{.cause = "backlash", .likeness = Likeness::kSimplerCase},
                 {.cause = "early_reading"}},
      .told_apart_by = remedies::kBothSides,
      .shown_by =
          "poses in the order in which they were measured, with their times, after long and short "
          "moves",
      .action = "approach every target by a long move from one side of this joint",
      .figures = {{"hyst", "rad", "half of what lies between both sides after long moves"},
                  {"way", "rad", "how long a move must be to show most of it"}},
      .of_turning_joint = true,
  };
  return record;
}

}  // namespace trammel
