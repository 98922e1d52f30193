#pragma once

#include <string>
#include <vector>

#include "server/base/units.h"
#include "server/measurement/measurement.h"
#include "server/robot/chain.h"

/// The possible meanings of measured orientations.
namespace trammel::orientations {

using Quaternion = Eigen::Quaterniond;
using Quaternions = std::vector<Quaternion>;

constexpr double kMostOff = from_deg(10);  // no nominal arm and no mounted tool deviates more

/// The measured orientations of one tool.
struct Oriented {
  std::string tool;
  std::vector<const Measurement*> rows;
  std::vector<Pose> X_BF;
};

/// One possible meaning of the numbers.
struct Reading {
  std::string name;  ///< after "read "
  Quaternions q_FT;  ///< R_BF' R_WB' R_WT of each pose
  bool by_order =
      true;  ///< the same numbers in another order: a few tenths of a degree decide, row by row
  std::string remedy;        ///< the correct entry for the file; empty: nothing is certain
  Quaternions or_else = {};  ///< the possible correct value of each pose; empty: none

  [[nodiscard]] const Quaternions& second() const { return or_else.empty() ? q_FT : or_else; }
};

/// The orientations as given come first, then their other possible meanings, with the base turned
/// by `q_WB`.
[[nodiscard]] std::vector<Reading> readings(const Oriented& group, const Quaternion& q_WB,
                                            const Chain& robot);

[[nodiscard]] inline double angle(const Quaternion& a, const Quaternion& b) {
  return a.angularDistance(b);
}
[[nodiscard]] std::vector<double> angles(const Quaternions& q_FT, const Quaternion& about);
/// The angle of every pose from `about`, under the one of two readings that is nearer.
[[nodiscard]] std::vector<double> nearer(const Quaternions& one, const Quaternions& other,
                                         const Quaternion& about);
/// The rotation that most poses have in common, each under the nearer of two readings. First it
/// takes the best rotation of a single pose, then the mean of the poses near it.
[[nodiscard]] Quaternion common(const Quaternions& one, const Quaternions& other);

}  // namespace trammel::orientations
