#include <cmath>

#include "server/error_sources/joint_error.h"
#include "server/error_sources/other_joint.h"
#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

constexpr double kLessExpected = 8;  // nat, while the arm's geometry is not in the model
constexpr int kHarmonics = 4;
constexpr double kRatio =
    1e-3;  // rad/rad, prior: teeth and bars are exact, friction between joints is not
constexpr double kAmplitude =
    2e-4;  // rad, prior of a first harmonic: a tenth of a mm on a bar of half a metre

/// The error of a joint that depends on another joint's angle u: delta q = k u + f(u) + g(q + u) +
/// h(q - u), where f, g and h are short Fourier series. A belt or a shaft that runs around the
/// other's axis makes k and f. A motor in front of the other joint makes g, and a parallelogram
/// with wrong bar lengths makes h. Depending on how the controller counts the angles, g and h swap.
/// Terms of q alone belong to an angle error map, and the constant is the joint's zero.
class JointCoupling final : public JointError {
 public:
  JointCoupling(const SourceSpec& spec, int other)
      : JointError(spec.text, spec.joint, series(fmt::format("{}.{}", spec.joint + 1, other + 1))),
        other_(other) {}
  const CauseRecord& cause() const override { return causes::joint_coupling(); }
  std::string explanation() const override {
    return fmt::format("joint {} is driven past joint {} and follows it a little", joint() + 1,
                       other_ + 1);
  }

 private:
  static std::vector<Parameter> series(const std::string& joints) {
    std::vector<Parameter> all = {{"couple_rate" + joints, "rad/rad", 1, 0, kRatio}};
    for (const char* argument : {"couple", "sum", "difference"}) {
      for (int h = 1; h <= kHarmonics; ++h) {
        for (const char* wave : {"sin", "cos"})
          all.push_back(angle_parameter(fmt::format("{}_{}{}_{}", argument, wave, joints, h),
                                        kAmplitude / h));
      }
    }
    return all;
  }

  std::vector<Term> terms(const PoseContext& context) const override {
    const double own = context.q(joint());
    const double other = context.q(other_);
    std::vector<Term> all = {{joint(), 0, other}};
    for (const double argument : {other, own + other, own - other}) {
      for (int h = 1; h <= kHarmonics; ++h) {
        const int column = static_cast<int>(all.size());
        all.push_back({joint(), column, std::sin(h * argument)});
        all.push_back({joint(), column + 1, std::cos(h * argument)});
      }
    }
    return all;
  }

  int other_;
};

Result<ErrorSourcePtr> make(const SourceSpec& spec, const Cell& cell) {
  return other_joint(spec, cell.robot).map([&](int other) -> ErrorSourcePtr {
    return std::make_shared<JointCoupling>(spec, other);
  });
}

}  // namespace

const CauseRecord& causes::joint_coupling() {
  static const CauseRecord record = {
      .spelling = "joint_coupling",
      .plain_name = "coupling of two joints",
      .plain_name_of_joint = "coupling of joint {} to another",
      .scope = Scope::kJoint,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kJoints, 6},
      .forms = {{"joint_coupling", make}},
      .rivals = {{.cause = "geometry", .surprise = kLessExpected},
                 {.cause = "joint_map"},
                 {.cause = "compliance"},
                 {.cause = "self_weight"},
                 {.cause = "cable_pull"}},
      .told_apart_by = remedies::kOtherLoad,
      .shown_by = "poses over the range of both joints, at all angles between them",
      .action = "compensate it; have belt or parallelogram adjusted where it grows",
      .figures = {{"couple_rate", "rad/rad", "how much the joint follows the other one"},
                  {"couple_sin", "rad", "by the sine of a multiple of the other's angle"},
                  {"couple_cos", "rad", "by its cosine"},
                  {"sum_sin", "rad", "by the sine of a multiple of the sum of both angles"},
                  {"sum_cos", "rad", "by its cosine"},
                  {"difference_sin", "rad",
                   "by the sine of a multiple of the joint's angle less the other's"},
                  {"difference_cos", "rad", "by its cosine"}},
      .takes_numbers = true,
      .of_turning_joint = true,
  };
  return record;
}

}  // namespace trammel
