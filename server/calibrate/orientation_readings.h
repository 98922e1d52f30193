#pragma once

#include <string>
#include <vector>

#include "server/base/units.h"
#include "server/measurement/measurement.h"
#include "server/robot/chain.h"

/// The ways in which measured orientations may have been meant.
namespace trammel::orientations {

using Quaternion = Eigen::Quaterniond;
using Quaternions = std::vector<Quaternion>;

constexpr double kMostOff = from_deg(10);  // no nominal arm, and no mounted tool, is farther off

/// The measured orientations of one tool.
struct Oriented {
  std::string tool;
  std::vector<const Measurement*> rows;
  std::vector<Pose> X_BF;
};

/// One way in which the numbers may have been meant.
struct Reading {
  std::string name;  ///< after "read "
  Quaternions q_FT;  ///< R_BF' R_WB' R_WT of each pose
  bool by_order =
      true;  ///< the same numbers in another order: a few tenths of a degree decide, and row by row
  std::string remedy;        ///< what to write in the file; empty: nothing that holds for certain
  Quaternions or_else = {};  ///< what each pose may be instead; empty: nothing

  [[nodiscard]] const Quaternions& second() const { return or_else.empty() ? q_FT : or_else; }
};

/// The orientations as given first, then as they may have been meant instead: the base turned by
/// `q_WB`.
[[nodiscard]] std::vector<Reading> readings(const Oriented& group, const Quaternion& q_WB,
                                            const Chain& robot);

[[nodiscard]] inline double angle(const Quaternion& a, const Quaternion& b) {
  return a.angularDistance(b);
}
[[nodiscard]] std::vector<double> angles(const Quaternions& q_FT, const Quaternion& about);
/// Angle of every pose from `about`, by that of two readings which brings it nearer.
[[nodiscard]] std::vector<double> nearer(const Quaternions& one, const Quaternions& other,
                                         const Quaternion& about);
/// The rotation that most poses have in common, each by the nearer of two readings. First the best
/// of those of single poses, then the mean of the poses near it.
[[nodiscard]] Quaternion common(const Quaternions& one, const Quaternions& other);

}  // namespace trammel::orientations
