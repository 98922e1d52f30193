#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tests/support/hidden_poses.h"

namespace trammel::hidden {

/// A hidden cause, in the words of its name.
struct HiddenCause {
  std::string cause;      ///< `gear_transmission`; `unknown` for a function that no cause makes
  int joint = 0;          ///< 1-based; 0 where it concerns the whole arm
  std::string parameter;  ///< `C3`, `a2`
  int first = -1;         ///< the first row of the effect, or the outlier; -1 elsewhere
  std::vector<std::string> depends_on;  ///< of `unknown`: `q4`
  double order = 0;                     ///< of a gear, cycles a turn; 0: drawn
};
[[nodiscard]] std::string to_string(const HiddenCause& cause);

/// The arm and its surroundings at one pose, while effects act on them.
struct Moment {
  Arm arm;
  Joints q = Joints::Zero();
  Eigen::Matrix4d seen = Eigen::Matrix4d::Identity();  ///< motion of all that the tracker sees
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();     ///< mm, of the reading alone
};

/// One effect: its action for given numbers. Shapes differ a little from those of the calibration.
struct Effect {
  HiddenCause cause;
  std::vector<std::string> names;  ///< of the values
  Eigen::VectorXd values;
  std::vector<bool> grows;  ///< true for values that give the effect's size and are zero without it
  std::function<void(const MeasuringPose&, const Eigen::VectorXd&, Moment&)> act;
};

/// The properties of the scene that effects need.
struct Scene {
  Arm arm;  ///< true, with the first tool and load
  const std::vector<MeasuringPose>* poses = nullptr;
  int tools = 1;
  int loads = 1;
  bool load_widens_play = true;
};

/// Every cause that can be hidden.
[[nodiscard]] const std::vector<std::string>& hideable_causes();
/// `cause` with its joint, pose and parameter drawn.
[[nodiscard]] HiddenCause draw_cause(const std::string& cause, const Scene& scene, Random& random);
/// `cause` with its numbers and shape drawn, of a size as robots show it.
[[nodiscard]] Effect draw_effect(const HiddenCause& cause, const Scene& scene, Random& random);
/// A slow change with time: the zero of a joint (`slow_zero`; `slow_walk`: at random), the place of
/// the tracker (`slow_stand`) or the lengths of all links (`slow_growth`).
[[nodiscard]] Effect draw_slow_effect(const std::string& kind, const Scene& scene, Random& random);
/// An effect of another form than any cause, and near to some: a joint error that is a wave of two
/// joints (`foreign_wave`), a floor with a seam (`foreign_seam`), a cracked link (`foreign_crack`),
/// a spindle in a soft mount (`foreign_mount`), zeros that all walk at random (`foreign_walks`), a
/// load that changes at about every third pose (`foreign_loads`).
[[nodiscard]] Effect draw_foreign_effect(const std::string& kind, const Scene& scene,
                                         Random& random);

}  // namespace trammel::hidden
