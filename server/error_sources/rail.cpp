#include <algorithm>
#include <array>
#include <cmath>

#include "server/error_sources/axis_motion.h"
#include "server/error_sources/joint_error.h"
#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

Status check_is_rail(const SourceSpec& spec, const Cell& cell) {
  if (cell.robot.joint(spec.joint).type == JointType::kPrismatic) return {};
  return refused("error source '{}': joint {} is no rail", spec.text, spec.joint + 1);
}

double travel_of(const Joint& joint) {
  const double travel = joint.upper - joint.lower;
  return std::isfinite(travel) ? travel : 1;
}

/// The carriage travels another distance than rack or scale says: delta q = k q. The constant is
/// the rail's zero.
class RailScale final : public JointError {
 public:
  explicit RailScale(const SourceSpec& spec)
      : JointError(spec.text, spec.joint,
                   {{fmt::format("rail_scale{}", spec.joint + 1), "um/m", 1e6, 0, 1e-4}}) {}
  const CauseRecord& cause() const override { return causes::rail_scale(); }
  std::string explanation() const override {
    return fmt::format("joint {} travels farther than it says, or less far", joint() + 1);
  }

 private:
  std::vector<Term> terms(const PoseContext& context) const override {
    return {{joint(), 0, context.q(joint())}};
  }
};

/// Teeth of rack and pinion: the carriage runs ahead and behind once a pitch, delta q = s sin(2 pi
/// q / p) + c cos(2 pi q / p). Several pitches of one rail, as of a tooth and of a turn of the
/// pinion, are several triples.
class RackPitch final : public ErrorSource {
 public:
  RackPitch(const SourceSpec& spec, double travel) : name_(spec.text), joint_(spec.joint) {
    for (std::size_t k = 0; k < spec.at.size(); ++k) {
      const std::string which =
          fmt::format("{}{}", joint_ + 1, spec.at.size() > 1 ? fmt::format("_{}", k + 1) : "");
      const double pitch = from_mm(spec.at[k]);
      const double spread =
          0.25 * pitch * pitch / travel;  // a quarter of the bend that this travel resolves
      parameters_.push_back({"pitch" + which, "mm", to_mm(1), pitch, spread, pitch / 2, true});
      for (const char* wave : {"rack_sin", "rack_cos"})
        parameters_.push_back(length_parameter(wave + which, kPriorMm));
    }
  }
  const CauseRecord& cause() const override { return causes::rack_pitch(); }
  std::string name() const override { return name_; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  int joint() const override { return joint_; }
  std::string explanation() const override {
    return fmt::format("the rack of joint {} moves the carriage unevenly, once a pitch",
                       joint_ + 1);
  }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
    for (int k = 0; k < static_cast<int>(parameters_.size()); k += 3) {
      const double turn = 2 * kPi * context.q(joint_) / values(k);
      const double sine = std::sin(turn);
      const double cosine = std::cos(turn);
      state.add_to_joint(joint_, values(k + 1) * sine + values(k + 2) * cosine);
      if (jacobian == nullptr) continue;
      const double by_turn = values(k + 1) * cosine - values(k + 2) * sine;
      jacobian->add_to_joint(joint_, first_column + k, -by_turn * turn / values(k));
      jacobian->add_to_joint(joint_, first_column + k + 1, sine);
      jacobian->add_to_joint(joint_, first_column + k + 2, cosine);
    }
  }

 private:
  static constexpr double kPriorMm = 0.03;
  std::string name_;
  int joint_;
  std::vector<Parameter> parameters_;
};

/// A rail that is not straight. The carriage deviates from the line by smooth functions x(s) and
/// y(s) of its position, and turns with the rail: about y by x'(s), about x by -y'(s). It rolls
/// about the rail by w(s). All three are sums of Chebyshev polynomials over the rail's limits.
/// Constant and straight parts of x and y belong to the place of the rail, and the constant of the
/// roll to the mounting of the arm: base and geometry have these.
class RailStraightness final : public ErrorSource {
 public:
  RailStraightness(const SourceSpec& spec, const Joint& joint)
      : name_(spec.text), joint_(spec.joint), half_(travel_of(joint) / 2) {
    middle_ = std::isfinite(joint.lower) ? joint.lower + half_ : 0;
    for (const char* axis : {"straight_x", "straight_y"}) {
      for (int k = 2; k <= kDegrees; ++k)
        parameters_.push_back(
            length_parameter(fmt::format("{}{}_{}", axis, joint_ + 1, k), kStraightMm / (k - 1)));
    }
    for (int k = 1; k < kDegrees; ++k)
      parameters_.push_back(angle_parameter(fmt::format("roll{}_{}", joint_ + 1, k), kRoll / k));
  }
  const CauseRecord& cause() const override { return causes::rail_straightness(); }
  std::string name() const override { return name_; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  int joint() const override { return joint_; }
  std::string explanation() const override {
    return fmt::format("the rail of joint {} is not straight, and twisted", joint_ + 1);
  }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
    const double q = state.chain->drive().row(joint_) * context.q;
    const double place = state.chain->joint(joint_).link.d + q;
    move_axis(joint_, rates_at(q, place), values, state, jacobian, first_column);
    const StateRows rows(state.chain->size());
    for (int k = 1; k < kDegrees; ++k) {
      const int column = 2 * (kDegrees - 1) + k - 1;
      const double rate = polynomial(k, q).value;
      state.links[static_cast<std::size_t>(joint_)].theta += rate * values(column);
      if (jacobian != nullptr) jacobian->add(rows.theta(joint_), first_column + column, rate);
    }
  }

