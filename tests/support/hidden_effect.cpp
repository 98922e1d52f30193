#include "tests/support/hidden_effect.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <numbers>

namespace trammel::hidden {

namespace {

using Eigen::Index;
using Eigen::Matrix4d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kReferenceTemperature = 20;

VectorXd one(double value) { return VectorXd::Constant(1, value); }
double either_sign(Random& random) { return whole(random, 0, 1) == 1 ? 1 : -1; }
double some(Random& random, double size) {
  return size * either_sign(random) * uniform(random, 0.6, 1.4);
}

VectorXd draw_motion(Random& random, double shift_mm, double turn) {
  VectorXd values(6);
  for (Index k = 0; k < 3; ++k) values(k) = shift_mm * normal(random);
  for (Index k = 3; k < 6; ++k) values(k) = turn * normal(random);
  return values;
}

Matrix4d motion_of(const VectorXd& values) {
  return motion(values.head<3>(), values(3), values(4), values(5));
}

const std::vector<std::string> kMotionNames = {"x", "y", "z", "rz", "ry", "rx"};

Effect effect(const HiddenCause& cause, std::vector<std::string> names, VectorXd values,
              std::function<void(const MeasuringPose&, const VectorXd&, Moment&)> act) {
  std::vector<bool> grows(names.size(), true);
  return {cause, std::move(names), std::move(values), std::move(grows), std::move(act)};
}

Index joint_of(const HiddenCause& cause) { return cause.joint - 1; }

Effect base(const HiddenCause& cause, const Scene&, Random& random) {
  return effect(cause, kMotionNames, draw_motion(random, 0.5, 5e-4),
                [](const MeasuringPose&, const VectorXd& v, Moment& m) {
                  m.arm.base = m.arm.base * motion_of(v);
                });
}

/// One number of the arm's own table, or of its gearboxes.
Effect arm_parameter(const HiddenCause& cause, const Scene&, Random& random) {
  const auto& all = arm_parameters();
  Index at = 0;
  while (at < static_cast<Index>(all.size()) &&
         all[static_cast<std::size_t>(at)].name != cause.parameter)
    ++at;
  const double unit = all[static_cast<std::size_t>(at)].unit;
  const bool stiffness = cause.cause == "compliance";
  return effect(cause, {cause.parameter}, one(0.1 * unit * (stiffness ? 1 : either_sign(random))),
                [at, count = static_cast<Index>(all.size())](const MeasuringPose&,
                                                             const VectorXd& v, Moment& m) {
                  VectorXd values = VectorXd::Zero(count);
                  values(at) = v(0);
                  m.arm = changed(m.arm, values);
                });
}

/// One of the loads is heavier or lighter than the cell file says.
Effect payload(const HiddenCause& cause, const Scene& scene, Random& random) {
  const int load = whole(random, 0, scene.loads - 1);
  return effect(cause, {"mass"}, one(some(random, 4)),
                [load](const MeasuringPose& p, const VectorXd& v, Moment& m) {
                  if (p.load == load) m.arm.load.mass_kg += v(0);
                });
}

Effect payload_changed(const HiddenCause& cause, const Scene&, Random& random) {
  VectorXd values(4);
  values << some(random, 4), 8 * normal(random), 8 * normal(random), 8 * normal(random);
  return effect(cause, {"mass", "cx", "cy", "cz"}, values,
                [first = cause.first](const MeasuringPose& p, const VectorXd& v, Moment& m) {
                  if (p.index < first) return;
                  m.arm.load.mass_kg += v(0);
                  m.arm.load.cog_mm += v.segment<3>(1);
                });
}

Effect tool(const HiddenCause& cause, const Scene& scene, Random& random) {
  const int which = whole(random, 0, scene.tools - 1);
  return effect(cause, kMotionNames, draw_motion(random, 0.3, 3e-4),
                [which](const MeasuringPose& p, const VectorXd& v, Moment& m) {
                  if (p.tool == which) m.arm.tool = motion_of(v) * m.arm.tool;
                });
}

Effect tool_changed(const HiddenCause& cause, const Scene&, Random& random) {
  return effect(cause, kMotionNames, draw_motion(random, 0.2, 3e-4),
                [first = cause.first](const MeasuringPose& p, const VectorXd& v, Moment& m) {
                  if (p.index >= first) m.arm.tool = motion_of(v) * m.arm.tool;
                });
}

/// A ripple of any order, with a weak one of twice the order on top.
Effect gear_transmission(const HiddenCause& cause, const Scene&, Random& random) {
  const double phase = uniform(random, 0, kTurn);
  VectorXd values(3);
  const double drawn = uniform(random, 8, cause.joint <= 3 ? 120 : 70);
  values << 5e-5 * std::cos(phase), 5e-5 * std::sin(phase), cause.order > 0 ? cause.order : drawn;
  Effect made = effect(cause, {"sine", "cosine", "order"}, values,
                       [j = joint_of(cause)](const MeasuringPose& p, const VectorXd& v, Moment& m) {
                         const double at = v(2) * p.q(j);
                         m.q(j) += v(0) * std::sin(at) + v(1) * std::cos(at) +
                                   0.1 * (v(1) * std::sin(2 * at) + v(0) * std::cos(2 * at));
                       });
  made.grows[2] = false;
  return made;
}

Effect encoder_eccentricity(const HiddenCause& cause, const Scene&, Random& random) {
  const double phase = uniform(random, 0, kTurn);
  VectorXd values(2);
  values << 2e-4 * std::cos(phase), 2e-4 * std::sin(phase);
  const double second_phase = uniform(random, 0, kTurn);
  return effect(
      cause, {"sine", "cosine"}, values,
      [j = joint_of(cause), second_phase](const MeasuringPose& p, const VectorXd& v, Moment& m) {
        const double q = p.q(j);
        m.q(j) += v(0) * std::sin(q) + v(1) * std::cos(q) +
                  0.03 * v.norm() * std::sin(2 * q + second_phase);
      });
}

struct Waves {
  static constexpr int kLowest = 2;
  std::vector<std::pair<double, double>> size_and_phase;  ///< of orders from kLowest on
  [[nodiscard]] double at(double q) const {
    double sum = 0;
    for (std::size_t k = 0; k < size_and_phase.size(); ++k) {
      sum += size_and_phase[k].first *
             std::sin((kLowest + static_cast<double>(k)) * q + size_and_phase[k].second);
    }
    return sum;
  }
};

/// Share of the variance of `values` over `q` that the best single order explains.
double best_single_order(const VectorXd& q, const VectorXd& values) {
  const VectorXd varying = values.array() - values.mean();
  double best = 0;
  for (double order = 0.5; order < 20; order += 0.1) {
    Eigen::MatrixX3d columns(q.size(), 3);
    columns << (order * q).array().sin(), (order * q).array().cos(),
        VectorXd::Ones(q.size()).array();
    const VectorXd left = varying - columns * columns.householderQr().solve(varying);
    best = std::max(best, 1 - left.squaredNorm() / varying.squaredNorm());
  }
  return best;
}

/// Many orders at once, of which none is prominent at these poses.
Effect joint_map(const HiddenCause& cause, const Scene& scene, Random& random) {
  constexpr int kHighest = 12;
  constexpr double kStandsOut = 0.5;
  const Index j = joint_of(cause);
  VectorXd q(static_cast<Index>(scene.poses->size()));
  for (Index i = 0; i < q.size(); ++i) q(i) = (*scene.poses)[static_cast<std::size_t>(i)].q(j);
  Waves waves;
  do {
    waves.size_and_phase.clear();
    for (int h = Waves::kLowest; h <= kHighest; ++h) {
      waves.size_and_phase.emplace_back(uniform(random, 0.7, 1.3), uniform(random, 0, kTurn));
    }
  } while (best_single_order(q, q.unaryExpr([&](double at) { return waves.at(at); })) > kStandsOut);
  return effect(cause, {"size"}, one(4e-5),
                [j, waves](const MeasuringPose& p, const VectorXd& v, Moment& m) {
                  m.q(j) += v(0) * waves.at(p.q(j));
                });
}

/// Play that the load widens a little.
Effect backlash(const HiddenCause& cause, const Scene& scene, Random&) {
  double mean_moment = 1;
  for (const MeasuringPose& pose : *scene.poses) {
    mean_moment += std::abs(load_moments(scene.arm, pose.q)(joint_of(cause))) /
                   static_cast<double>(scene.poses->size());
  }
  const double share = scene.load_widens_play ? 0.1 : 0;
  return effect(
      cause, {"play"}, one(4e-5),
      [j = joint_of(cause), mean_moment, share](const MeasuringPose& p, const VectorXd& v,
                                                Moment& m) {
        const double moment = share > 0 ? std::abs(load_moments(m.arm, p.q)(j)) / mean_moment : 0;
        m.q(j) -= p.direction[static_cast<std::size_t>(j)] * v(0) * (1 - share + share * moment);
      });
}

Effect wrist_coupling(const HiddenCause& cause, const Scene&, Random& random) {
  VectorXd values(3);
  values << some(random, 1e-4), some(random, 1e-4), some(random, 1e-4);
  return effect(cause, {"k54", "k64", "k65"}, values,
                [](const MeasuringPose& p, const VectorXd& v, Moment& m) {
                  m.q(4) += v(0) * (p.q(3) + 0.05 * std::sin(p.q(3)));
                  m.q(5) += v(1) * (p.q(3) + 0.05 * std::sin(p.q(3))) + v(2) * p.q(4);
                });
}

Effect link_bending(const HiddenCause& cause, const Scene&, Random&) {
  return effect(cause, {"flex"}, one(1e-13),
                [j = joint_of(cause)](const MeasuringPose&, const VectorXd& v, Moment& m) {
                  m.arm.flex[static_cast<std::size_t>(j)] += v(0);
                });
}

/// The links grow with their own temperature, which follows the thermometer.
Effect thermal_growth(const HiddenCause& cause, const Scene&, Random& random) {
  return effect(cause, {"growth"}, one(uniform(random, 3e-6, 1e-5)),
                [](const MeasuringPose& p, const VectorXd& v, Moment& m) {
                  const double factor = 1 + v(0) * (p.link_temperature_c - kReferenceTemperature);
                  for (Link& link : m.arm.links) {
                    link.a *= factor;
                    link.d *= factor;
                  }
                });
}

/// The stand moves: it is shifted, and turned about its own place.
Matrix4d stand_moved(const VectorXd& values) {
  return motion(tracker_stand_mm(), 0, 0, 0) * motion_of(values) *
         motion(-tracker_stand_mm(), 0, 0, 0);
}

Effect tracker_moved(const HiddenCause& cause, const Scene&, Random& random) {
  return effect(cause, kMotionNames, draw_motion(random, 0.05, 1.5e-5),
                [first = cause.first](const MeasuringPose& p, const VectorXd& v, Moment& m) {
                  if (p.index >= first) m.seen = stand_moved(v) * m.seen;
                });
}

/// It creeps, a little faster in the beginning.
Effect tracker_drift(const HiddenCause& cause, const Scene& scene, Random& random) {
  const double start = scene.poses->front().time_s;
  const double whole_time = scene.poses->back().time_s - start;
  return effect(cause, kMotionNames, draw_motion(random, 0.08, 2e-5),
                [start, whole_time](const MeasuringPose& p, const VectorXd& v, Moment& m) {
                  const double share = (p.time_s - start) / whole_time;
                  m.seen = stand_moved(v * (share + 0.1 * share * (1 - share))) * m.seen;
                });
}

Effect joint_slip(const HiddenCause& cause, const Scene&, Random& random) {
  return effect(cause, {"slip"}, one(some(random, 5e-5)),
                [j = joint_of(cause), first = cause.first](const MeasuringPose& p,
                                                           const VectorXd& v, Moment& m) {
                  if (p.index >= first) m.q(j) += v(0);
                });
}

Effect time_lag(const HiddenCause& cause, const Scene&, Random& random) {
  return effect(
      cause, {"lag"}, one(some(random, 3e-3)),
      [](const MeasuringPose& p, const VectorXd& v, Moment& m) { m.q -= v(0) * p.velocity; });
}

Effect outlier(const HiddenCause& cause, const Scene&, Random& random) {
  VectorXd values(3);
  for (Index k = 0; k < 3; ++k) values(k) = 0.1 * normal(random);
  return effect(cause, {"x", "y", "z"}, values,
                [first = cause.first](const MeasuringPose& p, const VectorXd& v, Moment& m) {
                  if (p.index == first) m.shift += v;
                });
}

/// The course of a slow effect, from 0 to at most 1, by the share of the batch's time: it warms up
/// and settles, or follows the day and returns.
std::function<double(double)> draw_course(Random& random) {
  if (whole(random, 0, 1) == 1) {
    const double lag = uniform(random, 0.15, 0.6);
    return [lag](double share) { return 1 - std::exp(-share / lag); };
  }
  const double turns = uniform(random, 0.5, 1.1);
  const double phase = uniform(random, 0, kTurn);
  return
      [turns, phase](double share) { return 0.5 + 0.5 * std::sin(kTurn * turns * share + phase); };
}

std::function<double(const MeasuringPose&)> draw_course(const Scene& scene, Random& random) {
  const double start = scene.poses->front().time_s;
  const double whole_time = scene.poses->back().time_s - start;
  return [course = draw_course(random), start, whole_time](const MeasuringPose& p) {
    return course((p.time_s - start) / whole_time);
  };
}

/// The zero of a joint follows the heat of its gearbox, which nobody measures.
Effect slow_zero(const HiddenCause& cause, const Scene& scene, Random& random) {
  const Index j = cause.depends_on.front().at(1) - '1';
  return effect(
      cause, {"size"}, one(some(random, 1e-4)),
      [j, course = draw_course(scene, random)](const MeasuringPose& p, const VectorXd& v,
                                               Moment& m) { m.q(j) += v(0) * course(p); });
}

/// The zero of a joint wanders by a random step at every pose, to either side.
Effect slow_walk(const HiddenCause& cause, const Scene& scene, Random& random) {
  const Index j = cause.depends_on.front().at(1) - '1';
  std::vector<double> way = {0};
  while (way.size() < scene.poses->size()) way.push_back(way.back() + normal(random));
  const double size = 1 / std::sqrt(static_cast<double>(way.size()));
  return effect(cause, {"size"}, one(some(random, 1e-4)),
                [j, way, size](const MeasuringPose& p, const VectorXd& v, Moment& m) {
                  m.q(j) += v(0) * size *
                            way[std::min(static_cast<std::size_t>(p.index), way.size() - 1)];
                });
}

/// The links grow with a heat that the thermometer, which is stuck, does not see.
Effect slow_growth(const HiddenCause& cause, const Scene& scene, Random& random) {
  return effect(
      cause, {"size"}, one(uniform(random, 3e-5, 1e-4)),
      [course = draw_course(scene, random)](const MeasuringPose& p, const VectorXd& v, Moment& m) {
        for (Link& link : m.arm.links) {
          link.a *= 1 + v(0) * course(p);
          link.d *= 1 + v(0) * course(p);
        }
      });
}

/// The stand of the tracker settles, or the floor under it gives way with the sun.
Effect slow_stand(const HiddenCause& cause, const Scene& scene, Random& random) {
  return effect(
      cause, kMotionNames, draw_motion(random, 0.08, 2e-5),
      [course = draw_course(scene, random)](const MeasuringPose& p, const VectorXd& v, Moment& m) {
        m.seen = stand_moved(v * course(p)) * m.seen;
      });
}

/// An axis that wobbles in an oval bearing: it tilts and shifts two and three times a turn, and a
/// little back once.
Effect axis_runout(const HiddenCause& cause, const Scene&, Random& random) {
  const double tilt = uniform(random, 0, kTurn), shift = uniform(random, 0, kTurn),
               back = uniform(random, 0, kTurn);
  return effect(
      cause, {"size"}, one(1e-4),
      [j = joint_of(cause), tilt, shift, back](const MeasuringPose& p, const VectorXd& v,
                                               Moment& m) {
        const double q = p.q(j);
        const double x =
            std::cos(2 * q + tilt) + 0.3 * std::cos(3 * q + shift) + 0.4 * std::cos(back - q);
        const double y =
            std::sin(2 * q + tilt) + 0.3 * std::sin(3 * q + shift) + 0.4 * std::sin(back - q);
        const Vector3d across(200 * v(0) * std::cos(2 * q + shift),
                              200 * v(0) * std::sin(2 * q + shift), 0);
        m.arm.bearings[static_cast<std::size_t>(j)] = motion(across, 0, v(0) * y, v(0) * x);
      });
}

/// The plate under the foot yields, to one side more than to the other.
Effect base_compliance(const HiddenCause& cause, const Scene&, Random& random) {
  const double share = uniform(random, 0.3, 0.9);
  return effect(cause, {"yield"}, one(1e-11),
                [share](const MeasuringPose&, const VectorXd& v, Moment& m) {
                  m.arm.foot += v(0) * Eigen::Vector2d(1, share);
                });
}

/// The links weigh something, which the gearboxes feel: the upper arm most.
Effect self_weight(const HiddenCause& cause, const Scene&, Random& random) {
  const double second = uniform(random, 0.5, 1), third = uniform(random, 0.1, 0.4);
  return effect(cause, {"mass"}, one(150),
                [second, third](const MeasuringPose&, const VectorXd& v, Moment& m) {
                  m.arm.weights[1] = {v(0), {-600, 20, 0}};
                  m.arm.weights[2] = {second * v(0), {-80, 0, 60}};
                  m.arm.weights[3] = {third * v(0), {0, -150, 0}};
                });
}

/// A bar or belt of a joint with a wrong length: the error depends on the angle of the joint before
/// it, and on the angle between the two.
Effect joint_coupling(const HiddenCause& cause, const Scene&, Random& random) {
  const double rate = uniform(random, 0.5, 1), phase = uniform(random, 0, kTurn),
               other = uniform(random, 0, kTurn);
  return effect(cause, {"size"}, one(1e-4),
                [j = joint_of(cause), rate, phase, other](const MeasuringPose& p, const VectorXd& v,
                                                          Moment& m) {
                  m.q(j) += v(0) * (rate * p.q(j - 1) + std::sin(2 * p.q(j - 1) + phase) +
                                    0.6 * std::sin(p.q(j) - p.q(j - 1) + other));
                });
}

/// The joints of the previous pose; for the first pose its own.
Joints come_from(const std::vector<MeasuringPose>& poses, const MeasuringPose& p) {
  const auto i =
      static_cast<std::size_t>(std::clamp<int>(p.index, 0, static_cast<int>(poses.size()) - 1));
  return i == 0 ? p.q : poses[i - 1].q;
}

/// Friction holds the joint back, the more the longer its last move was.
Effect hysteresis(const HiddenCause& cause, const Scene& scene, Random& random) {
  const double way = uniform(random, 0.05, 0.4);
  return effect(cause, {"hold"}, one(4e-5),
                [j = joint_of(cause), way, poses = *scene.poses](const MeasuringPose& p,
                                                                 const VectorXd& v, Moment& m) {
                  m.q(j) -= v(0) * std::tanh((p.q(j) - come_from(poses, p)(j)) / way);
                });
}

/// Measured before it stood still: every joint still lacks a share of its last move, some a little
/// more.
Effect early_reading(const HiddenCause& cause, const Scene& scene, Random& random) {
  Joints lacks;
  for (Index j = 0; j < kJoints; ++j) lacks(j) = uniform(random, 0.9, 1.1);
  return effect(
      cause, {"share"}, one(5e-5),
      [lacks, poses = *scene.poses](const MeasuringPose& p, const VectorXd& v, Moment& m) {
        m.q -= v(0) * lacks.cwiseProduct(p.q - come_from(poses, p));
      });
}

/// All that the tracker measures is larger in warm air, as seen from its stand.
Effect instrument_scale(const HiddenCause& cause, const Scene&, Random& random) {
  return effect(cause, {"scale"}, one(uniform(random, 2e-6, 6e-6)),
                [](const MeasuringPose& p, const VectorXd& v, Moment& m) {
                  const Matrix4d tool = m.seen * tool_frame(m.arm, m.q);
                  m.shift += v(0) * (p.temperature_c - kReferenceTemperature) *
                             (tool.block<3, 1>(0, 3) - tracker_stand_mm());
                });
}

HiddenCause unknown_of(std::vector<std::string> joints) {
  return {"unknown", 0, "", -1, std::move(joints), 0};
}

/// The angle of joint 3 is off by a wave that runs along two joints at once.
Effect wave_of_two(Random& random) {
  const Eigen::Vector2d order(uniform(random, 1.4, 3.4), uniform(random, 1.4, 3.4));
  const double phase = uniform(random, 0, kTurn);
  return effect(unknown_of({"q2", "q3"}), {"size"}, one(1e-4),
                [order, phase](const MeasuringPose& p, const VectorXd& v, Moment& m) {
                  m.q(2) += v(0) * std::sin(order(0) * p.q(1) + order(1) * p.q(2) + phase);
                });
}

/// The floor has a seam: beyond some angle of joint 1 the foot stands a little elsewhere.
Effect seam_in_the_floor(Random& random) {
  const double at = uniform(random, -0.5, 0.5);
  const VectorXd way = draw_motion(random, 1, 1e-4);
  return effect(unknown_of({"q1"}), {"size"}, one(0.05),
                [at, way](const MeasuringPose& p, const VectorXd& v, Moment& m) {
                  if (p.q(0) > at) m.arm.base = m.arm.base * motion_of(v(0) * way);
                });
}

/// A cracked link: its lower half opens as soon as joint 2 leans back.
Effect cracked_link(Random& random) {
  const double at = uniform(random, -0.2, 0.4);
  return effect(unknown_of({"q2"}), {"size"}, one(0.05),
                [at](const MeasuringPose& p, const VectorXd& v, Moment& m) {
                  if (p.q(1) < at) m.arm.links[1].a += v(0);
                });
}

/// A spindle in a soft mount: its sag depends on its attitude to gravity.
Effect soft_mount(Random& random) {
  const Vector3d softness(uniform(random, 0.3, 1), uniform(random, 0.3, 1),
                          uniform(random, 0.1, 0.3));
  return effect(unknown_of({}), {"size"}, one(0.05),
                [softness](const MeasuringPose&, const VectorXd& v, Moment& m) {
                  const Matrix4d tool = tool_frame(m.arm, m.q);
                  const Vector3d down = tool.block<3, 3>(0, 0).transpose() * Vector3d(0, 0, -1);
                  m.arm.tool = m.arm.tool * motion(v(0) * softness.cwiseProduct(down), 0, 0, 0);
                });
}

/// Every joint's zero walks at random, from pose to pose.
Effect walking_zeros(const Scene& scene, Random& random) {
  std::vector<Joints> way = {Joints::Zero()};
  while (way.size() < scene.poses->size()) {
    Joints next = way.back();
    for (Index j = 0; j < kJoints; ++j) next(j) += normal(random);
    way.push_back(next);
  }
  return effect(unknown_of({"time"}), {"size"}, one(1e-5),
                [way](const MeasuringPose& p, const VectorXd& v, Moment& m) {
                  m.q += v(0) * way[std::min(static_cast<std::size_t>(p.index), way.size() - 1)];
                });
}

/// At some three of ten poses another load hangs there than the batch says.
Effect other_loads(const Scene& scene, Random& random) {
  std::vector<bool> other;
  while (other.size() < scene.poses->size()) other.push_back(uniform(random, 0, 1) < 0.3);
  return effect(unknown_of({}), {"mass"}, one(20),
                [other](const MeasuringPose& p, const VectorXd& v, Moment& m) {
                  if (other[std::min(static_cast<std::size_t>(p.index), other.size() - 1)])
                    m.arm.load.mass_kg -= v(0);
                });
}

/// A smooth random function of some joints, in three axes of the base: waves of random direction
/// and phase.
Effect unknown(const HiddenCause& cause, const Scene&, Random& random) {
  constexpr int kWaves = 40;
  struct Wave {
    Joints order = Joints::Zero();
    Vector3d size = Vector3d::Zero();
    double phase = 0;
  };
  std::vector<Wave> waves(kWaves);
  const double length = uniform(random, 0.6, 1.0);  // rad
  for (Wave& wave : waves) {
    for (const std::string& joint : cause.depends_on)
      wave.order(joint.at(1) - '1') = normal(random) / length;
    wave.size = Vector3d(normal(random), normal(random), normal(random)) / std::sqrt(kWaves / 2.0);
    wave.phase = uniform(random, 0, kTurn);
  }
  return effect(cause, {"size"}, one(0.02),
                [waves](const MeasuringPose& p, const VectorXd& v, Moment& m) {
                  for (const Wave& wave : waves)
                    m.shift += v(0) * wave.size * std::cos(wave.order.dot(p.q) + wave.phase);
                });
}

using Maker = Effect (*)(const HiddenCause&, const Scene&, Random&);

const std::map<std::string, Maker>& makers() {
  static const std::map<std::string, Maker> all = {{"base", base},
                                                   {"geometry", arm_parameter},
                                                   {"compliance", arm_parameter},
                                                   {"payload", payload},
                                                   {"payload_changed", payload_changed},
                                                   {"tool", tool},
                                                   {"tool_changed", tool_changed},
                                                   {"gear_transmission", gear_transmission},
                                                   {"encoder_eccentricity", encoder_eccentricity},
                                                   {"joint_map", joint_map},
                                                   {"backlash", backlash},
                                                   {"wrist_coupling", wrist_coupling},
                                                   {"link_bending", link_bending},
                                                   {"thermal_growth", thermal_growth},
                                                   {"tracker_moved", tracker_moved},
                                                   {"tracker_drift", tracker_drift},
                                                   {"joint_slip", joint_slip},
                                                   {"time_lag", time_lag},
                                                   {"outlier", outlier},
                                                   {"axis_runout", axis_runout},
                                                   {"base_compliance", base_compliance},
                                                   {"self_weight", self_weight},
                                                   {"joint_coupling", joint_coupling},
                                                   {"hysteresis", hysteresis},
                                                   {"early_reading", early_reading},
                                                   {"instrument_scale", instrument_scale},
                                                   {"unknown", unknown}};
  return all;
}

/// Parameters of the arm's table without imitators among base and tool.
const std::vector<std::string> kOwnGeometry = {
    "a1", "alpha1", "q2", "a2", "alpha2", "beta2", "q3", "d3",
    "a3", "alpha3", "q4", "d4", "alpha4", "q5",    "d5", "alpha5"};

}  // namespace

std::string to_string(const HiddenCause& cause) {
  std::string text = cause.cause;
  if (!cause.parameter.empty()) return text + ":" + cause.parameter;
  if (cause.joint > 0) text += ":" + std::to_string(cause.joint);
  if (cause.first >= 0) text += "@" + std::to_string(cause.first + 1);
  for (const std::string& joint : cause.depends_on) text += " " + joint;
  return text;
}

const std::vector<std::string>& hideable_causes() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
    for (const auto& [name, maker] : makers()) {
      // At scattered poses every move is long, and hysteresis is play.
      if (name != "unknown" && name != "hysteresis") list.push_back(name);
    }
    return list;
  }();
  return names;
}

