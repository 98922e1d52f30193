#include "server/measurement/reading/arm_fit.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/base/median.h"
#include "server/base/units.h"
#include "server/robot/arm_state.h"
#include "server/robot/cube_turns.h"
#include "server/robot/rigid_fit.h"

namespace trammel::reading {

namespace {

// Prior standard deviations of an arm before calibration.
constexpr double kZero = from_deg(3);
constexpr double kZeroOfRail = 5e-3;  // m
constexpr double kLength = 3e-3;      // m, of a and d
constexpr double kTwist = from_deg(0.3);
constexpr double kCompliance = from_rad_per_nmm(3e-9);  // rad/Nm
constexpr double kToolPoint = 5e-3;                     // m, of a tool that the cell knows
constexpr double kToolLength = 1;                       // m, of a tool that the cell does not know
constexpr double kUnmodelled = 1e-3;                    // m, of a position
// Robustness.
constexpr double kCounted = 0.7;   // share of the positions that fit best
constexpr double kKept = 0.6;      // likewise, while base and tool are looked for
constexpr double kFarRow = 3;      // times the median distance
constexpr double kNearRow = 3e-3;  // m: no position within it is left out
constexpr int kBaseParameters = 6;
constexpr int kMostSteps = 15, kStepsOfFrames = 6, kRoundsOfStart = 3;
constexpr double kLastStep = 1e-3;  // relative gain of the quality that counts as none
constexpr std::size_t kFewestRows = 3;

using Indices = std::vector<std::size_t>;

/// rms of the smallest `kCounted` of all.
double counted_rms(std::vector<double> all, std::size_t* count) {
  const auto n = static_cast<std::size_t>(std::ceil(kCounted * static_cast<double>(all.size())));
  std::nth_element(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(n - 1), all.end());
  double sum = 0;
  for (std::size_t i = 0; i < n; ++i) sum += all[i] * all[i];
  *count = n;
  return std::sqrt(sum / static_cast<double>(n));
}

/// The free numbers of an arm: base, tool points, then the arm's deviations.
class Layout {
 public:
  Layout(const NumberTable& table, const Cell& cell, ToolPoints points) : robot_(cell.robot) {
    for (const Measurement* m : table.from) tools_.emplace(m->context.tool, 0);
    int k = 0;
    for (auto& [tool, place] : tools_) {
      place = k++;
      tool_stddev_.push_back(cell.tools.at(tool) && points == ToolPoints::kAsDrawn ? kToolPoint
                                                                                   : kToolLength);
    }
    const int n = robot_.size();
    stddev_ = Eigen::VectorXd::Zero(6 * n);
    for (int j = 0; j < n; ++j) {
      const Joint& joint = robot_.joint(j);
      const bool turns = joint.type == JointType::kRevolute;
      stddev_(j) = turns ? kZero : kZeroOfRail;
      stddev_(n + j) = kLength;
      stddev_(2 * n + j) = turns && !joint.hayati ? kLength : 0;
      stddev_(3 * n + j) = kTwist;
      stddev_(4 * n + j) = joint.hayati ? kTwist : 0;
      stddev_(5 * n + j) = turns ? kCompliance : 0;
    }
  }

  [[nodiscard]] const std::map<std::string, int>& tools() const { return tools_; }
  [[nodiscard]] double tool_stddev(int tool) const {
    return tool_stddev_[static_cast<std::size_t>(tool)];
  }
  [[nodiscard]] int tool_at(const std::string& tool) const {
    return kBaseParameters + 3 * tools_.at(tool);
  }
  [[nodiscard]] int arm_at() const { return kBaseParameters + 3 * static_cast<int>(tools_.size()); }
  [[nodiscard]] int arm_size() const { return static_cast<int>(stddev_.size()); }
  [[nodiscard]] int size() const { return arm_at() + arm_size(); }
  /// The prior deviations of the arm's numbers; 0: the arm has no number of this kind.
  [[nodiscard]] const Eigen::VectorXd& stddev() const { return stddev_; }

