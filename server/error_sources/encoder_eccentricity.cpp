#include <cmath>

#include "server/error_sources/joint_error.h"
#include "server/error_sources/parameter.h"
#include "server/error_sources/sources.h"

namespace trammel {

namespace {

/// The encoder's disc turns about a point beside its centre: the joint is off by a sine and a cosine of its own angle,
/// one cycle a turn.
class EncoderEccentricity final : public JointError {
 public:
  explicit EncoderEccentricity(const SourceSpec& spec)
      : JointError(spec.text, spec.joint,
                   {angle_parameter(fmt::format("ecc_sin{}", spec.joint + 1), 5e-4),
                    angle_parameter(fmt::format("ecc_cos{}", spec.joint + 1), 5e-4)}) {}
  std::string explanation() const override {
    return fmt::format("the encoder disc of joint {} turns off centre", joint() + 1);
  }

 private:
  std::vector<Term> terms(const PoseContext& context) const override {
    const double q = context.q(joint());
    return {{joint(), 0, std::sin(q)}, {joint(), 1, std::cos(q)}};
  }
};

}  // namespace

Result<ErrorSourcePtr> make_encoder_eccentricity(const SourceSpec& spec, const Cell&) {
  return std::make_shared<EncoderEccentricity>(spec);
}

}  // namespace trammel