HiddenCause draw_cause(const std::string& name, const Scene& scene, Random& random) {
  HiddenCause cause{name, 0, "", -1, {}};
  const auto count = static_cast<int>(scene.poses->size());
  if (name == "gear_transmission" || name == "encoder_eccentricity" || name == "joint_map" ||
      name == "backlash") {
    cause.joint = whole(random, 1, 6);
  } else if (name == "axis_runout" || name == "hysteresis") {
    cause.joint = whole(random, 1, 5);
  } else if (name == "joint_coupling") {
    cause.joint = whole(
        random, 3, 4);  // joint 2 is not driven past joint 1; on the wrist it is a wrist coupling
  } else if (name == "joint_slip") {
    cause.joint = whole(random, 2, 5);  // on joint 6 it looks like a turned tool
  } else if (name == "link_bending") {
    cause.joint = whole(random, 0, 1) == 0 ? 2 : 4;
  } else if (name == "compliance") {
    cause.joint = whole(random, 2, 5);
    cause.parameter = "C" + std::to_string(cause.joint);
  } else if (name == "geometry") {
    cause.parameter = kOwnGeometry[static_cast<std::size_t>(
        whole(random, 0, static_cast<int>(kOwnGeometry.size()) - 1))];
  }
  if (name == "tracker_moved" || name == "joint_slip" || name == "tool_changed" ||
      name == "payload_changed") {
    cause.first = whole(random, count / 4, 3 * count / 4);
  } else if (name == "outlier") {
    cause.first = whole(random, 0, count - 1);
  }
  return cause;
}