 private:
  const Chain& robot_;
  std::map<std::string, int> tools_;
  std::vector<double> tool_stddev_;
  Eigen::VectorXd stddev_;
};

ArmState state_of(const Measurement& from, JointVector q, const Cell& cell, const ArmFit& fit) {
  const int n = cell.robot.size();
  const Eigen::VectorXd& arm = fit.arm;
  ArmState state;
  state.chain = &cell.robot;
  q += arm.head(n);
  state.links = cell.robot.links_at(q);
  for (int j = 0; j < n; ++j) {
    LinkGeometry& link = state.links[static_cast<std::size_t>(j)];
    link.a += arm(n + j);
    link.d += arm(2 * n + j);
    link.alpha += arm(3 * n + j);
    link.beta += arm(4 * n + j);
  }
  state.X_WB = fit.X_WB;
  state.X_FT = fit.tools.at(from.context.tool);
  if (const auto payload = cell.payloads.find(from.context.payload); payload != cell.payloads.end())
    state.payload = payload->second;
  state.gravity_W = cell.gravity_W;
  return state;
}

/// Lets the joints give way under the load; `torque` receives the load.
void give_way(ArmState& state, const ArmFit& fit, JointArray* torque) {
  const int n = state.chain->size();
  *torque = ArmKinematics(state).gravity_torque();
  const JointArray turned = state.chain->bars() * fit.arm.segment(5 * n, n).cwiseProduct(*torque);
  for (int j = 0; j < n; ++j) {
    if (state.chain->joint(j).type == JointType::kRevolute)
      state.links[static_cast<std::size_t>(j)].theta += turned(j);
  }
}

/// One predicted position, and its derivatives by all free numbers.
class Prediction {
 public:
  Prediction(const NumberTable& table, std::size_t row, const Cell& cell, const ArmFit& fit)
      : cell_(cell), state_(state_of(*table.from[row], table.joints(row), cell, fit)) {
    give_way(state_, fit, &torque_);
  }
  [[nodiscard]] Vector3 position() const {
    return ArmKinematics(state_).tool_pose_W().translation();
  }
  [[nodiscard]] Pose flange() const {
    return ArmKinematics(state_).tool_pose_W() * state_.X_FT.inverse();
  }
  /// 3 x layout.size().
  [[nodiscard]] Eigen::Matrix3Xd jacobian(const Layout& layout, const std::string& tool) const {
    const StateMatrix<6> by_state = ArmKinematics(state_).pose_jacobian();
    const Chain& robot = cell_.robot;
    const int n = robot.size();
    const StateRows rows(n);
    Eigen::Matrix3Xd J = Eigen::Matrix3Xd::Zero(3, layout.size());
    const auto column = [&](int row) { return by_state.col(row).head<3>(); };
    for (int k = 0; k < kBaseParameters; ++k) J.col(k) = column(rows.base(k));
    for (int k = 0; k < 3; ++k) J.col(layout.tool_at(tool) + k) = column(rows.tool(k));
    const int arm = layout.arm_at();
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) {
        if (const double share = robot.transmission()(i, j); share != 0)
          J.col(arm + j) += share * column(rows.of_joint(robot, i));
        if (const double share = robot.bars()(i, j); share != 0)
          J.col(arm + 5 * n + j) += share * torque_(j) * column(rows.theta(i));
      }
      J.col(arm + n + j) = column(rows.a(j));
      J.col(arm + 2 * n + j) = column(rows.d(j));
      J.col(arm + 3 * n + j) = column(rows.alpha(j));
      J.col(arm + 4 * n + j) = column(rows.beta(j));
    }
    return J;
  }

 private:
  const Cell& cell_;
  ArmState state_;
  JointArray torque_;
};

/// Steps of Gauss and Newton; rows far off the others do not count.
class Fitting {
 public:
  Fitting(const NumberTable& table, const Cell& cell, ToolPoints points, bool whole_arm)
      : table_(table), cell_(cell), layout_(table, cell, points), whole_arm_(whole_arm) {}

  [[nodiscard]] ArmFit from(ArmFit fit, int steps) const {
    assess(fit);
    ArmFit best = fit;
    for (int step = 0; step < steps; ++step) {
      const auto moved = step_from(fit);
      if (!moved) break;
      fit = *moved;
      assess(fit);
      const bool gains = fit.quality < best.quality * (1 - kLastStep);
      if (fit.quality < best.quality) best = fit;
      if (!gains && step > 2) break;
    }
    return best;
  }

  /// Judges how well it fits.
  void assess(ArmFit& fit) const {
    std::size_t count = 0;
    fit.off = counted_rms(distances(table_, cell_, fit), &count);
    fit.quality = std::sqrt(fit.off * fit.off +
                            kUnmodelled * kUnmodelled * strain(fit) / static_cast<double>(count));
  }
  /// Adds how well zeros and tool points are known.
  void add_uncertainty(ArmFit& fit) const {
    const Eigen::MatrixXd information = normal(fit).first;
    const double scale = std::max(1.0, fit.off * fit.off / (kUnmodelled * kUnmodelled));
    const Eigen::MatrixXd covariance =
        information.ldlt().solve(Eigen::MatrixXd::Identity(layout_.size(), layout_.size())) * scale;
    fit.stddev_of_zeros =
        covariance.diagonal().segment(layout_.arm_at(), cell_.robot.size()).cwiseMax(0).cwiseSqrt();
    const int frames = layout_.arm_at();
    const Eigen::MatrixXd given_arm = information.topLeftCorner(frames, frames)
                                          .ldlt()
                                          .solve(Eigen::MatrixXd::Identity(frames, frames)) *
                                      scale;
    fit.base_turn_stddev = std::sqrt(std::max(0.0, given_arm.diagonal().segment<3>(3).maxCoeff()));
    for (const auto& [tool, place] : layout_.tools())
      fit.tool_covariance[tool] =
          covariance.block<3, 3>(layout_.tool_at(tool), layout_.tool_at(tool));
  }

