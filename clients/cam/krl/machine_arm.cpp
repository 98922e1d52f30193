#include "clients/cam/krl/machine_arm.h"

#include <fmt/format.h>

#include <cmath>
#include <string_view>
#include <tuple>

#include "server/base/units.h"

namespace trammel::cam::krl {

namespace {

constexpr int kTurning = 6;           // axes
constexpr double kSameNumber = 1e-9;  // m, and of the cosine of an angle
constexpr double kQuarter = kPi / 2;  // rad
constexpr double kSecondsAMinute = 60;

/// Rounding of sines and cosines is no length and no angle.
double plain(double value) { return std::abs(value) < 1e-13 ? 0 : value; }

double turn_about_z(const Matrix3& R) { return plain(std::atan2(R(1, 0), R(0, 0))); }

/// -180 deg is 180 deg.
double above_half_turn(double angle) {
  return angle < -kPi + kSameNumber ? angle + 2 * kPi : angle;
}

Matrix3 about(int axis, double angle) { return rotation_exp(angle * Vector3::Unit(axis)); }

class Machine {
 public:
  Machine(const std::vector<std::vector<Line>>& lines, const Variables& names)
      : lines_(lines), names_(names) {}

  /// The reason why machine_arm() does not take this kind of arm; empty if it does.
  [[nodiscard]] std::string against_kind() const {
    for (const auto& [name, wanted, what] :
         {std::tuple("$MAIN_AXIS", "NR", "an arm of six turning axes"),
          std::tuple("$WRIST_AXIS", "ZEH", "a wrist whose axes meet")}) {
      const std::string word = word_of(name);
      if (word.empty()) return fmt::format("{} is not in the files", name);
      if (word != wanted)
        return fmt::format("{} is #{}, which is not {} (#{})", name, word, what, wanted);
    }
    for (const char* name : {"$DEF_A4FIX", "$DEF_A5LINK"})
      if (word_of(name) == "TRUE") return fmt::format("{} is TRUE: axes follow others", name);
    if (const Told<double> axes = number("$NUM_AX"); axes && *axes != kTurning)
      return fmt::format("$NUM_AX is {:g}, expected {}", *axes, kTurning);
    constexpr double kLinear = 1;
    for (int axis = 1; axis <= kTurning; ++axis) {
      const Told<double> type = number(fmt::format("$AXIS_TYPE[{}]", axis));
      if (type && *type == kLinear) return fmt::format("axis {} slides ($AXIS_TYPE)", axis);
      const Told<double> place = number(fmt::format("$AXIS_SEQ[{}]", axis));
      if (place && *place != axis)
        return fmt::format("axis {} has another place ($AXIS_SEQ)", axis);
    }
    return "";
  }

  [[nodiscard]] Told<double> number(const std::string& name) const {
    const Told<const Assigned*> value = names_.value_of(name, 0);
    if (!value) return because(value.error());
    const std::vector<Value>& operands = (*value)->operands;
    if (operands.size() != 1 || operands[0].kind != Value::Kind::kNumber)
      return because(fmt::format("{} is no number", name));
    return operands[0].number;
  }

  [[nodiscard]] Told<double> field(const std::string& name, const char* wanted) const {
    const Told<const Assigned*> value = names_.value_of(name, 0);
    if (!value) return because(value.error());
    const std::vector<Value>& operands = (*value)->operands;
    const Value* found = operands.size() == 1 ? operands[0].field(wanted) : nullptr;
    if (found == nullptr || found->kind != Value::Kind::kNumber)
      return because(fmt::format("{} has no number {}", name, wanted));
    return found->number;
  }

  [[nodiscard]] Told<Pose> frame(const std::string& name) const {
    const Told<const Assigned*> value = names_.value_of(name, 0);
    if (!value) return because(value.error());
    return names_.frame_of((*value)->operands, (*value)->file);
  }

  /// A frame that lies on the z axis of the one before, and is turned about it alone.
  [[nodiscard]] Told<Pose> frame_on_z(const std::string& name) const {
    Told<Pose> X = frame(name);
    if (!X) return X;
    const bool on_z =
        X->translation().head<2>().norm() < kSameNumber && X->linear()(2, 2) > 1 - kSameNumber;
    if (!on_z) return because(fmt::format("{} does not lie on an axis and is not read", name));
    return X;
  }

 private:
  /// `DECL MAIN_AXIS $MAIN_AXIS=#NR`, `BOOL $DEF_A4FIX=FALSE`; empty: no line says it.
  [[nodiscard]] std::string word_of(std::string_view variable) const {
    for (const std::vector<Line>& file : lines_) {
      for (const Line& line : file) {
        const std::size_t at = line.tokens.find(variable);
        if (line.tokens[at + 1].is("=") && line.tokens.back().is_word())
          return std::string(line.tokens.back().text);
      }
    }
    return "";
  }

