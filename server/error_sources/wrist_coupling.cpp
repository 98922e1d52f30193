#include "server/error_sources/joint_error.h"
#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

Parameter ratio_parameter(std::string name) { return {std::move(name), "rad/rad", 1, 0, 1e-3}; }

/// The shafts of the wrist are concentric: joint 4 drags joints 5 and 6 along in proportion, and
/// joint 5 drags joint 6.
class WristCoupling final : public JointError {
 public:
  explicit WristCoupling(const SourceSpec& spec)
      : JointError(spec.text, -1,
                   {ratio_parameter("k54"), ratio_parameter("k64"), ratio_parameter("k65")}) {}
  const CauseRecord& cause() const override { return causes::wrist_coupling(); }
  std::string explanation() const override {
    return "the wrist axes drag one another along through their gears";
  }

 private:
  std::vector<Term> terms(const PoseContext& context) const override {
    return {{4, 0, context.q(3)}, {5, 1, context.q(3)}, {5, 2, context.q(4)}};
  }
};

Result<ErrorSourcePtr> make(const SourceSpec& spec, const Cell& cell) {
  if (cell.robot.size() != 6) {
    return refused("error source '{}' is of six-axis robots, {} has {} joints", spec.text,
                   cell.robot.name(), cell.robot.size());
  }
  return std::make_shared<WristCoupling>(spec);
}

}  // namespace

const CauseRecord& causes::wrist_coupling() {
  static const CauseRecord record = {
      .spelling = "wrist_coupling",
      .plain_name = "wrist coupling",
      .plain_name_of_joint = "",
      .scope = Scope::kArm,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kJoints, 3},
      .forms = {{"wrist_coupling", make}},
      .rivals = {{.cause = "joint_map"}, {.cause = "gear_transmission"}},
      .told_apart_by = remedies::kWiderRange,
      .shown_by = "the full range of joints 4 and 5",
      .action = "set the coupling ratios of the wrist in the controller",
      .figures = {{"k54", "rad/rad", "how much joint 5 follows joint 4"},
                  {"k64", "rad/rad", "how much joint 6 follows joint 4"},
                  {"k65", "rad/rad", "how much joint 6 follows joint 5"}},
      .numbers = Numbers::kSingly,
  };
  return record;
}

}  // namespace trammel
