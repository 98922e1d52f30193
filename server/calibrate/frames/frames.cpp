#include "server/calibrate/frames/frames.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "server/base/units.h"
#include "server/calibrate/frames/localisation.h"
#include "server/measurement/gauges.h"
#include "server/measurement/one_place.h"
#include "server/robot/cube_turns.h"
#include "server/robot/rigid_fit.h"

namespace trammel {

namespace {

constexpr double kClearlyBetter = 0.5;  // of the misfit
constexpr double kTurnUntold =
    0.2;  // share of the spread of the nominal points; a larger misfit would decide the turn

}  // namespace

bool has_unknown_tool(const Cell& cell) {
  return std::any_of(cell.tools.begin(), cell.tools.end(),
                     [](const auto& tool) { return !tool.second; });
}

std::vector<std::string> with_unknown_tool(std::vector<std::string> sources, const Cell& cell) {
  if (has_unknown_tool(cell) && corrects(sources, causes::Part::kLinks) &&
      !corrects(sources, causes::Part::kTool))
    sources.emplace_back(cause_correcting(causes::Part::kTool).spelling);
  return sources;
}

namespace {

/// The measured poses of one tool, and where the nominal flange was.
struct ToolPoses {
  std::vector<Vector3> points_W;
  std::vector<Pose> X_BF;
  std::vector<Pose> oriented_X_WT, oriented_X_BF;  ///< of the poses with an orientation

