#include "server/plan/visibility.h"

#include <cmath>

#include "server/base/units.h"

namespace trammel {

double visibility_angle(const Pose& X_WT, const Vector3& normal_T, const Vector3& tracker_W) {
  const Vector3 sight_W = tracker_W - X_WT.translation();
  if (sight_W.norm() == 0) return kPi;
  const Vector3 normal_W = X_WT.linear() * normal_T;
  return std::atan2(normal_W.cross(sight_W).norm(), normal_W.dot(sight_W));
}

Result<Visibility> Visibility::of(const Cell& cell, const std::string& tool) {
  Visibility visibility(cell);
  if (!cell.tracker.p_W || !cell.tracker.aperture) return visibility;
  const std::optional<Pose>& X_FT = cell.tools.at(tool);
  if (!cell.X_WB || !X_FT) {
    return refused(
               "cell {}: tracker: aperture_deg limits what is seen, but the pose of {} is unknown",
               cell.name, cell.X_WB ? "tool " + tool : "the base")
        .of(cell.X_WB ? "tools" : "base")
        .next("give it in the cell file, or leave aperture_deg out");
  }
  visibility.view_ = View{*cell.X_WB, *X_FT, cell.tracker.target_normal_T, *cell.tracker.p_W,
                          *cell.tracker.aperture};
  return visibility;
}

bool Visibility::sees(const JointVector& q) const {
  if (!view_) return true;
  const Pose X_WT = view_->X_WB * robot_.flange_pose(q) * view_->X_FT;
  return visibility_angle(X_WT, view_->normal_T, view_->tracker_W) <= view_->aperture;
}

}  // namespace trammel
