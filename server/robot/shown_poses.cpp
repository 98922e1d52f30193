#include "server/robot/shown_poses.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "server/base/units.h"

namespace trammel {

namespace {

constexpr std::size_t kFewest = 3;             // poses
constexpr double kPositionSlack = 0.02e-3;     // m, beside rounding: the precision with which
                                               // controllers compute
const double kRotationSlack = from_deg(0.02);  // rad
constexpr double kCoarsest = 0.5e-3;           // m: joints that are rounded to more show nothing
const double kMoved =
    from_deg(15);  // rad: a joint that turns by less shows neither its sign nor its zero
constexpr double kMovedRail = 0.1;  // m

/// The place of the last decimal that any of `values` has; 1e-6 at the least.
double rounding_of(const std::vector<double>& values) {
  double step = 1;
  for (int decimals = 0; decimals < 6; ++decimals, step /= 10) {
    const bool whole = std::all_of(values.begin(), values.end(), [&](double value) {
      return std::abs(value / step - std::round(value / step)) < 1e-4;
    });
    if (whole) return step;
  }
  return step;
}

/// The effect of rounding to the digits that are shown on joints and position, one standard
/// deviation.
struct Rounding {
  JointArray joints;    // rad (m)
  double position = 0;  // m
};

Rounding rounding(const Chain& robot, const ShownPoses& shown) {
  const double kUniform = std::sqrt(12.0);
  Rounding rounding;
  rounding.joints.resize(robot.size());
  for (int j = 0; j < robot.size(); ++j) {
    const bool turns = robot.joint(j).type == JointType::kRevolute;
    std::vector<double> values;
    for (const JointVector& q : shown.q) values.push_back(turns ? to_deg(q(j)) : to_mm(q(j)));
    const double step = rounding_of(values);
    rounding.joints(j) = (turns ? from_deg(step) : from_mm(step)) / kUniform;
  }
  std::vector<double> positions;
  for (const Vector3& p : shown.p)
    for (const double value : p) positions.push_back(to_mm(value));
  rounding.position = from_mm(rounding_of(positions)) / kUniform;
  return rounding;
}

/// The frame in which poses are shown, and the tool to which they belong.
struct Frames {
  std::string name;
  Pose X_SB = Pose::Identity();  // S: the frame in which the controller shows them
  Pose X_FT = Pose::Identity();
};

std::vector<Frames> known_frames(const Cell& cell) {
  std::vector<Frames> all;
  const auto add_tools = [&](const std::string& frame, const Pose& X_SB) {
    all.push_back({"the flange in " + frame, X_SB, Pose::Identity()});
    for (const auto& [name, X_FT] : cell.tools)
      if (X_FT) all.push_back({"tool " + name + " in " + frame, X_SB, *X_FT});
  };
  add_tools("the robot's base", Pose::Identity());
  if (cell.X_WB && !cell.X_WB->isApprox(Pose::Identity(), 1e-9))
    add_tools("the cell's base", *cell.X_WB);
  return all;
}

/// The misfit between one arm and the shown poses.
struct Distance {
  double worst = 0;  // largest misfit over the misfit that rounding allows; up to 1 the arm
                     // explains all poses
  double position_rms = 0, position_max = 0, rotation_rms = 0, rotation_max = 0, position_limit = 0;
};

class Comparison {
 public:
  Comparison(const Chain& robot, const ShownPoses& shown)
      : shown_(shown), rounding_(rounding(robot, shown)) {
    for (std::size_t i = 0; i < shown.q.size(); ++i) limits_.push_back(limits_at(robot, i));
  }

  /// The residuals of `robot`, in units of the rounding: positions, then rotations.
  [[nodiscard]] Eigen::VectorXd residuals(const Chain& robot, const Frames& frames,
                                          const std::vector<Matrix3>* R) const {
    const auto n = static_cast<Eigen::Index>(shown_.q.size());
    Eigen::VectorXd r((R == nullptr ? 3 : 6) * n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const Pose X = frames.X_SB * robot.flange_pose(shown_.q[k]) * frames.X_FT;
      r.segment<3>(3 * i) = (shown_.p[k] - X.translation()) / limits_[k].first;
      if (R != nullptr)
        r.segment<3>(3 * (n + i)) =
            rotation_log((*R)[k] * X.linear().transpose()) / limits_[k].second;
    }
    return r;
  }

