#include <cmath>

#include "server/error_sources/joint_error.h"
#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

/// The encoder's disc turns about a point beside its centre: the joint is off by a sine and a
/// cosine of its own angle, one cycle a turn.
class EncoderEccentricity final : public JointError {
 public:
  explicit EncoderEccentricity(const SourceSpec& spec)
      : JointError(spec.text, spec.joint,
                   {angle_parameter(fmt::format("ecc_sin{}", spec.joint + 1), 5e-4),
                    angle_parameter(fmt::format("ecc_cos{}", spec.joint + 1), 5e-4)}) {}
  const CauseRecord& cause() const override { return causes::encoder_eccentricity(); }
  std::string explanation() const override {
    return fmt::format("the encoder disc of joint {} turns off centre", joint() + 1);
  }

 private:
  std::vector<Term> terms(const PoseContext& context) const override {
    const double q = context.q(joint());
    return {{joint(), 0, std::sin(q)}, {joint(), 1, std::cos(q)}};
  }
};

Result<ErrorSourcePtr> make(const SourceSpec& spec, const Cell&) {
  return std::make_shared<EncoderEccentricity>(spec);
}

}  // namespace

const CauseRecord& causes::encoder_eccentricity() {
  static const CauseRecord record = {
      .spelling = "encoder_eccentricity",
      .plain_name = "off-centre encoder",
      .plain_name_of_joint = "off-centre encoder in joint {}",
      .scope = Scope::kJoint,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kJoints, 1},
      .forms = {{"encoder_eccentricity", make}},
      .rivals = {{.cause = "joint_map"}, {.cause = "compliance"}, {.cause = "tool"}},
      .told_apart_by = remedies::kWiderRange,
      .shown_by = "the full range of this joint, a second payload",
      .action = "compensate it; it is fixed in the joint until its encoder is replaced",
      .figures = {{"amplitude", "urad", "half of what the joint is off from one end to the other"},
                  {"ecc_sin", "rad", "its sine"},
                  {"ecc_cos", "rad", "its cosine"}},
      .summary = Summary::kAmplitude,
      .of_turning_joint = true,
      .order = 1,
      .example = Example{2, 1},
  };
  return record;
}

}  // namespace trammel
