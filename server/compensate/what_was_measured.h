#pragma once

#include <Eigen/Dense>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/error_sources/physical_model.h"
#include "server/measurement/measurement.h"
#include "server/measurement/resolution.h"

/// The training poses of a model, as far as its stated accuracy rests on them.
namespace trammel {

struct WhatWasMeasured {
  /// Poses at which a joint arrived rising, and falling. The other poses do not say how it arrived.
  struct Approaches {
    int rising = 0, falling = 0;
  };
  int poses = 0;
  std::vector<Approaches> approaches;  ///< of each joint
  std::optional<std::pair<double, double>>
      temperature;  ///< degrees Celsius, least and most; empty: not recorded
  Vector3 lower = Vector3::Zero(),
          upper = Vector3::Zero();  ///< corners of a box in B that the tool was in, m
  double volume = 0;  ///< m³: the part of the box within `reach` of a place where the tool was
  Eigen::Matrix3Xd flange_B;  ///< places of the nominal flange, m
  /// m: a pose whose flange is farther than this from all places is in another region of the robot.
  /// Empty if only one joint vector was measured, since that gives no distance.
  std::optional<double> reach;
  /// m: the extent of the places in 16 horizontal directions, x of B first, and a little farther. A
  /// pose beyond is outside the outline seen from above. The outline is needed because with few
  /// places their reach alone extends to the robot's other side. Empty without a reach, and in
  /// older models.
  Eigen::VectorXd outline;
  std::optional<double> stated;  ///< m: median sigma of the positions; empty: no row has its own
  std::optional<Rounding> rounding;  ///< resolution of the measured numbers, if it is coarse
  /// Joints with angles that are whole multiples of a step, and the effect of that rounding on the
  /// tool.
  struct JointRounding {
    double step = 0;    ///< rad
    double stddev = 0;  ///< m, of one axis
  };
  std::optional<JointRounding> joint_rounding;
  /// The doubt of the robot file by the same rows, in words, if the model identifies no geometry
  /// that would show it. A bias learns a wrong length as it learns everything else.
  std::optional<std::string> off_drawing;
  bool one_place = false;  ///< of each tool: is_each_tool_at_one_place()
  static constexpr int kDirections = 16;

  /// True if the nominal flange at `q` is within reach of a place where it was measured, and inside
  /// their outline.
  [[nodiscard]] bool is_near(const Chain& robot, const JointVector& q) const;
  /// False if a joint came to nearly all poses from one side, and `context` says the other one.
  /// The play of its gear was not measured, so it may be there.
  [[nodiscard]] bool is_side_measured(const PoseContext& context) const;
  /// The share of a joint's range by which other poses of the same kind exceed these: a twentieth,
  /// more if they are few.
  [[nodiscard]] double range_margin() const;
};

/// The record of the poses of `batch`; `physics` gives their tools. `reach` follows from the
/// distances between the poses: 1.5 times the distance within which 95 % of them have a neighbour,
/// more if they are few, and at least a twentieth of the region. The outline goes beyond the places
/// by the median distance between neighbours. Away from the base it goes farther where the
/// outermost places are sparse, but never towards the far side. Rows at one joint vector are one
/// place, which is no neighbour of itself.
[[nodiscard]] WhatWasMeasured what_was_measured(const PhysicalModel& physics,
                                                const MeasurementBatch& batch);

/// Adds the statements of `batch`'s file on its numbers, and their resolution.
void add_what_is_stated(const PhysicalModel& physics, const MeasurementBatch& batch,
                        WhatWasMeasured& measured);

/// WhatWasMeasured in words for people, in separate parts. Without a record the parts are `not on
/// record`.
struct MeasuredWords {
  std::string sides;        ///< `every joint from both sides`
  std::string temperature;  ///< `20.0 to 23.5 degrees Celsius`
  std::string volume;       ///< `x 600 to 1200, y ... mm of the tool from the robot's base, ...`
  std::string instrument;   ///< `laser tracker 17, 0.015 mm (1 sigma, per axis) as stated`
};
[[nodiscard]] MeasuredWords words_of(const std::optional<WhatWasMeasured>& measured,
                                     const Cell& cell);
/// All parts: `80 training poses; sides of approach: every joint from both sides; ...`
[[nodiscard]] std::string in_words(const std::optional<WhatWasMeasured>& measured,
                                   const Cell& cell);

/// `from above`, `from above in joints 1 2, from below in joint 3`: of joints that came to nearly
/// all poses from one side. Empty where there is none.
[[nodiscard]] std::string one_sided(const std::optional<WhatWasMeasured>& measured);

}  // namespace trammel