 private:
  static constexpr int kDegrees = 8;
  static constexpr double kStraightMm = 0.3;
  static constexpr double kRoll = 1e-4;  // rad

  struct Polynomial {
    double value = 0, slope = 0;
  };
  /// T_k over the rail's limits; beyond them it goes on straight.
  Polynomial polynomial(int k, double q) const {
    const double u = (q - middle_) / half_;
    const double inside = std::clamp(u, -1.0, 1.0);
    std::array<double, kDegrees + 1> T{1, inside};
    std::array<double, kDegrees + 1> slope{0, 1};
    for (std::size_t n = 2; n <= kDegrees; ++n) {
      T[n] = 2 * inside * T[n - 1] - T[n - 2];
      slope[n] = 2 * T[n - 1] + 2 * inside * slope[n - 1] - slope[n - 2];
    }
    const auto at = static_cast<std::size_t>(k);
    return {T[at] + (u - inside) * slope[at], slope[at] / half_};
  }

  /// The axis is tilted about the rail's zero, which moves the carriage by its place times the
  /// tilt: taken back.
  AxisMotion rates_at(double q, double place) const {
    AxisMotion rates = AxisMotion::Zero(5, static_cast<Eigen::Index>(parameters_.size()));
    for (int k = 2; k <= kDegrees; ++k) {
      const Polynomial one = polynomial(k, q);
      const int x = k - 2;
      const int y = x + kDegrees - 1;
      rates(0, x) = rates(1, y) = one.value - place * one.slope;
      rates(4, x) = one.slope;
      rates(3, y) = -one.slope;
    }
    return rates;
  }

  std::string name_;
  int joint_;
  double half_;
  double middle_ = 0;
  std::vector<Parameter> parameters_;
};

Result<ErrorSourcePtr> make_scale(const SourceSpec& spec, const Cell& cell) {
  TRY(check_is_rail(spec, cell));
  return std::make_shared<RailScale>(spec);
}

Result<ErrorSourcePtr> make_pitch(const SourceSpec& spec, const Cell& cell) {
  TRY(check_is_rail(spec, cell));
  if (spec.at.empty())
    return failure(ErrorCode::kUsage, "error source '{}': expected {}@mm, the pitch of the rack",
                   spec.text, spec.text);
  return std::make_shared<RackPitch>(spec, travel_of(cell.robot.joint(spec.joint)));
}

Result<ErrorSourcePtr> make_straightness(const SourceSpec& spec, const Cell& cell) {
  TRY(check_is_rail(spec, cell));
  return std::make_shared<RailStraightness>(spec, cell.robot.joint(spec.joint));
}

}  // namespace

const CauseRecord& causes::rail_scale() {
  static const CauseRecord record = {
      .spelling = "rail_scale",
      .plain_name = "scale of a rail",
      .plain_name_of_joint = "scale of the rail of joint {}",
      .scope = Scope::kJoint,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kJoints, 7},
      .forms = {{"rail_scale", make_scale}},
      .rivals = {{.cause = "rack_pitch"}, {.cause = "rail_straightness"}},
      .told_apart_by = remedies::kWiderRange,
      .shown_by = "poses along the whole rail",
      .action = "set the ratio of the rail's drive in the controller, or compensate it",
      .figures = {{"rail_scale", "um/m", "how much too far it travels for each metre"}},
  };
  return record;
}

const CauseRecord& causes::rack_pitch() {
  static const CauseRecord record = {
      .spelling = "rack_pitch",
      .plain_name = "uneven rack",
      .plain_name_of_joint = "uneven rack of joint {}",
      .scope = Scope::kJoint,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kNone,
      .acts = {ActsOn::kJoints, 8},
      .forms = {{"rack_pitch", make_pitch}},
      .rivals = {{.cause = "rail_scale"}, {.cause = "rail_straightness"}},
      .told_apart_by = remedies::kWiderRange,
      .shown_by = "poses along the whole rail, not all a whole number of pitches apart",
      .action = "compensate it, and have rack and pinion looked at if it grows",
      .figures = {{"pitch", "mm", "travel between two teeth, or of a turn of the pinion"},
                  {"rack_sin", "mm", "sine of how far the carriage is ahead"},
                  {"rack_cos", "mm", "its cosine"}},
      .takes_numbers = true,
  };
  return record;
}

const CauseRecord& causes::rail_straightness() {
  static const CauseRecord record = {
      .spelling = "rail_straightness",
      .plain_name = "straightness of a rail",
      .plain_name_of_joint = "straightness of the rail of joint {}",
      .scope = Scope::kJoint,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kJoints, 10},
      .forms = {{"rail_straightness", make_straightness}},
      .rivals = {{.cause = "rail_scale"}, {.cause = "base_compliance"}, {.cause = "geometry"}},
      .told_apart_by = remedies::kWiderRange,
      .shown_by = "poses along the whole rail, with the arm in different postures",
      .action = "have the rail aligned, or compensate it",
      .figures = {{"straight_x", "mm",
                   "how far it leaves the line along x, by the degree of the polynomial"},
                  {"straight_y", "mm", "along y"},
                  {"roll", "rad", "how far it is twisted"}},
  };
  return record;
}

}  // namespace trammel
