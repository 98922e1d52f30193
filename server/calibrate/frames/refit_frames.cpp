#include "server/calibrate/frames/refit_frames.h"

#include <map>

#include "server/calibrate/frames/frames.h"
#include "server/calibrate/frames/localisation.h"
#include "server/robot/rigid_fit.h"

namespace trammel {

namespace {

/// The flange poses by the former arm, and the measurements with one tool.
struct FlangeAndPoints {
  std::vector<Pose> X_BF, oriented_X_BF, oriented_X_WT;
  std::vector<Vector3> points;
  Pose X_FT = Pose::Identity();  ///< the assumed place of the tool

  [[nodiscard]] Eigen::Matrix3Xd p_W() const {
    return Eigen::Map<const Eigen::Matrix3Xd>(points.front().data(), 3,
                                              static_cast<Eigen::Index>(points.size()));
  }
  [[nodiscard]] bool full() const {
    return oriented_X_WT.size() >= 3 && 2 * oriented_X_WT.size() >= points.size();
  }
};

std::map<std::string, FlangeAndPoints> poses_by_tool(const PhysicalModel& before,
                                                     const MeasurementBatch& batch) {
  std::map<std::string, FlangeAndPoints> tools;
  for (const Measurement& m : batch.measurements) {
    const ArmState arm = before.state(m.context);
    FlangeAndPoints& poses = tools[m.context.tool];
    poses.X_FT = arm.X_FT;
    poses.X_BF.push_back(arm.X_WB.inverse() * before.pose_W(m.context) * arm.X_FT.inverse());
    poses.points.push_back(m.p_W);
    if (!m.R_WT) continue;
    poses.oriented_X_BF.push_back(poses.X_BF.back());
    poses.oriented_X_WT.push_back(make_pose(*m.R_WT, m.p_W));
  }
  return tools;
}

/// The base by known tools: from positions or, if these do not span a plane, from orientations.
Result<Pose> base_under(const std::vector<const FlangeAndPoints*>& tools) {
  std::vector<Vector3> measured, expected;
  Matrix3 turn = Matrix3::Zero();
  for (const FlangeAndPoints* tool : tools) {
    for (std::size_t i = 0; i < tool->points.size(); ++i) {
      measured.push_back(tool->points[i]);
      expected.push_back(tool->X_BF[i] * tool->X_FT.translation());
    }
    for (std::size_t i = 0; i < tool->oriented_X_WT.size(); ++i) {
      turn += tool->oriented_X_WT[i].linear() *
              (tool->oriented_X_BF[i] * tool->X_FT).linear().transpose();
    }
  }
  const auto n = static_cast<Eigen::Index>(measured.size());
  const Eigen::Map<const Eigen::Matrix3Xd> p_W(measured.front().data(), 3, n),
      p_B(expected.front().data(), 3, n);
  Result<Pose> fitted = fit_transform(p_W, p_B);
  if (fitted || turn.isZero()) return fitted;
  const Matrix3 R_WB = nearest_rotation(turn);
  return make_pose(R_WB, p_W.rowwise().mean() - R_WB * p_B.rowwise().mean());
}

/// Base and tool at once, from the poses of one unknown tool.
Result<BaseAndTool> base_and_tool(const FlangeAndPoints& tool) {
  Result<BaseAndTool> found = tool.full()
                                  ? locate_base_and_tool(tool.oriented_X_WT, tool.oriented_X_BF)
                                  : locate_base_and_tool_point(tool.p_W(), tool.X_BF);
  if (found || !tool.full()) return found;
  // Too few axes of rotation for the orientations alone; the positions still tell the base.
  found = locate_base_and_tool_point(tool.p_W(), tool.X_BF);
  if (!found) return found;
  std::vector<Pose> X_WF;
  for (const Pose& X : tool.oriented_X_BF) X_WF.push_back(found->X_WB * X);
  found->X_FT.linear() = locate_tool(tool.oriented_X_WT, X_WF)->linear();
  return found;
}

/// The tool from a base that is known; without orientations its rotation stays as it was.
Result<Pose> tool_on(const Pose& X_WB, const FlangeAndPoints& tool) {
  std::vector<Pose> X_WF;
  for (const Pose& X : tool.full() ? tool.oriented_X_BF : tool.X_BF) X_WF.push_back(X_WB * X);
  if (tool.full()) return locate_tool(tool.oriented_X_WT, X_WF);
  return locate_tool_point(tool.p_W(), X_WF).map([&](const Vector3& p_FT) {
    return make_pose(tool.X_FT.linear(), p_FT);
  });
}

/// Places the model's base at `X_WB`. The nominal frame changes if the cell calls the base unknown,
/// else the source.
void place_base(PhysicalModel& model, const Pose& X_WB) {
  Eigen::Index first = 0;
  for (const ErrorSourcePtr& source : model.sources) {
    if (source->cause().part == causes::Part::kBase) break;
    first += static_cast<Eigen::Index>(source->parameters().size());
  }
  model.X_WB = model.cell->X_WB.value_or(X_WB);
  model.values.segment<6>(first) = motion_values(model.X_WB.inverse() * X_WB);
}

Error with_advice(Error error) {
  error.message +=
      "; base and tool are both to be found: name the base alone where the tool is as it was";
  return error;
}

}  // namespace

Status locate_refitted_frames(const PhysicalModel& before, const MeasurementBatch& batch, bool base,
                              bool tool, PhysicalModel& model) {
  if (!base && !tool) return {};
  std::map<std::string, FlangeAndPoints> tools = poses_by_tool(before, batch);
  const Cell& cell = *model.cell;
  const auto to_find = [&](const std::string& name) { return tool && !cell.tools.at(name); };
  Pose X_WB = before.state(batch.measurements.front().context).X_WB;
  std::vector<const FlangeAndPoints*> known;
  for (auto& [name, poses] : tools) {
    if (to_find(name)) continue;
    if (tool) poses.X_FT = *cell.tools.at(name);
    known.push_back(&poses);
  }
  std::string found_with_base;
  if (base && !known.empty()) {
    const Pose found = TRY(base_under(known));
    X_WB = found;
  } else if (base) {
    const Result<BaseAndTool> found = base_and_tool(tools.begin()->second);
    if (!found) return tl::make_unexpected(with_advice(found.error()));
    X_WB = found->X_WB;
    found_with_base = tools.begin()->first;
    model.tools[found_with_base] = found->X_FT;
  }
  for (const auto& [name, poses] : tools) {
    if (!to_find(name) || name == found_with_base) continue;
    const Pose X_FT = TRY(tool_on(X_WB, poses));
    model.tools[name] = X_FT;
  }
  if (base) place_base(model, X_WB);
  return {};
}

}  // namespace trammel