  [[nodiscard]] Distance distance(const Eigen::VectorXd& r) const {
    const std::size_t n = shown_.q.size();
    Distance d;
    for (std::size_t i = 0; i < n; ++i) {
      const double off = r.segment<3>(static_cast<Eigen::Index>(3 * i)).norm();
      d.worst = std::max(d.worst, off);
      d.position_max = std::max(d.position_max, off * limits_[i].first);
      d.position_rms += std::pow(off * limits_[i].first, 2) / static_cast<double>(n);
      d.position_limit = std::max(d.position_limit, limits_[i].first);
      if (r.size() <= static_cast<Eigen::Index>(3 * n)) continue;
      const double turned = r.segment<3>(static_cast<Eigen::Index>(3 * (n + i))).norm();
      d.worst = std::max(d.worst, turned);
      d.rotation_max = std::max(d.rotation_max, turned * limits_[i].second);
      d.rotation_rms += std::pow(turned * limits_[i].second, 2) / static_cast<double>(n);
    }
    d.position_rms = std::sqrt(d.position_rms);
    d.rotation_rms = std::sqrt(d.rotation_rms);
    return d;
  }

 private:
  /// m and rad: three standard deviations of the rounding, plus the precision of the controllers'
  /// computations.
  [[nodiscard]] std::pair<double, double> limits_at(const Chain& robot, std::size_t i) const {
    const Eigen::MatrixXd J = robot.jacobian(shown_.q[i]) * rounding_.joints.matrix().asDiagonal();
    const double position =
        std::sqrt(J.topRows<3>().squaredNorm() + 3 * std::pow(rounding_.position, 2));
    return {kPositionSlack + 3 * position, kRotationSlack + 3 * J.bottomRows<3>().norm()};
  }

  const ShownPoses& shown_;
  Rounding rounding_;
  std::vector<std::pair<double, double>> limits_;
};

/// One interpretation of the shown poses, and the robot's misfit under it.
struct Reading {
  Frames frames;
  const ShownPoses::Orientations* orientations = nullptr;
  Distance distance;

