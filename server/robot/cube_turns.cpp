#include "server/robot/cube_turns.h"

#include <algorithm>
#include <array>

namespace trammel {

namespace {

/// Each permutation of the axes, with the signs that make a rotation.
std::vector<Matrix3> all_turns() {
  std::vector<Matrix3> turns;
  std::array<int, 3> axis = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Matrix3 R = Matrix3::Zero();
      for (int k = 0; k < 3; ++k)
        R(axis[static_cast<std::size_t>(k)], k) = (signs >> k & 1) != 0 ? -1 : 1;
      if (R.determinant() > 0) turns.push_back(R);
    }
  } while (std::next_permutation(axis.begin(), axis.end()));
  return turns;
}

}  // namespace

const std::vector<Matrix3>& cube_turns() {
  static const std::vector<Matrix3> turns = all_turns();
  return turns;
}

Pose turned_about(const Vector3& p_A, const Matrix3& turn, const Pose& X_AB) {
  return make_pose(turn * X_AB.linear(), p_A + turn * (X_AB.translation() - p_A));
}

}  // namespace trammel
