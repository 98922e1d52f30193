#pragma once

#include <optional>

#include "server/base/result.h"
#include "server/robot/cell.h"

/// Whether the tracker sees the target that the tool carries (source section 6.1.2).
namespace trammel {

/// Angle (rad, 0 to pi) between the target's normal and the line of sight from the target to a tracker at `tracker_W`
/// (m). `X_WT` is the tool's pose, `normal_T` a unit vector. pi where the target stands in the tracker itself.
[[nodiscard]] double visibility_angle(const Pose& X_WT, const Vector3& normal_T, const Vector3& tracker_W);

/// What limits the view in a cell. Only the target's own aperture counts: what stands in the way is not known.
class Visibility {
 public:
  /// Everything is visible where the cell gives no tracker position or no aperture. Refuses an unknown base or tool
  /// where it gives both: the line of sight cannot be told.
  [[nodiscard]] static Result<Visibility> of(const Cell& cell, const std::string& tool);

  /// True when the nominal robot at `q` (rad, m) shows its target within the aperture, its edge included.
  [[nodiscard]] bool sees(const JointVector& q) const;

 private:
  struct View {
    Pose X_WB, X_FT;
    Vector3 normal_T, tracker_W;
    double aperture;
  };
  explicit Visibility(const Cell& cell) : robot_(cell.robot) {}

  Chain robot_;
  std::optional<View> view_;
};

}  // namespace trammel
