#pragma once

#include <optional>

#include "server/base/result.h"
#include "server/robot/cell.h"

/// The test whether the tracker sees the target that the tool carries (source section 6.1.2).
namespace trammel {

/// Angle (rad, 0 to pi) between the target's normal and the line of sight from the target to a
/// tracker at `tracker_W` (m). `X_WT` is the tool's pose, `normal_T` a unit vector. pi where the
/// target stands in the tracker itself.
[[nodiscard]] double visibility_angle(const Pose& X_WT, const Vector3& normal_T,
                                      const Vector3& tracker_W);

/// Which poses the tracker sees. Only the target's aperture limits the view: obstacles are not
/// known.
class Visibility {
 public:
  /// Without a tracker position or an aperture in the cell, everything is visible. With both,
  /// refuses an unknown base or tool, since the line of sight is then unknown.
  [[nodiscard]] static Result<Visibility> of(const Cell& cell, const std::string& tool);

  /// True if the nominal robot at `q` (rad, m) shows its target within the aperture, edge included.
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
