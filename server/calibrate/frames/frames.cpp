#include "server/calibrate/frames/frames.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "server/base/units.h"
#include "server/calibrate/frames/localisation.h"
#include "server/robot/rigid_fit.h"

namespace trammel {

bool has_unknown_tool(const Cell& cell) {
  return std::any_of(cell.tools.begin(), cell.tools.end(), [](const auto& tool) { return !tool.second; });
}

std::vector<std::string> with_unknown_tool(std::vector<std::string> sources, const Cell& cell) {
  if (has_unknown_tool(cell) && corrects(sources, causes::Part::kLinks) && !corrects(sources, causes::Part::kTool))
    sources.emplace_back("tool");
  return sources;
}

Status locate_unknown_frames(PhysicalModel& model, const MeasurementBatch& batch) {
  const Cell& cell = *model.cell;
  bool base_known = cell.X_WB.has_value();
  for (const auto& [tool, known] : cell.tools) {
    std::vector<Pose> X_WT;
    std::vector<Pose> X_BF;
    std::vector<Pose> X_BF_full;
    std::vector<Vector3> points;
    for (const Measurement& m : batch.measurements) {
      if (m.context.tool != tool) continue;
      X_BF.push_back(cell.robot.flange_pose(m.context.q));
      points.push_back(m.p_W);
      if (m.R_WT) {
        X_BF_full.push_back(X_BF.back());
        X_WT.push_back(make_pose(*m.R_WT, m.p_W));
      }
    }
    if (points.empty() || (known && base_known)) continue;
    const Eigen::Matrix3Xd p_W =
        Eigen::Map<const Eigen::Matrix3Xd>(points.front().data(), 3, static_cast<Eigen::Index>(points.size()));
    const bool full = X_WT.size() >= 3 && 2 * X_WT.size() >= points.size();
    if (known) {  // base from this tool
      Eigen::Matrix3Xd p_B(3, p_W.cols());
      for (std::size_t i = 0; i < X_BF.size(); ++i) p_B.col(static_cast<int>(i)) = X_BF[i] * known->translation();
      const Result<Pose> X_WB = fit_transform(p_W, p_B);
      if (!X_WB) return tl::make_unexpected(X_WB.error());
      model.X_WB = *X_WB;
    } else if (base_known) {  // tool from this base
      std::vector<Pose> X_WF;
      for (const Pose& X : full ? X_BF_full : X_BF) X_WF.push_back(model.X_WB * X);
      if (full) {
        const Result<Pose> X_FT = locate_tool(X_WT, X_WF);
        if (!X_FT) return tl::make_unexpected(X_FT.error());
        model.tools[tool] = *X_FT;
      } else {
        const Result<Vector3> point = locate_tool_point(p_W, X_WF);
        if (!point) return tl::make_unexpected(point.error());
        model.tools[tool] = make_pose(Matrix3::Identity(), *point);
      }
    } else {
      Result<BaseAndTool> found = full ? locate_base_and_tool(X_WT, X_BF_full) : locate_base_and_tool_point(p_W, X_BF);
      if (full && !found) {  // too few axes of rotation for the orientations alone; the positions still tell the base
        found = locate_base_and_tool_point(p_W, X_BF);
        if (found) {
          std::vector<Pose> X_WF;
          for (const Pose& X : X_BF_full) X_WF.push_back(found->X_WB * X);
          found->X_FT.linear() = locate_tool(X_WT, X_WF)->linear();
        }
      }
      if (!found) return tl::make_unexpected(found.error());
      model.X_WB = found->X_WB;
      model.tools[tool] = found->X_FT;
    }
    base_known = true;
  }
  return {};
}

Vector6 motion_values(const Pose& X) {
  const Vector3 zyx = X.linear().eulerAngles(2, 1, 0);
  const bool flipped = std::abs(zyx(1)) > kPi / 2;  // the other triple of the same rotation
  Vector6 values;
  values.head<3>() = X.translation();
  values.tail<3>() = flipped ? Vector3(zyx(0) - std::copysign(kPi, zyx(0)), std::copysign(kPi, zyx(1)) - zyx(1),
                                       zyx(2) - std::copysign(kPi, zyx(2)))
                             : zyx;
  return values;
}

void localise_base(PhysicalModel& model, const MeasurementBatch& batch) {
  Eigen::Index first = 0;
  for (const ErrorSourcePtr& source : model.sources) {
    if (source->cause().part == causes::Part::kBase) break;
    first += static_cast<Eigen::Index>(source->parameters().size());
  }
  if (first == model.values.size()) return;
  const auto n = static_cast<Eigen::Index>(batch.measurements.size());
  Eigen::Matrix3Xd measured(3, n);
  Eigen::Matrix3Xd nominal(3, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Measurement& m = batch.measurements[static_cast<std::size_t>(i)];
    measured.col(i) = model.X_WB.inverse() * m.p_W;
    nominal.col(i) = model.X_WB.inverse() * model.nominal_pose_W(m.context).translation();
  }
  const Result<Pose> X_BB = fit_transform(measured, nominal);
  if (!X_BB) return;  // too few points to localise: the nominal base is the start
  model.values.segment<6>(first) = motion_values(*X_BB);
}

}  // namespace trammel