Effect draw_slow_effect(const std::string& kind, const Scene& scene, Random& random) {
  if (kind == "slow_stand") return slow_stand({"unknown", 0, "", -1, {"time"}}, scene, random);
  if (kind == "slow_growth") return slow_growth({"unknown", 0, "", -1, {"time"}}, scene, random);
  const int joint = whole(random, 2, 5);
  const HiddenCause zero{"unknown", 0, "", -1, {"q" + std::to_string(joint), "time"}};
  return kind == "slow_walk" ? slow_walk(zero, scene, random) : slow_zero(zero, scene, random);
}

Effect draw_foreign_effect(const std::string& kind, const Scene& scene, Random& random) {
  if (kind == "foreign_wave") return wave_of_two(random);
  if (kind == "foreign_seam") return seam_in_the_floor(random);
  if (kind == "foreign_crack") return cracked_link(random);
  if (kind == "foreign_mount") return soft_mount(random);
  if (kind == "foreign_walks") return walking_zeros(scene, random);
  return other_loads(scene, random);
}

Effect draw_effect(const HiddenCause& cause, const Scene& scene, Random& random) {
  const auto found = makers().find(cause.cause);
  if (found == makers().end()) {
    std::fprintf(stderr, "no effect is called %s\n", cause.cause.c_str());
    std::abort();
  }
  return found->second(cause, scene, random);
}

}  // namespace trammel::hidden