  [[nodiscard]] Eigen::Matrix3Xd p_W() const {
    return Eigen::Map<const Eigen::Matrix3Xd>(points_W.front().data(), 3,
                                              static_cast<Eigen::Index>(points_W.size()));
  }
  /// True if orientations are used: three at least, and of half the poses.
  [[nodiscard]] bool full() const {
    return oriented_X_WT.size() >= 3 && 2 * oriented_X_WT.size() >= points_W.size();
  }
};

ToolPoses poses_of(const std::string& tool, const MeasurementBatch& batch, const Chain& robot) {
  ToolPoses poses;
  for (const Measurement& m : batch.measurements) {
    if (m.gauge || m.context.tool != tool) continue;
    poses.X_BF.push_back(robot.flange_pose(m.context.q));
    poses.points_W.push_back(m.p_W);
    if (!m.R_WT) continue;
    poses.oriented_X_BF.push_back(poses.X_BF.back());
    poses.oriented_X_WT.push_back(make_pose(*m.R_WT, m.p_W));
  }
  return poses;
}

std::vector<Pose> in_world(const Pose& X_WB, const std::vector<Pose>& X_BF) {
  std::vector<Pose> X_WF;
  for (const Pose& X : X_BF) X_WF.push_back(X_WB * X);
  return X_WF;
}

/// The base from a tool that is known.
Status locate_base(const ToolPoses& poses, const Pose& X_FT, PhysicalModel& model) {
  Eigen::Matrix3Xd p_B(3, static_cast<Eigen::Index>(poses.X_BF.size()));
  for (std::size_t i = 0; i < poses.X_BF.size(); ++i)
    p_B.col(static_cast<int>(i)) = poses.X_BF[i] * X_FT.translation();
  const Pose X_WB = TRY(fit_transform(poses.p_W(), p_B));
  model.X_WB = X_WB;
  return {};
}

/// The tool from a base that is known.
Status locate_tool_at(const ToolPoses& poses, Pose& X_FT, const PhysicalModel& model) {
  if (poses.full()) {
    const Pose found =
        TRY(locate_tool(poses.oriented_X_WT, in_world(model.X_WB, poses.oriented_X_BF)));
    X_FT = found;
    return {};
  }
  const Vector3 point = TRY(locate_tool_point(poses.p_W(), in_world(model.X_WB, poses.X_BF)));
  X_FT = make_pose(Matrix3::Identity(), point);
  return {};
}

/// Locates base and tool together. If the orientations turn about too few axes, the positions alone
/// determine the base.
Result<BaseAndTool> locate_both(const ToolPoses& poses) {
  Result<BaseAndTool> found = poses.full()
                                  ? locate_base_and_tool(poses.oriented_X_WT, poses.oriented_X_BF)
                                  : locate_base_and_tool_point(poses.p_W(), poses.X_BF);
  if (found || !poses.full()) return found;
  found = locate_base_and_tool_point(poses.p_W(), poses.X_BF);
  if (found)
    found->X_FT.linear() =
        locate_tool(poses.oriented_X_WT, in_world(found->X_WB, poses.oriented_X_BF))->linear();
  return found;
}

/// m: rms residual of the positions with the tool at `X_FT` and the base fitted to them.
double misfit(const ToolPoses& poses, const Pose& X_FT) {
  const Eigen::Matrix3Xd p_W = poses.p_W();
  Eigen::Matrix3Xd p_B(3, p_W.cols());
  for (std::size_t i = 0; i < poses.X_BF.size(); ++i)
    p_B.col(static_cast<Eigen::Index>(i)) = poses.X_BF[i] * X_FT.translation();
  const Result<Pose> X_WB = fit_transform(p_W, p_B);
  if (!X_WB) return 0;
  double square = 0;
  for (Eigen::Index i = 0; i < p_W.cols(); ++i)
    square += (p_W.col(i) - *X_WB * p_B.col(i)).squaredNorm();
  return std::sqrt(square / static_cast<double>(p_W.cols()));
}

/// Locates the tool for a base that the cell knows and that is to be identified. The instrument may
/// be displaced by more than a tool could absorb. Then base and tool are located together, and the
/// tool is kept.
Status locate_tool_near(const ToolPoses& poses, Pose& X_FT, const PhysicalModel& model) {
  const Status located = locate_tool_at(poses, X_FT, model);
  const Result<BaseAndTool> both = locate_both(poses);
  if (both && (!located || misfit(poses, both->X_FT) < kClearlyBetter * misfit(poses, X_FT))) {
    X_FT = both->X_FT;
    return {};
  }
  return located;
}

bool has_base(const PhysicalModel& model) {
  return std::any_of(model.sources.begin(), model.sources.end(), [](const ErrorSourcePtr& source) {
    return source->cause().part == causes::Part::kBase;
  });
}

}  // namespace

Status locate_unknown_frames(PhysicalModel& model, const MeasurementBatch& batch) {
  const Cell& cell = *model.cell;
  bool base_known = cell.X_WB.has_value();
  for (const auto& [tool, known] : cell.tools) {
    const ToolPoses poses = poses_of(tool, batch, cell.robot);
    if (poses.points_W.empty() || (known && base_known)) continue;
    if (known) {
      TRY(locate_base(poses, *known, model));
    } else if (base_known) {
      const auto locate = has_base(model) ? locate_tool_near : locate_tool_at;
      TRY(locate(poses, model.tools[tool], model));
    } else {
      const BaseAndTool found = TRY(locate_both(poses));
      model.X_WB = found.X_WB;
      model.tools[tool] = found.X_FT;
    }
    base_known = true;
  }
  return {};
}

Vector6 motion_values(const Pose& X) {
  Vector6 values;
  values << X.translation(), zyx_angles(X.linear());
  return values;
}

namespace {

Eigen::Matrix3Xd beside_centroid(const Eigen::Matrix3Xd& points) {
  return points.colwise() - points.rowwise().mean();
}

Eigen::Matrix3Xd measured_points(const MeasurementBatch& batch) {
  const MeasurementBatch placed = positions_of(batch);
  Eigen::Matrix3Xd p_W(3, static_cast<Eigen::Index>(placed.measurements.size()));
  for (Eigen::Index i = 0; i < p_W.cols(); ++i)
    p_W.col(i) = placed.measurements[static_cast<std::size_t>(i)].p_W;
  return p_W;
}

/// The motion that takes `nominal` onto `measured`. It is a pure shift where the misfit is as large
/// as the spread of the points.
Result<Pose> motion_between(const Eigen::Matrix3Xd& measured, const Eigen::Matrix3Xd& nominal) {
  Result<Pose> motion = fit_transform(measured, nominal);
  if (!motion ||
      (measured - *motion * nominal).norm() < kTurnUntold * beside_centroid(nominal).norm())
    return motion;
  return make_pose(Matrix3::Identity(), measured.rowwise().mean() - nominal.rowwise().mean());
}

}  // namespace

std::vector<Pose> likely_bases(const PhysicalModel& model, const MeasurementBatch& batch) {
  const Eigen::Matrix3Xd p_W = measured_points(batch);
  if (model.cell->X_WB || !are_at_one_place(p_W)) return {model.X_WB};
  std::vector<Pose> bases;
  for (const Matrix3& turn : cube_turns())
    bases.push_back(turned_about(p_W.rowwise().mean(), turn, model.X_WB));
  return bases;
}

std::string untold_turn(const Cell& cell, const MeasurementBatch& batch) {
  const Eigen::Matrix3Xd p_W = measured_points(batch);
  if (cell.X_WB || !are_at_one_place(p_W)) return "";
  return fmt::format(
      "the positions lie within {:.2f} mm rms of one place, and hardly tell how the base is "
      "turned: an error of the arm of 0.1 mm turns it by {:.2g} deg; give the base in the cell "
      "file, or measure at other places, too",
      to_mm(spread_of(p_W)), to_deg(1e-4 / std::max(spread_of(p_W), 1e-4)));
}

std::vector<std::string> turn_of_base() {
  std::vector<std::string> names;
  for (const auto& figure : cause_correcting(causes::Part::kBase).figures)
    if (std::string_view(figure.unit) == "rad") names.emplace_back(figure.name);
  return names;
}

void localise_base(PhysicalModel& model, const MeasurementBatch& batch) {
  Eigen::Index first = 0;
  for (const ErrorSourcePtr& source : model.sources) {
    if (source->cause().part == causes::Part::kBase) break;
    first += static_cast<Eigen::Index>(source->parameters().size());
  }
  if (first == model.values.size()) return;
  std::vector<const Measurement*> placed;
  for (const Measurement& m : batch.measurements) {
    if (!m.gauge) placed.push_back(&m);
  }
  const auto n = static_cast<Eigen::Index>(placed.size());
  Eigen::Matrix3Xd measured(3, n);
  Eigen::Matrix3Xd nominal(3, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Measurement& m = *placed[static_cast<std::size_t>(i)];
    measured.col(i) = model.X_WB.inverse() * m.p_W;
    nominal.col(i) = model.X_WB.inverse() * model.nominal_pose_W(m.context).translation();
  }
  const Result<Pose> X_BB = motion_between(measured, nominal);
  if (!X_BB) return;  // too few points to localise: the nominal base is the start
  model.values.segment<6>(first) = motion_values(*X_BB);
}

}  // namespace trammel