  [[nodiscard]] const std::vector<Matrix3>* rotations() const {
    return orientations == nullptr ? nullptr : &orientations->R;
  }
};

std::vector<const ShownPoses::Orientations*> meanings(const ShownPoses& shown) {
  std::vector<const ShownPoses::Orientations*> all;
  for (const ShownPoses::Orientations& one : shown.orientations) all.push_back(&one);
  if (all.empty()) all.push_back(nullptr);
  return all;
}

Reading nearest(const Cell& cell, const ShownPoses& shown, const Comparison& comparison) {
  std::optional<Reading> best;
  for (const Frames& frames : known_frames(cell)) {
    for (const ShownPoses::Orientations* orientations : meanings(shown)) {
      Reading reading{frames, orientations, {}};
      reading.distance =
          comparison.distance(comparison.residuals(cell.robot, frames, reading.rotations()));
      if (!best || reading.distance.worst < best->distance.worst) best = std::move(reading);
    }
  }
  return *best;
}

/// The base and the tool that fit best: R_shown = R_S R_BF R_T for all poses (linear in R_S^T and
/// R_T; the null vector of all equations), then both translations, linear too.
Frames free_frames(const Chain& robot, const ShownPoses& shown, const std::vector<Matrix3>& R) {
  const auto n = static_cast<Eigen::Index>(shown.q.size());
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(9 * n, 18);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const Matrix3 R_BF = robot.flange_pose(shown.q[k]).linear();
    for (int column = 0; column < 3; ++column) {
      for (int inner = 0; inner < 3; ++inner)
        A.block<3, 3>(9 * i + 3 * column, 3 * inner) = R[k](inner, column) * Matrix3::Identity();
      A.block<3, 3>(9 * i + 3 * column, 9 + 3 * column) = -R_BF;
    }
  }
  const Eigen::VectorXd null = A.jacobiSvd(Eigen::ComputeFullV).matrixV().col(17);
  const double sign = Eigen::Map<const Matrix3>(null.data()).determinant() < 0 ? -1 : 1;
  Frames frames{"a frame and a tool of the controller's own", {}, {}};
  frames.X_SB = Pose::Identity();
  frames.X_FT = Pose::Identity();
  frames.X_SB.linear() =
      nearest_rotation(sign * Eigen::Map<const Matrix3>(null.data())).transpose();
  frames.X_FT.linear() = nearest_rotation(sign * Eigen::Map<const Matrix3>(null.data() + 9));
  Eigen::MatrixXd B(3 * n, 6);
  Eigen::VectorXd b(3 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Pose X = frames.X_SB * robot.flange_pose(shown.q[static_cast<std::size_t>(i)]);
    B.block<3, 6>(3 * i, 0) << Matrix3::Identity(), X.linear();
    b.segment<3>(3 * i) = shown.p[static_cast<std::size_t>(i)] - X.translation();
  }
  const Eigen::VectorXd t = B.completeOrthogonalDecomposition().solve(b);
  frames.X_SB.translation() = t.head<3>();
  frames.X_FT.translation() = t.tail<3>();
  return frames;
}

/// A number of the robot file that the controller may have with another value.
struct FileNumber {
  int joint = 0;
  double LinkGeometry::*number = nullptr;
  const char* key = "";
  bool angle = false;
};

std::vector<FileNumber> file_numbers(const Chain& robot) {
  std::vector<FileNumber> all;
  for (int j = 0; j < robot.size(); ++j) {
    all.push_back({j, &LinkGeometry::a, "a_mm", false});
    if (!robot.joint(j).hayati) all.push_back({j, &LinkGeometry::d, "d_mm", false});
    all.push_back({j, &LinkGeometry::theta, "theta_deg", true});
    all.push_back({j, &LinkGeometry::alpha, "alpha_deg", true});
  }
  return all;
}

std::vector<Joint> joints_of(const Chain& robot) {
  std::vector<Joint> joints;
  for (int j = 0; j < robot.size(); ++j) joints.push_back(robot.joint(j));
  return joints;
}

/// The robot with some numbers changed.
Chain changed(const Chain& robot, const std::vector<FileNumber>& numbers,
              const Eigen::VectorXd& by) {
  std::vector<Joint> joints = joints_of(robot);
  for (std::size_t k = 0; k < numbers.size(); ++k)
    joints[static_cast<std::size_t>(numbers[k].joint)].link.*numbers[k].number +=
        by(static_cast<Eigen::Index>(k));
  return Chain::make(robot.name(), std::move(joints), robot.couplings()).value_or(robot);
}

/// Gauss-Newton over the numbers. Among changes that the poses do not distinguish it takes the
/// shortest.
Eigen::VectorXd fitted(const Chain& robot, const std::vector<FileNumber>& numbers,
                       const Reading& reading, const Comparison& comparison) {
  constexpr int kSteps = 12;
  constexpr double kDifference = 1e-6;  // m, rad
  const auto count = static_cast<Eigen::Index>(numbers.size());
  Eigen::VectorXd by = Eigen::VectorXd::Zero(count);
  for (int step = 0; step < kSteps; ++step) {
    const Eigen::VectorXd r =
        comparison.residuals(changed(robot, numbers, by), reading.frames, reading.rotations());
    Eigen::MatrixXd J(r.size(), count);
    for (Eigen::Index k = 0; k < count; ++k) {
      Eigen::VectorXd near = by;
      near(k) += kDifference;
      J.col(k) = (comparison.residuals(changed(robot, numbers, near), reading.frames,
                                       reading.rotations()) -
                  r) /
                 kDifference;
    }
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> decomposition;
    decomposition.setThreshold(1e-7);
    const Eigen::VectorXd move = decomposition.compute(J).solve(-r);
    by += move;
    if (move.norm() < 1e-9) break;
  }
  return by;
}

std::string change_text(const Chain& robot, const FileNumber& number, double by) {
  const double of_file = robot.joint(number.joint).link.*number.number;
  const double there = number.angle ? to_deg(of_file) : to_mm(of_file);
  const double change = number.angle ? to_deg(by) : to_mm(by);
  return fmt::format("{} of joint {} is {:.3f} by the poses, {:g} in the file", number.key,
                     number.joint + 1, there + change, there);
}

/// The arm with joint `j` counted the other way, or with its neighbour below counted into it.
std::vector<std::pair<std::string, Chain>> other_senses(const Chain& robot) {
  std::vector<std::pair<std::string, Chain>> all;
  const std::vector<Joint> joints = joints_of(robot);
  const std::vector<Coupling> couplings = robot.couplings();
  const auto add = [&](std::string text, std::vector<Joint> of, std::vector<Coupling> with) {
    if (auto chain = Chain::make(robot.name(), std::move(of), std::move(with)))
      all.emplace_back(std::move(text), *chain);
  };
  for (int j = 0; j < robot.size(); ++j) {
    std::vector<Joint> turned = joints;
    turned[static_cast<std::size_t>(j)].sign *= -1;
    add(fmt::format("sign of joint {} is {:+g} by the poses", j + 1,
                    turned[static_cast<std::size_t>(j)].sign),
        turned, couplings);
  }
  if (!couplings.empty()) {
    add("the controller shows joints without the file's coupling", joints, {});
  } else {
    for (int j = 1; j < robot.size(); ++j) {
      for (const double ratio : {1.0, -1.0})
        add(fmt::format("joint {} follows joint {} (coupling, ratio {:+g}) by the poses", j + 1, j,
                        ratio),
            joints, {{j, j - 1, ratio}});
    }
  }
  return all;
}

/// The single changes of the file that explain all poses; if there are none, the changes of all its
/// numbers.
std::vector<std::string> explanations(const Chain& robot, const Reading& reading,
                                      const Comparison& comparison) {
  std::vector<std::string> found;
  const auto explains = [&](const Chain& arm) {
    return comparison.distance(comparison.residuals(arm, reading.frames, reading.rotations()))
               .worst <= 1;
  };
  for (const auto& [text, arm] : other_senses(robot))
    if (explains(arm)) found.push_back(text);
  const std::vector<FileNumber> numbers = file_numbers(robot);
  for (const FileNumber& number : numbers) {
    const Eigen::VectorXd by = fitted(robot, {number}, reading, comparison);
    if (explains(changed(robot, {number}, by))) found.push_back(change_text(robot, number, by(0)));
  }
  if (!found.empty()) return found;
  const Eigen::VectorXd by = fitted(robot, numbers, reading, comparison);
  if (!explains(changed(robot, numbers, by))) return found;
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    const double change = by(static_cast<Eigen::Index>(k));
    if (std::abs(change) > (numbers[k].angle ? from_deg(0.02) : from_mm(0.1)))
      found.push_back(change_text(robot, numbers[k], change));
  }
  return found;
}