 private:
  [[nodiscard]] Vector3 drawn(const std::string& tool) const {
    const auto& X_FT = cell_.tools.at(tool);
    return X_FT ? X_FT->translation() : Vector3(Vector3::Zero());
  }
  /// The squared deviations of the numbers from their priors.
  [[nodiscard]] double strain(const ArmFit& fit) const {
    double sum = 0;
    for (Eigen::Index k = 0; k < fit.arm.size(); ++k) {
      if (layout_.stddev()(k) > 0) sum += std::pow(fit.arm(k) / layout_.stddev()(k), 2);
    }
    for (const auto& [tool, place] : layout_.tools())
      sum += (fit.tools.at(tool).translation() - drawn(tool)).squaredNorm() /
             std::pow(layout_.tool_stddev(place), 2);
    return sum;
  }
  /// Normal matrix and right side of a step.
  [[nodiscard]] std::pair<Eigen::MatrixXd, Eigen::VectorXd> normal(const ArmFit& fit) const {
    const std::vector<double> off = distances(table_, cell_, fit);
    const double limit = std::max(kNearRow, kFarRow * median(off));
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(layout_.size(), layout_.size());
    Eigen::VectorXd b = Eigen::VectorXd::Zero(layout_.size());
    for (std::size_t i = 0; i < table_.size(); ++i) {
      if (off[i] > limit) continue;
      const Prediction prediction(table_, i, cell_, fit);
      const Eigen::Matrix3Xd J =
          prediction.jacobian(layout_, table_.from[i]->context.tool) / kUnmodelled;
      A.selfadjointView<Eigen::Lower>().rankUpdate(J.transpose());
      b += J.transpose() * (table_.position(i) - prediction.position()) / kUnmodelled;
    }
    A = Eigen::MatrixXd(A.selfadjointView<Eigen::Lower>());
    A.diagonal().head(kBaseParameters).array() +=
        1e-2;  // a base that no pose determines does not move
    for (const auto& [tool, place] : layout_.tools()) {
      const double weight = std::pow(layout_.tool_stddev(place), -2);
      const int at = layout_.tool_at(tool);
      A.diagonal().segment(at, 3).array() += weight;
      b.segment<3>(at) -= weight * (fit.tools.at(tool).translation() - drawn(tool));
    }
    add_arm(fit, A, b);
    return {std::move(A), std::move(b)};
  }
  void add_arm(const ArmFit& fit, Eigen::MatrixXd& A, Eigen::VectorXd& b) const {
    for (int k = 0; k < layout_.arm_size(); ++k) {
      const int at = layout_.arm_at() + k;
      const double stddev = layout_.stddev()(k);
      if (whole_arm_ && stddev > 0) {
        A(at, at) += 1 / (stddev * stddev);
        b(at) -= fit.arm(k) / (stddev * stddev);
        continue;
      }
      A.row(at).setZero();
      A.col(at).setZero();
      A(at, at) = 1;
      b(at) = 0;
    }
  }
  [[nodiscard]] std::optional<ArmFit> step_from(const ArmFit& fit) const {
    const auto [A, b] = normal(fit);
    const Eigen::VectorXd scale = A.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::VectorXd step =
        scale.asDiagonal() *
        (scale.asDiagonal() * A * scale.asDiagonal()).ldlt().solve(scale.asDiagonal() * b);
    if (!step.allFinite()) return std::nullopt;
    ArmFit moved = fit;
    moved.X_WB.translation() += step.head<3>();
    moved.X_WB.linear() = rotation_exp(step.segment<3>(3)) * fit.X_WB.linear();
    for (const auto& [tool, place] : layout_.tools())
      moved.tools[tool].translation() += step.segment<3>(layout_.tool_at(tool));
    moved.arm += step.tail(layout_.arm_size());
    return moved;
  }

  const NumberTable& table_;
  const Cell& cell_;
  const Layout layout_;
  const bool whole_arm_;
};

