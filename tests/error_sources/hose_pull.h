#pragma once

#include <cmath>

#include "server/error_sources/joint_error.h"
#include "server/error_sources/parameter.h"

/// A cause that does not ship, in one file as the README's recipe says: the dress pack. Its hoses
/// pull at a joint as the joint before it turns, three times a turn.
namespace trammel::causes {

const CauseRecord& hose_pull();

}  // namespace trammel::causes

namespace trammel {

class HosePull final : public JointError {
 public:
  explicit HosePull(const SourceSpec& spec)
      : JointError(spec.text, spec.joint,
                   {angle_parameter(fmt::format("pull_sin{}", spec.joint + 1), 3e-4),
                    angle_parameter(fmt::format("pull_cos{}", spec.joint + 1), 3e-4)}) {}
  const CauseRecord& cause() const override { return causes::hose_pull(); }
  std::string explanation() const override {
    return fmt::format("the hoses pull at joint {}", joint() + 1);
  }

 private:
  std::vector<Term> terms(const PoseContext& context) const override {
    const double q = context.q(joint() - 1);
    return {{joint(), 0, std::sin(3 * q)}, {joint(), 1, std::cos(3 * q)}};
  }
};

inline Result<ErrorSourcePtr> make_hose_pull(const SourceSpec& spec, const Cell&) {
  if (spec.joint == 0)
    return refused("error source '{}': no joint comes before joint 1", spec.text);
  return std::make_shared<HosePull>(spec);
}

inline const CauseRecord& causes::hose_pull() {
  static const CauseRecord record = {
      .spelling = "hose_pull",
      .plain_name = "hose pull",
      .plain_name_of_joint = "hose pull in joint {}",
      .scope = Scope::kJoint,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kJoints, 6},
      .forms = {{"hose_pull", make_hose_pull}},
      .rivals = {{.cause = "joint_map"}, {.cause = "compliance"}},
      .told_apart_by = {15, "a run without the dress pack"},
      .shown_by = "a wider range of the joint before this one",
      .action = "give the hoses more slack, or compensate them",
      .figures = {{"pull_sin", "rad", "with the sine of three times the angle before"},
                  {"pull_cos", "rad", "with its cosine"}},
  };
  return record;
}

}  // namespace trammel
