#include "server/robot/cell_doubts.h"

#include <cmath>

#include "server/base/units.h"

namespace trammel {

namespace {

const double kUpright = std::cos(from_deg(1));  // a base within 1 degree of upright counts as
                                                // installed upright
const double kTilted = std::cos(from_deg(5));
constexpr double kShort = 2e-3;  // m: an offset shorter than this looks like metres written where
                                 // mm belong
constexpr double kParallel = 1e-3;

void doubt_gravity(const Cell& cell, std::vector<CellDoubt>& doubts) {
  const bool up = cell.gravity_W.z() > 0.7;
  const bool standing = !cell.X_WB || cell.X_WB->linear().col(2).z() > 0.7;
  if (!up || !standing) return;
  doubts.push_back(
      {"gravity_up",
       fmt::format("gravity [{:g}, {:g}, {:g}] points up, and the robot's base stands upright: "
                   "gravity is the direction in which things fall, [0, 0, -1] in most cells",
                   cell.gravity_W.x(), cell.gravity_W.y(), cell.gravity_W.z())});
}

/// The rotation whose quaternion was written in the order x, y, z, w.
Matrix3 reordered(const Matrix3& R) {
  const Eigen::Quaterniond q(R);
  return Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()).toRotationMatrix();
}

void doubt_order(const Cell& cell, std::vector<CellDoubt>& doubts) {
  const auto half_turn = [](const Matrix3& R) {
    return std::abs(Eigen::Quaterniond(R).z()) > 1 - 1e-9;
  };
  const auto add = [&](const std::string& key, const char* seen) {
    doubts.push_back(
        {"quaternion_order",
         fmt::format("{}: q_wxyz {}: is it written in the order x, y, z, w? w stands first", key,
                     seen)});
  };
  if (cell.X_WB) {
    const Vector3 up = -cell.gravity_W;
    const Matrix3 R = cell.X_WB->linear(), other = reordered(R);
    const double as_read = std::abs(R.col(2).dot(up)), as_reordered = other.col(2).dot(up);
    if (half_turn(R)) add("base", "turns the base by 180 degrees about z");
    if (as_read < kTilted && as_reordered > kUpright)
      add("base", "lays the base on its side, and the other order puts it upright");
  }
  for (const auto& [name, X_FT] : cell.tools)
    if (X_FT && half_turn(X_FT->linear()))
      add("tools: " + name, "turns the tool by 180 degrees about z");
}

void doubt_lengths(const Cell& cell, std::vector<CellDoubt>& doubts) {
  const auto look = [&](const std::string& key, const Vector3& p) {
    if (p.norm() == 0 || p.norm() >= kShort) return;
    doubts.push_back(
        {"lengths_in_metres",
         fmt::format("{} [{:g}, {:g}, {:g}] is less than {:g} mm: is it in metres? write it in mm",
                     key, to_mm(p.x()), to_mm(p.y()), to_mm(p.z()), to_mm(kShort))});
  };
  if (cell.X_WB) look("base: xyz_mm", cell.X_WB->translation());
  for (const auto& [name, X_FT] : cell.tools)
    if (X_FT) look("tools: " + name + ": xyz_mm", X_FT->translation());
  for (const auto& [name, payload] : cell.payloads)
    look("payloads: " + name + ": cog_mm", payload.p_FoCog_F);
}

void doubt_parallel(const Chain& robot, std::vector<CellDoubt>& doubts) {
  for (const int j : rows_without_hayati(robot)) {
    doubts.push_back(
        {"hayati_missing",
         fmt::format(
             "the axes of joints {} and {} are parallel, and joint {} of the robot file has no "
             "`hayati: true`: no number of the model is the tilt of the one axis against the "
             "other, so that it is taken for something else, and no measurement tells d of one "
             "from d of the other; write `hayati: true` there, its d in the row behind it",
             j + 1, j + 2, j + 1),
         true});
  }
}

}  // namespace

std::vector<int> rows_without_hayati(const Chain& robot) {
  std::vector<int> rows;
  for (int j = 0; j + 1 < robot.size(); ++j) {
    const Joint &one = robot.joint(j), &next = robot.joint(j + 1);
    const bool turn = one.type == JointType::kRevolute && next.type == JointType::kRevolute;
    if (!one.hayati && turn && std::abs(std::sin(one.link.alpha)) < kParallel) rows.push_back(j);
  }
  return rows;
}

std::vector<CellDoubt> doubts_of(const Cell& cell) {
  std::vector<CellDoubt> doubts;
  doubt_gravity(cell, doubts);
  doubt_order(cell, doubts);
  doubt_lengths(cell, doubts);
  doubt_parallel(cell.robot, doubts);
  return doubts;
}

}  // namespace trammel