  const std::vector<std::vector<Line>>& lines_;
  const Variables& names_;
};

/// The rows of axes 3 and 4, whose angles are still open, from `$TX3P3`. The axis of row 3 is the y
/// axis of the frame of `$TX3P3`.
std::string add_forearm(const Pose& X3P3, Joint& third, Joint& fourth) {
  const Matrix3 R = about(0, kQuarter) * X3P3.linear();
  const Vector3 p = about(0, kQuarter) * X3P3.translation(), axis_4 = R.col(2);
  if (std::abs(axis_4.z()) > kSameNumber)
    return "axis 4 is not at a right angle to axis 3 ($TX3P3)";
  third.link.theta = plain(std::atan2(-axis_4.x(), axis_4.y()));
  third.link.alpha = -kQuarter;
  third.link.a = plain(p.dot(about(2, third.link.theta).col(0)));
  third.link.d = plain(p.z());
  const Matrix3 reached = about(2, third.link.theta) * about(0, -kQuarter);
  fourth.link.theta = above_half_turn(turn_about_z(reached.transpose() * R));
  fourth.link.d = plain(p.dot(axis_4));
  return "";
}

/// The same wrist with axis 5 counted by the right-hand rule, as robot files have it: Rx(90) Rz(-q)
/// Rx(-90) is Rx(-90) Rz(q) Rx(90).
void turn_axis_5(Joint& fourth, Joint& fifth) {
  if (fifth.sign > 0 || fourth.link.alpha < 0) return;
  fourth.link.alpha -= kPi;
  fifth.link.alpha += kPi;
  fifth.sign = 1;
}

class Arm {
 public:
  explicit Arm(const Machine& machine) : machine_(machine), joints_(kTurning) {}

  Told<std::vector<Joint>> joints() {
    for (const std::string& why : {read_senses(), read_body(), read_wrist()})
      if (!why.empty()) return because(why);
    turn_axis_5(joints_[3], joints_[4]);
    read_speeds();
    return std::move(joints_);
  }

 private:
  std::string read_senses() {
    for (int axis = 1; axis <= kTurning; ++axis) {
      const Told<double> sense = machine_.number(fmt::format("$AXIS_DIR[{}]", axis));
      if (!sense) return sense.error();
      if (std::abs(*sense) != 1) return fmt::format("$AXIS_DIR[{}] is {:g}", axis, *sense);
      joint(axis).sign = *sense;
    }
    return "";
  }

  std::string read_body() {
    const Told<Pose> foot = machine_.frame_on_z("$TIRORO"), wrist = machine_.frame("$TX3P3");
    const Told<double> a = machine_.number("$LENGTH_A"), b = machine_.number("$LENGTH_B");
    for (const std::string& why : {error_of(foot), error_of(wrist), error_of(a), error_of(b)})
      if (!why.empty()) return why;
    joint(1).link = {turn_about_z(foot->linear()), foot->translation().z(), from_mm(*a), -kQuarter,
                     0};
    joint(2).link.a = from_mm(*b);
    joint(2).hayati = true;
    return add_forearm(*wrist, joint(3), joint(4));
  }

  std::string read_wrist() {
    for (int axis = 4; axis <= 5; ++axis) {
      const std::string name = fmt::format("$DH_{}", axis);
      const Told<double> a = machine_.field(name, "DHART_A"), d = machine_.field(name, "DHART_D"),
                         alpha = machine_.field(name, "DHART_ALPHA");
      for (const std::string& why : {error_of(a), error_of(d), error_of(alpha)})
        if (!why.empty()) return why;
      if (*a != 0 || *d != 0)
        return fmt::format("{} has lengths, which a wrist whose axes meet has not", name);
      joint(axis).link.alpha = from_deg(*alpha);
    }
    const Told<Pose> flange = machine_.frame_on_z("$TFLWP");
    if (!flange) return flange.error();
    joint(6).link.theta = turn_about_z(flange->linear());
    joint(6).link.d = flange->translation().z();
    return "";
  }

  /// From the motors' rated speeds and their gears, if the file states both.
  void read_speeds() {
    for (int axis = 1; axis <= kTurning; ++axis) {
      const std::string gear = fmt::format("$RAT_MOT_AX[{}]", axis);
      const Told<double> n = machine_.field(gear, "N"), d = machine_.field(gear, "D");
      if (!n || !d || *n == 0 || *d == 0) continue;
      joint(axis).gear_ratio = std::abs(*n / *d);
      const Told<double> motor = machine_.number(fmt::format("$VEL_AXIS_MA[{}]", axis));
      if (motor && *motor > 0)
        joint(axis).max_speed = *motor / kSecondsAMinute * 2 * kPi / joint(axis).gear_ratio;
    }
  }

  template <typename T>
  static std::string error_of(const Told<T>& told) {
    return told ? "" : told.error();
  }
  Joint& joint(int axis) { return joints_[static_cast<std::size_t>(axis - 1)]; }

  const Machine& machine_;
  std::vector<Joint> joints_;
};

}  // namespace

Told<Chain> machine_arm(const std::vector<std::vector<Line>>& lines, const Variables& names,
                        const std::string& name,
                        const std::vector<std::pair<double, double>>& limits) {
  const Machine machine(lines, names);
  if (const std::string why = machine.against_kind(); !why.empty()) return because(why);
  Told<std::vector<Joint>> joints = Arm(machine).joints();
  if (!joints) return because(joints.error());
  for (std::size_t k = 0; k < limits.size() && k < joints->size(); ++k)
    std::tie((*joints)[k].lower, (*joints)[k].upper) = limits[k];
  Result<Chain> arm = Chain::make(name, std::move(*joints));
  if (!arm) return because(arm.error().message);
  return std::move(*arm);
}

}  // namespace trammel::cam::krl
