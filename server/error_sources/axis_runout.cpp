#include <cmath>
#include <vector>

#include "server/error_sources/axis_motion.h"
#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

constexpr double kLessExpected = 8;  // nat, while the arm's geometry is not in the model
constexpr int kHarmonics = 3;
constexpr double kRadial = 0.02;  // mm, prior of a first harmonic: bearings of gearboxes
constexpr double kAxial = 0.01;   // mm
constexpr double kTilt = 5e-5;    // rad

/// An axis that wobbles in its bearing. The joint's angle shifts everything beyond joint J across
/// (radial) and along (axial) the axis, and tilts it, as seen from the link before. Shift and tilt
/// across the axis are complex numbers x + iy in the frame of the link before, each a sum of c_m
/// exp(i m q). The terms m = 0 (a shift of the link before) and m = 1 (a shift of the link that
/// follows) are geometry. The harmonics 1 to 3 therefore keep m = -1, 2, -2, 3 and -3, and the
/// axial shift without its constant. None of these is an error of the joint's angle.
class AxisWobble final : public ErrorSource {
 public:
  explicit AxisWobble(const SourceSpec& spec) : name_(spec.text), joint_(spec.joint) {
    for (int h = 1; h <= kHarmonics; ++h) {
      for (const int order : {h, -h}) {
        if (order == 1) continue;
        orders_.push_back(order);
        const std::string which = fmt::format("{}_{}", joint_ + 1, order);
        for (const char* axis : {"x", "y"})
          parameters_.push_back(
              length_parameter(fmt::format("radial_{}{}", axis, which), kRadial / h));
        for (const char* axis : {"x", "y"})
          parameters_.push_back(angle_parameter(fmt::format("tilt_{}{}", axis, which), kTilt / h));
      }
    }
    for (int h = 1; h <= kHarmonics; ++h) {
      for (const char* wave : {"sin", "cos"})
        parameters_.push_back(
            length_parameter(fmt::format("axial_{}{}_{}", wave, joint_ + 1, h), kAxial / h));
    }
  }
  const CauseRecord& cause() const override { return causes::axis_runout(); }
  std::string name() const override { return name_; }
  int joint() const override { return joint_; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  std::string explanation() const override {
    return fmt::format("axis {} runs out and tilts in its bearing as the joint turns", joint_ + 1);
  }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
    const double q = state.chain->drive().row(joint_) * context.q;
    move_axis(joint_, rates_at(q), values, state, jacobian, first_column);
  }

 private:
  AxisMotion rates_at(double q) const {
    AxisMotion rates = AxisMotion::Zero(5, static_cast<Eigen::Index>(parameters_.size()));
    Eigen::Index column = 0;
    for (const int order : orders_) {
      Eigen::Matrix2d wave;  // x and y of c exp(i m q) for c = 1 and c = i
      wave << std::cos(order * q), -std::sin(order * q), std::sin(order * q), std::cos(order * q);
      rates.block<2, 2>(0, column) = wave;
      rates.block<2, 2>(3, column + 2) = wave;
      column += 4;
    }
    for (int h = 1; h <= kHarmonics; ++h, column += 2)
      rates.block<1, 2>(2, column) << std::sin(h * q), std::cos(h * q);
    return rates;
  }

  std::string name_;
  int joint_;
  std::vector<int> orders_;  ///< m
  std::vector<Parameter> parameters_;
};

Result<ErrorSourcePtr> make(const SourceSpec& spec, const Cell& cell) {
  if (cell.robot.joint(spec.joint).type != JointType::kRevolute)
    return refused("error source '{}': joint {} does not turn", spec.text, spec.joint + 1);
  return std::make_shared<AxisWobble>(spec);
}

}  // namespace

const CauseRecord& causes::axis_runout() {
  static const CauseRecord record = {
      .spelling = "axis_runout",
      .plain_name = "run-out and tilt of an axis",
      .plain_name_of_joint = "run-out and tilt of axis {}",
      .scope = Scope::kJoint,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kJoints, 9},
      .forms = {{"axis_runout", make}},
      .rivals = {{.cause = "joint_map"},
                 {.cause = "encoder_eccentricity"},
                 {.cause = "geometry", .surprise = kLessExpected}},
      .told_apart_by = remedies::kWiderRange,
      .shown_by =
          "poses all around this axis at different postures of the joints beyond it; of the last "
          "axis orientations, or two tools",
      .action = "have the bearing of this axis looked at, or compensate it",
      .figures = {{"radial_x", "mm",
                   "shift across the axis that goes around so many times a turn, its part along x"},
                  {"radial_y", "mm", "its part along y"},
                  {"tilt_x", "rad",
                   "tilt of the axis that goes around so many times a turn, its part about x"},
                  {"tilt_y", "rad", "its part about y"},
                  {"axial_sin", "mm",
                   "shift along the axis by the sine of a multiple of the joint's angle"},
                  {"axial_cos", "mm", "by its cosine"}},
      .of_turning_joint = true,
  };
  return record;
}

}  // namespace trammel
