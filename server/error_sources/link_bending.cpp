#include <Eigen/Dense>
#include <cmath>
#include <unsupported/Eigen/AutoDiff>

#include "server/error_sources/error_source.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

constexpr double kShortestLink = 0.1;  // m; shorter ones do not bend

/// A link bends as a cantilever under the weight at its far end and the moment of the weight's
/// lever beyond it, eq. (4.2) with x = l: deflection F l^3/3EI + M l^2/2EI, slope F l^2/2EI + M
/// l/EI, both only across the link. Everything beyond moves along. One parameter, 1/EI, small
/// enough that bending adds to the pose linearly.
class LinkBending final : public ErrorSource {
 public:
  explicit LinkBending(const SourceSpec& spec)
      : name_(spec.text),
        joint_(spec.joint),
        parameters_({{fmt::format("flex{}", spec.joint + 1), "1/(N m2)", 1, 0, 1e-6, 0.0}}) {}
  const CauseRecord& cause() const override { return causes::link_bending(); }
  std::string name() const override { return name_; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  int joint() const override { return joint_; }
  std::string explanation() const override {
    return fmt::format("link {} bends under the payload", joint_ + 1);
  }

  void apply(const PoseContext&, const Eigen::Ref<const Eigen::VectorXd>& values, ArmState& state,
             StateJacobian* jacobian, int first_column) const override {
    const ArmKinematics kinematics(state);
    const ArmKinematics::LoadedLink link = kinematics.loaded_link(joint_);
    Eigen::Matrix<double, 15, 1> points;
    points << link.start, link.end, link.cog, link.tip, link.weight;
    const Vector6 unit = motion<double>(points);
    if (jacobian != nullptr) {
      if (values(0) != 0)
        jacobian->pass_on(jacobian->rows.whole_tip(),
                          values(0) * motion_by(points) * kinematics.loaded_link_jacobian(joint_));
      jacobian->add_block(jacobian->rows.tip(0), first_column, unit);
    }
    state.tip_W += values(0) * unit;
  }

 private:
  /// The derivative of motion() by the points.
  static Eigen::Matrix<double, 6, 15> motion_by(const Eigen::Matrix<double, 15, 1>& points) {
    using Dual = Eigen::AutoDiffScalar<Eigen::Matrix<double, 15, 1>>;
    Eigen::Matrix<Dual, 15, 1> dual;
    for (int i = 0; i < 15; ++i) dual(i) = Dual(points(i), 15, i);
    const Eigen::Matrix<Dual, 6, 1> with_derivative = motion<Dual>(dual);
    Eigen::Matrix<double, 6, 15> by_points;
    for (int i = 0; i < 6; ++i) by_points.row(i) = with_derivative(i).derivatives().transpose();
    return by_points;
  }
  /// Motion of the tool point [translation; rotation vector] in W for 1/EI = 1.
  template <typename T>
  static Eigen::Matrix<T, 6, 1> motion(const Eigen::Matrix<T, 15, 1>& points) {
    using Vec = Eigen::Matrix<T, 3, 1>;
    using std::sqrt;
    const Vec start = points.template segment<3>(0);
    const Vec end = points.template segment<3>(3);
    const Vec cog = points.template segment<3>(6);
    const Vec tip = points.template segment<3>(9);
    const Vec force = points.template segment<3>(12);
    const Vec span = end - start;
    const T square = span.dot(span);
    const T length = sqrt(square);
    const Vec axis = span / length;
    const Vec lever = cog - end;
    const Vec full_moment = lever.cross(force);
    const Vec moment = full_moment - axis * axis.dot(full_moment);
    const Vec across = force - axis * axis.dot(force);
    const Vec deflection = across * (square * length / 3.0) + moment.cross(axis) * (square / 2.0);
    const Vec slope = axis.cross(across) * (square / 2.0) + moment * length;
    const Vec beyond = tip - end;
    const Vec swept = slope.cross(beyond);
    Eigen::Matrix<T, 6, 1> result;
    result.template head<3>() = deflection + swept;
    result.template tail<3>() = slope;
    return result;
  }

  std::string name_;
  int joint_;
  std::vector<Parameter> parameters_;
};

Result<ErrorSourcePtr> make(const SourceSpec& spec, const Cell& cell) {
  const LinkGeometry& link = cell.robot.joint(spec.joint).link;
  const double length = std::hypot(link.a, link.d);
  if (length < kShortestLink || cell.payloads.empty()) {
    return refused("error source '{}': link {} is {:.3f} m long (limit {}), {} payloads", spec.text,
                   spec.joint + 1, length, kShortestLink, cell.payloads.size());
  }
  return std::make_shared<LinkBending>(spec);
}

}  // namespace

const CauseRecord& causes::link_bending() {
  static const CauseRecord record = {
      .spelling = "link_bending",
      .plain_name = "link bending",
      .plain_name_of_joint = "bending of link {}",
      .scope = Scope::kJoint,
      .lasting = Lasting::kAlways,
      .needs = {.payload = true},
      .search = SearchFamily::kColumns,
      .acts = {ActsOn::kLoadedArm, 1},
      .forms = {{"link_bending", make}},
      // Joints yield before links do. Bending is a separate cause only if the model has the
      // compliance of the joints. Odds of 50 to 1 (4 nat) while the model has neither.
      .rivals = {{.cause = "compliance", .likeness = Likeness::kSpecialCase, .surprise = 4},
                 {.cause = "payload"}},
      .told_apart_by = remedies::kOtherLoad,
      .shown_by = remedies::kOtherLoad.text,
      .action = "compensate it for this payload; identify again when the payload changes",
      .figures = {{"flex", "1/(N m2)", "how soft the link is, 1/EI"}},
      .gives_way = true,
  };
  return record;
}

}  // namespace trammel
