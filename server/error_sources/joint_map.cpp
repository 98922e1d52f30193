#include <cmath>

#include "server/error_sources/joint_error.h"
#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

constexpr int kDefaultHarmonics = 48;
constexpr int kMaxHarmonics = 500;
constexpr double kAmplitude = 3e-4;  // rad, prior of the first harmonic
constexpr double kKnee = 6;          // harmonic at which the prior begins to fall

/// An error of one joint's angle that depends on that angle alone: a Fourier series with period one turn. The prior
/// falls with the square of the harmonic beyond the knee, as a twice-smooth random function's does; the constant is the
/// joint's zero.
class JointMap final : public JointError {
 public:
  JointMap(const SourceSpec& spec, int harmonics) : JointError(spec.text, spec.joint, series(spec.joint, harmonics)) {}
  const CauseRecord& cause() const override { return causes::joint_map(); }
  std::string explanation() const override {
    return fmt::format("joint {} is off by a function of its own angle", joint() + 1);
  }

 private:
  static std::vector<Parameter> series(int joint, int harmonics) {
    std::vector<Parameter> all;
    for (int h = 1; h <= harmonics; ++h) {
      const double prior = kAmplitude / (1 + std::pow(h / kKnee, 2));
      all.push_back(angle_parameter(fmt::format("map{}_sin{}", joint + 1, h), prior));
      all.push_back(angle_parameter(fmt::format("map{}_cos{}", joint + 1, h), prior));
    }
    return all;
  }

  std::vector<Term> terms(const PoseContext& context) const override {
    const double q = context.q(joint());
    const int harmonics = static_cast<int>(parameters().size()) / 2;
    std::vector<Term> all;
    all.reserve(parameters().size());
    for (int h = 1; h <= harmonics; ++h) {
      all.push_back({joint(), 2 * h - 2, std::sin(h * q)});
      all.push_back({joint(), 2 * h - 1, std::cos(h * q)});
    }
    return all;
  }
};

Result<ErrorSourcePtr> make(const SourceSpec& spec, const Cell& cell) {
  if (cell.robot.joint(spec.joint).type != JointType::kRevolute) {
    return refused("error source '{}': joint {} does not turn", spec.text, spec.joint + 1);
  }
  const double harmonics = spec.at.empty() ? kDefaultHarmonics : spec.at[0];
  if (spec.at.size() > 1 || harmonics != std::floor(harmonics) || harmonics > kMaxHarmonics) {
    return failure(ErrorCode::kUsage, "error source '{}': expected @harmonics, a whole number up to {}", spec.text,
                   kMaxHarmonics);
  }
  return std::make_shared<JointMap>(spec, static_cast<int>(harmonics));
}

}  // namespace

const CauseRecord& causes::joint_map() {
  static const CauseRecord record = {
      .spelling = "joint_map",
      .plain_name = "angle error map",
      .plain_name_of_joint = "angle error map in joint {}",
      .scope = Scope::kJoint,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kMap,
      .acts = {ActsOn::kJoints, 2},
      .forms = {{"joint_map", make}},
      .rivals = {{.cause = "gear_transmission", .likeness = Likeness::kDoubtfulCase},
                 {.cause = "encoder_eccentricity", .likeness = Likeness::kSimplerCase},
                 {.cause = "geometry", .likeness = Likeness::kSpecialCase, .parameter = "q{}"}},
      .told_apart_by = remedies::kWiderRange,
      .shown_by = "more poses over this joint's range",
      .action = "compensate it; measure again after service of this joint",
      .figures = {{"peak_to_peak", "urad", "how far apart the joint is off at the two poses that differ most"}},
      .summary = Summary::kPeakToPeak,
      .takes_numbers = true,
      .of_turning_joint = true,
  };
  return record;
}

}  // namespace trammel
