#include "server/error_sources/joint_error.h"
#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

constexpr double kUsualSlip = 2e-3;  // rad

/// A joint loses its zero at a pose and keeps the new one. A second number, mrad, gives the usual
/// size.
class JointSlip final : public JointError {
 public:
  explicit JointSlip(const SourceSpec& spec)
      : JointError(spec.text, spec.joint,
                   {angle_parameter(fmt::format("slip{}@{:.0f}", spec.joint + 1, spec.at[0]),
                                    spec.at.size() > 1 ? 1e-3 * spec.at[1] : kUsualSlip)}),
        first_(static_cast<int>(spec.at[0]) - 1) {}
  const CauseRecord& cause() const override { return causes::joint_slip(); }
  std::string explanation() const override {
    return fmt::format("joint {} lost its zero at pose {}", joint() + 1, first_ + 1);
  }

 private:
  std::vector<Term> terms(const PoseContext& context) const override {
    if (!context.from(first_)) return {};
    return {{joint(), 0, 1.0}};
  }
  const int first_;
};

Result<ErrorSourcePtr> make(const SourceSpec& spec, const Cell&) {
  if (spec.at.size() > 2)
    return failure(ErrorCode::kUsage,
                   "error source '{}': a pose, and how far zeros usually slip, mrad", spec.text);
  return std::make_shared<JointSlip>(spec);
}

}  // namespace

const CauseRecord& causes::joint_slip() {
  static const CauseRecord record = {
      .spelling = "joint_slip",
      .plain_name = "lost joint zero",
      .plain_name_of_joint = "lost zero in joint {}",
      .scope = Scope::kJoint,
      .lasting = Lasting::kFromAPose,
      .needs = {},
      .search = SearchFamily::kZeroStep,
      .acts = {ActsOn::kJoints, 4},
      .forms = {{"joint_slip", make}},
      .rivals = {{.cause = "geometry", .likeness = Likeness::kFromTheFirstPose, .parameter = "q{}"},
                 {.cause = "tracker_moved"},
                 {.cause = "tool_changed"}},
      .told_apart_by = {45, remedies::kReflectors.text},
      .shown_by = remedies::kReflectors.text,
      .action =
          "check this joint's brake, coupling and calibration marks, and update its revolution "
          "counter",
      .figures = {{"slip", "rad", "how far the zero is off"}},
      .takes_numbers = true,
      .whole_batch = WholeBatch{"joint {} lost its zero", false},
  };
  return record;
}

}  // namespace trammel