/// The joints that hardly move over the poses.
std::string still_joints(const Chain& robot, const ShownPoses& shown) {
  std::string still;
  for (int j = 0; j < robot.size(); ++j) {
    double least = shown.q.front()(j), most = least;
    for (const JointVector& q : shown.q) {
      least = std::min(least, q(j));
      most = std::max(most, q(j));
    }
    const bool turns = robot.joint(j).type == JointType::kRevolute;
    if (most - least < (turns ? kMoved : kMovedRail))
      still += fmt::format("{}{}", still.empty() ? "" : ", ", j + 1);
  }
  return still;
}

Status check_shown(const Cell& cell, const ShownPoses& shown) {
  if (shown.q.size() < kFewest)
    return refused("{} poses, at least {} are needed", shown.q.size(), kFewest)
        .beyond(shown.q.size(), kFewest)
        .next("show some six, with every joint moved");
  for (const JointVector& q : shown.q) {
    if (q.size() != cell.robot.size())
      return refused("{} joints, and {} has {}", q.size(), cell.robot.name(), cell.robot.size())
          .beyond(q.size(), cell.robot.size());
  }
  return {};
}

RobotComparison described(const Reading& reading, std::size_t poses) {
  RobotComparison result;
  result.poses = static_cast<int>(poses);
  result.position_rms = reading.distance.position_rms;
  result.position_max = reading.distance.position_max;
  result.rotation_rms = reading.distance.rotation_rms;
  result.rotation_max = reading.distance.rotation_max;
  result.position_limit = reading.distance.position_limit;
  result.shown_as = reading.frames.name;
  if (reading.orientations != nullptr) result.angles = reading.orientations->meaning;
  return result;
}