/// The tool points at the nominal joints, in B.
Eigen::Matrix3Xd nominal_points(const NumberTable& table, const Cell& cell,
                                const std::map<std::string, Pose>& tools) {
  Eigen::Matrix3Xd p_B(3, static_cast<Eigen::Index>(table.size()));
  for (std::size_t i = 0; i < table.size(); ++i)
    p_B.col(static_cast<Eigen::Index>(i)) = cell.robot.flange_pose(table.joints(i)) *
                                            tools.at(table.from[i]->context.tool).translation();
  return p_B;
}

/// The base that most rows of `begin` to `end` agree on.
std::optional<Pose> base_from(const Eigen::Matrix3Xd& p_W, const Eigen::Matrix3Xd& p_B,
                              std::size_t begin, std::size_t end) {
  Indices rows(end - begin);
  std::iota(rows.begin(), rows.end(), begin);
  std::optional<Pose> X_WB;
  for (int round = 0; round < kRoundsOfStart && rows.size() >= kFewestRows; ++round) {
    const Result<Pose> found = fit_transform(p_W(Eigen::all, rows), p_B(Eigen::all, rows));
    if (!found) break;
    X_WB = *found;
    const Eigen::VectorXd off = ((*X_WB * p_B) - p_W).colwise().norm();
    rows.resize(static_cast<std::size_t>(p_W.cols()));
    std::iota(rows.begin(), rows.end(), std::size_t{0});
    const auto kept = static_cast<std::size_t>(std::ceil(kKept * static_cast<double>(rows.size())));
    std::nth_element(rows.begin(), rows.begin() + static_cast<std::ptrdiff_t>(kept - 1), rows.end(),
                     [&](std::size_t a, std::size_t b) {
                       return off(static_cast<Eigen::Index>(a)) < off(static_cast<Eigen::Index>(b));
                     });
    rows.resize(kept);
  }
  return X_WB;
}

}  // namespace

ArmFit located(const NumberTable& table, const Cell& cell, ToolPoints points) {
  ArmFit start;
  start.arm = Eigen::VectorXd::Zero(6 * cell.robot.size());
  bool unknown = points == ToolPoints::kAnywhere;
  for (const Measurement* m : table.from) {
    const auto& X_FT = cell.tools.at(m->context.tool);
    start.tools.emplace(m->context.tool, X_FT.value_or(Pose::Identity()));
    unknown = unknown || !X_FT;
  }
  const Eigen::Matrix3Xd p_B = nominal_points(table, cell, start.tools);
  const Fitting fitting(table, cell, points, false);
  const std::size_t n = table.size();
  std::optional<ArmFit> best;
  // All rows, then thirds of them: if a block of rows is wrong, at least one third is likely free
  // of it.
  for (const auto& [begin, end] : {std::pair(std::size_t{0}, n), std::pair(std::size_t{0}, n / 3),
                                   std::pair(n / 3, 2 * n / 3), std::pair(2 * n / 3, n)}) {
    const auto X_WB = base_from(table.p_W, p_B, begin, end);
    if (!X_WB) continue;
    ArmFit fit = start;
    fit.X_WB = *X_WB;
    fitting.assess(fit);
    if (!best || fit.quality < best->quality) best = fit;
  }
  if (!best) {
    start.X_WB = cell.X_WB.value_or(Pose::Identity());
    fitting.assess(start);
    best = start;
  }
  return unknown ? fitting.from(*best, kStepsOfFrames) : *best;
}

ArmFit fitted(const NumberTable& table, const Cell& cell, const ArmFit& start, ToolPoints points) {
  const Fitting fitting(table, cell, points, true);
  ArmFit fit = fitting.from(start, kMostSteps);
  fitting.add_uncertainty(fit);
  return fit;
}

ArmFit fitted_from_all_sides(const NumberTable& table, const Cell& cell, const ArmFit& start) {
  const Vector3 place = table.p_W.rowwise().mean();
  ArmFit best = fitted(table, cell, start);
  std::vector<Pose> bases = {start.X_WB};
  if (cell.X_WB) bases.push_back(*cell.X_WB);
  for (const Pose& X_WB : bases) {
    for (const Matrix3& turn : cube_turns()) {
      ArmFit from = start;
      from.X_WB = turned_about(place, turn, X_WB);
      ArmFit fit = fitted(table, cell, from);
      if (fit.quality < best.quality) best = std::move(fit);
    }
  }
  return best;
}

std::vector<double> distances(const NumberTable& table, const Cell& cell, const ArmFit& fit) {
  std::vector<double> off;
  off.reserve(table.size());
  for (std::size_t i = 0; i < table.size(); ++i)
    off.push_back((table.position(i) - Prediction(table, i, cell, fit).position()).norm());
  return off;
}

Pose flange_pose_W(const NumberTable& table, std::size_t row, const Cell& cell, const ArmFit& fit) {
  return Prediction(table, row, cell, fit).flange();
}

}  // namespace trammel::reading
