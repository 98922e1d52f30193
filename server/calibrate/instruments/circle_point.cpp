#include "server/calibrate/instruments/circle_point.h"

#include <algorithm>
#include <cmath>

#include "server/base/coverage.h"
#include "server/base/units.h"
#include "server/calibrate/instruments/axis_fit.h"
#include "server/calibrate/instruments/links_from_axes.h"

namespace trammel {

namespace {

// No robot deviates more from its nominal table: the arcs are of another robot, joint or posture.
constexpr double kMostLengthDeviation = 0.1;  // m
constexpr double kMostAngleDeviation = from_deg(10);

constexpr double kLeastStep = 1e-9;  // rad, m: of a difference, above rounding

/// A number of a link, and how files call it.
struct NamedMember {
  int joint;
  double LinkGeometry::*member;
  const char* symbol;
  bool length;
};

std::vector<NamedMember> members_of(const Chain& robot) {
  std::vector<NamedMember> members;
  for (int i = 0; i < robot.size(); ++i) {
    if (slides(robot, i)) continue;
    members.push_back({i, &LinkGeometry::theta, "q", false});
    if (!robot.joint(i).hayati) members.push_back({i, &LinkGeometry::d, "d", true});
    members.push_back({i, &LinkGeometry::a, "a", true});
    members.push_back({i, &LinkGeometry::alpha, "alpha", false});
    if (robot.joint(i).hayati) members.push_back({i, &LinkGeometry::beta, "beta", false});
  }
  return members;
}

std::string why_not_measured(const NamedMember& member, const TurningJoints& turning) {
  if (member.joint >= turning.last) return "the last link: nothing marks the flange";
  if (member.joint != turning.first) return {};
  if (member.member == &LinkGeometry::theta)
    return "nothing marks the base's azimuth: x0 is conventional";
  if (member.member == &LinkGeometry::d)
    return "nothing marks the base's height: the origin on axis 1 is conventional";
  return {};
}

Eigen::VectorXd deviations(const Chain& robot, const std::vector<NamedMember>& members,
                           const std::vector<LinkGeometry>& links) {
  Eigen::VectorXd values(static_cast<Eigen::Index>(members.size()));
  for (std::size_t k = 0; k < members.size(); ++k) {
    const auto link = static_cast<std::size_t>(members[k].joint);
    values(static_cast<Eigen::Index>(k)) =
        links[link].*members[k].member - robot.joint(members[k].joint).link.*members[k].member;
  }
  return values;
}

/// Everything measured at its posture, with the variance of each joint's residuals.
struct Fits {
  Chain robot;  ///< with a Hayati row wherever axes are parallel
  TurningJoints turning;
  JointVector held;         ///< m, the position of each prismatic joint; else 0
  std::vector<int> joints;  ///< of each axis
  std::vector<AxisFit> axes;
  std::vector<double> variance;  ///< m^2, of one coordinate
  std::vector<double> widening;  ///< factors for covariances whose variance was itself estimated
};

/// One line per joint; empty for a prismatic joint.
std::vector<AxisLine> lines_of(const Fits& fits) {
  std::vector<AxisLine> lines(static_cast<std::size_t>(fits.robot.size()));
  for (std::size_t k = 0; k < fits.axes.size(); ++k)
    lines[static_cast<std::size_t>(fits.joints[k])] = {fits.axes[k].n, fits.axes[k].c};
  return lines;
}

Result<Links> links_by(const Fits& fits, const std::vector<JointArcs>& groups,
                       const std::vector<AxisLine>& measured) {
  return links_of(fits.robot, at_zero(fits.robot, groups, measured), fits.held);
}

/// Deviations with axis `i` changed by `step` in one of its four small changes: two turns, two
/// shifts.
Result<Eigen::VectorXd> changed_deviations(const std::vector<JointArcs>& groups, const Fits& fits,
                                           const std::vector<NamedMember>& members, std::size_t i,
                                           int change, double step) {
  const AxisFit& fit = fits.axes[i];
  std::vector<AxisLine> lines = lines_of(fits);
  AxisLine& line = lines[static_cast<std::size_t>(fits.joints[i])];
  const Vector3 move = across(fit.n).col(change % 2) * step;
  if (change < 2) {
    line.n = (fit.n + move).normalized();
  } else {
    line.c += move;
  }
  const Links links = TRY(links_by(fits, groups, lines));
  return deviations(fits.robot, members, links.links);
}

/// Covariance of the deviations: first derivatives by central differences, a step of one standard
/// deviation each way.
Result<Eigen::MatrixXd> propagated(const std::vector<JointArcs>& groups, const Fits& fits,
                                   const std::vector<NamedMember>& members) {
  const auto size = static_cast<Eigen::Index>(members.size());
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(size, size);
  for (std::size_t i = 0; i < fits.axes.size(); ++i) {
    const AxisFit& fit = fits.axes[i];
    const Eigen::Matrix4d small =
        fit.normal_inverse.topLeftCorner<4, 4>() * (fits.variance[i] * fits.widening[i]);
    Eigen::MatrixXd J(size, 4);
    for (int k = 0; k < 4; ++k) {
      const double step = std::max(std::sqrt(small(k, k)), kLeastStep);
      const Result<Eigen::VectorXd> below = changed_deviations(groups, fits, members, i, k, -step);
      const Result<Eigen::VectorXd> above = changed_deviations(groups, fits, members, i, k, step);
      if (!below || !above) return tl::make_unexpected((below ? above : below).error());
      J.col(k) = (*above - *below) / (2 * step);
    }
    covariance += J * small * J.transpose();
  }
  return covariance;
}

/// Worst direction's U(k=2) of a symmetric covariance.
double worst_u(const Eigen::MatrixXd& covariance) {
  return kExpanded *
         std::sqrt(std::max(
             0.0,
             Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(covariance).eigenvalues().maxCoeff()));
}

void describe_circles(const JointArcs& group, const AxisFit& fit, double variance,
                      std::vector<CircleFit>& circles) {
  const Linearised last = linearised(fit, group);
  const auto uv = across(fit.n);
  Eigen::Index row = 0;
  for (std::size_t k = 0; k < group.arcs.size(); ++k) {
    const auto& arc = group.arcs[k];
    CircleFit circle;
    circle.joint = group.joint;
    circle.reflector = arc.front()->reflector;
    circle.points = static_cast<int>(arc.size());
    circle.centre_W = fit.centre(k);
    circle.radius = fit.radius[k];
    const auto by_angle = [&](const ArcPoint* a, const ArcPoint* b) {
      return a->q(group.joint) < b->q(group.joint);
    };
    const auto [low, high] = std::minmax_element(arc.begin(), arc.end(), by_angle);
    circle.span = (*high)->q(group.joint) - (*low)->q(group.joint);
    for (std::size_t p = 0; p < arc.size(); ++p, row += 2) {
      circle.plane_rms += last.residual(row) * last.residual(row);
      circle.circle_rms += last.residual(row + 1) * last.residual(row + 1);
    }
    circle.plane_rms = std::sqrt(circle.plane_rms / circle.points);
    circle.circle_rms = std::sqrt(circle.circle_rms / circle.points);
    Eigen::MatrixXd to_centre =
        Eigen::MatrixXd::Zero(3, fit.normal_inverse.cols());  // c + height n
    to_centre.leftCols<2>() = fit.height[k] * uv;
    to_centre.middleCols<2>(2) = uv;
    to_centre.col(4 + 2 * static_cast<Eigen::Index>(k)) = fit.n;
    circle.centre_u = worst_u(variance * to_centre * fit.normal_inverse * to_centre.transpose());
    circles.push_back(circle);
  }
}

/// The robot with other links.
Result<Chain> with_links(const Chain& robot, const std::vector<LinkGeometry>& links) {
  std::vector<Joint> joints;
  for (int i = 0; i < robot.size(); ++i) {
    Joint joint = robot.joint(i);
    joint.link = links[static_cast<std::size_t>(i)];
    joints.push_back(joint);
  }
  return Chain::make(robot.name(), std::move(joints), robot.couplings());
}

/// The variance of one coordinate by the residuals, as far as it exceeds the stated one.
void add_variance(const AxisFit& fit, double stated_sigma, Fits& fits) {
  const double seen = fit.freedom > 0 ? fit.cost / fit.freedom : 0;
  const double stated = stated_sigma * stated_sigma;
  fits.variance.push_back(std::max(seen, stated));
  // Student's t with f degrees of freedom has the variance f / (f - 2).
  const bool estimated = seen > stated && fit.freedom > 2;
  fits.widening.push_back(estimated ? fit.freedom / (fit.freedom - 2.0) : 1);
}

/// Fits the arcs of one joint, and adds axis and circles to `result`.
Status add_joint(const JointArcs& group, const ArcList& arcs, double stated_sigma, Fits& fits,
                 CirclePointResult& result) {
  AxisFit fit = TRY(axis_fit(group, arcs.where));
  const double angle_rms = TRY(orient(fit, group, arcs.where));
  add_variance(fit, stated_sigma, fits);
  const double variance = fits.variance.back() * fits.widening.back();
  JointAxis axis;
  axis.sigma = std::sqrt(fits.variance.back());
  axis.freedom = fit.freedom;
  axis.angle_rms = angle_rms;
  axis.direction_u = worst_u(variance * fit.normal_inverse.topLeftCorner<2, 2>());
  result.axes[static_cast<std::size_t>(group.joint)] = axis;
  fits.joints.push_back(group.joint);
  describe_circles(group, fit, variance, result.circles);
  fits.axes.push_back(std::move(fit));
  return {};
}

/// One number of the kinematic table; `variance` of its deviation.
Result<MeasuredParameter> measured_parameter(const NamedMember& member, const Fits& fits,
                                             double deviation, double variance,
                                             const std::string& where) {
  MeasuredParameter parameter;
  parameter.name = fmt::format("{}{}", member.symbol, member.joint + 1);
  parameter.length = member.length;
  parameter.nominal = fits.robot.joint(member.joint).link.*member.member;
  parameter.note = why_not_measured(member, fits.turning);
  parameter.measured = parameter.note.empty();
  if (!parameter.measured) return parameter;
  parameter.deviation = deviation;
  parameter.u = kExpanded * std::sqrt(std::max(0.0, variance));
  const double limit = member.length ? kMostLengthDeviation : kMostAngleDeviation;
  if (std::abs(deviation) < limit) return parameter;
  const auto shown = [&](double si) { return member.length ? to_mm(si) : to_deg(si); };
  return refused("{} is {:.3f} {} from that of robot {}, limit {:.0f}", parameter.name,
                 shown(deviation), member.length ? "mm" : "deg", fits.robot.name(), shown(limit))
      .in(where)
      .of(parameter.name)
      .beyond(shown(deviation), shown(limit))
      .next("another robot, joint or posture?");
}

/// Adds the kinematic table from the axes, its uncertainty, and the robot with this table.
Status add_links(const ArcList& arcs, const std::vector<JointArcs>& groups, const Fits& fits,
                 CirclePointResult& result) {
  const std::vector<AxisLine> lines = at_zero(fits.robot, groups, lines_of(fits));
  for (const int joint : fits.joints) {
    const auto i = static_cast<std::size_t>(joint);
    result.axes[i].direction_W = lines[i].n;
    result.axes[i].point_W = lines[i].c;
  }
  const Links links = TRY(links_by(fits, groups, lines_of(fits)));
  const std::vector<NamedMember> members = members_of(fits.robot);
  const Eigen::VectorXd deviation = deviations(fits.robot, members, links.links);
  result.covariance = TRY(propagated(groups, fits, members));
  for (std::size_t k = 0; k < members.size(); ++k) {
    const auto at = static_cast<Eigen::Index>(k);
    result.parameters.push_back(TRY(measured_parameter(members[k], fits, deviation(at),
                                                       result.covariance(at, at), arcs.where)));
  }
  result.X_WB = links.X_WB;
  result.robot = TRY(with_links(fits.robot, links.links));
  return {};
}

/// Adds the positions of the prismatic joints, and the notes about them.
void add_slides(const Chain& robot, const ArcList& arcs, Fits& fits, CirclePointResult& result) {
  fits.held = JointVector::Zero(robot.size());
  for (int j = 0; j < robot.size(); ++j) {
    if (!slides(robot, j)) continue;
    if (!arcs.points.empty()) fits.held(j) = arcs.points.front().q(j);
    result.notes.push_back(
        {"joint_slides", Note::Severity::kInfo,
         fmt::format("joint {} slides and draws no arc: its row stays as the robot file has it",
                     j + 1)});
  }
}

}  // namespace

Result<CirclePointResult> analyse_circle_points(const Chain& robot, const ArcList& arcs,
                                                const CirclePointOptions& options) {
  const std::vector<JointArcs> groups =
      TRY(sorted_by_joint(robot, arcs, options.sigma.has_value()));
  CirclePointResult result;
  result.axes.resize(groups.size());
  Fits fits;
  fits.turning = TRY(turning_joints(robot));
  add_slides(robot, arcs, fits, result);
  fits.robot = TRY(with_hayati_rows(robot, fits.turning, result.notes));
  for (const JointArcs& group : groups)
    if (!group.arcs.empty()) TRY(add_joint(group, arcs, options.sigma.value_or(0), fits, result));
  TRY(add_links(arcs, groups, fits, result));
  return result;
}

}  // namespace trammel