std::string off_text(const RobotComparison& result) {
  return fmt::format("position {:.3f} mm and orientation {:.3f} deg at the most",
                     to_mm(result.position_max), to_deg(result.rotation_max));
}

/// The answer if the arm fits the shown poses according to `reading`.
RobotComparison fitting(const Cell& cell, const ShownPoses& shown, const Reading& reading) {
  RobotComparison result = described(reading, shown.q.size());
  const std::string still = still_joints(cell.robot, shown);
  if (result.position_limit > kCoarsest) {
    result.why = fmt::format(
        "what is shown is rounded too much: its last digits are worth {:.1f} mm, limit {:g}; show "
        "more decimals",
        to_mm(result.position_limit), to_mm(kCoarsest));
  } else if (reading.orientations == nullptr) {
    result.why =
        "positions agree, but no orientation is shown, and only orientations tell of the wrist; "
        "show whole poses";
  } else if (!still.empty()) {
    result.why = fmt::format(
        "the poses agree, but joint {} hardly moves over them; show poses that differ in every "
        "joint",
        still);
  } else {
    result.verdict = RobotComparison::Verdict::kConfirmed;
    result.why = fmt::format("the robot file is the controller's: {} of {} poses", off_text(result),
                             result.poses);
  }
  return result;
}

/// The first reading in which the controller's own base and tool explain all poses, if there is
/// one.
std::optional<Reading> with_free_frames(const Cell& cell, const ShownPoses& shown,
                                        const Comparison& comparison) {
  constexpr std::size_t kFewestFree = 4;  // poses: twelve numbers are free
  if (shown.q.size() < kFewestFree) return std::nullopt;
  for (const ShownPoses::Orientations& one : shown.orientations) {
    Reading reading{free_frames(cell.robot, shown, one.R), &one, {}};
    reading.distance =
        comparison.distance(comparison.residuals(cell.robot, reading.frames, &one.R));
    if (reading.distance.worst <= 1) return reading;
  }
  return std::nullopt;
}

std::string place_text(const Pose& X) {
  const Vector3 p = to_mm(1) * X.translation(), turn = to_deg(1) * rotation_log(X.linear());
  return fmt::format("({:.2f}, {:.2f}, {:.2f}) mm, turned by {:.2f} deg", p.x(), p.y(), p.z(),
                     turn.norm());
}

}  // namespace

const char* to_text(RobotComparison::Verdict verdict) {
  switch (verdict) {
    case RobotComparison::Verdict::kConfirmed:
      return "confirmed";
    case RobotComparison::Verdict::kDiffers:
      return "differs";
    case RobotComparison::Verdict::kCannotTell:
      return "cannot_tell";
  }
  return "";
}

Result<RobotComparison> compare_robot(const Cell& cell, const ShownPoses& shown) {
  TRY(check_shown(cell, shown));
  const Comparison comparison(cell.robot, shown);
  const Reading reading = nearest(cell, shown, comparison);
  if (reading.distance.worst <= 1) return fitting(cell, shown, reading);
  RobotComparison result = described(reading, shown.q.size());
  result.verdict = RobotComparison::Verdict::kDiffers;
  result.could_be = explanations(cell.robot, reading, comparison);
  if (result.could_be.empty()) {
    if (const auto free = with_free_frames(cell, shown, comparison)) {
      result = described(*free, shown.q.size());
      result.why = fmt::format(
          "the poses fit with a base of the controller's at {} and a tool at {}, which hide the "
          "first and the last length; show the flange (tool 0) in the robot's own base",
          place_text(free->frames.X_SB), place_text(free->frames.X_FT));
      return result;
    }
  }
  result.why = fmt::format("the robot file is not the controller's: {} of {} poses, read as {}",
                           off_text(result), result.poses, result.shown_as);
  return result;
}

}  // namespace trammel
