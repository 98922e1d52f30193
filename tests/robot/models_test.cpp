#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <optional>
#include <random>
#include <set>

#include "server/base/units.h"
#include "server/robot/cell.h"
#include "server/robot/inverse_kinematics.h"

// The shipped_models robots against their makers' drawings, told another way than by
// Denavit-Hartenberg rows: each axis as the drawing shows it with all joints at zero, the flange
// there, and the reach.

namespace trammel {
namespace {

/// A line that a joint turns about (or slides along), in B with all joints at zero, in the
/// controller's sense; mm.
struct Axis {
  Vector3 direction;
  Vector3 point_mm = Vector3::Zero();
  JointType type = JointType::kRevolute;
};

struct Drawing {
  std::string file;
  std::vector<Axis> axes;
  Vector3 flange_mm;  ///< at zero
  Vector3 flange_x;   ///< the flange's x and z axis there
  Vector3 flange_z;
  std::optional<double>
      wrist_reach_mm;    ///< as its maker says, horizontally from axis 1 to the wrist centre
  bool follows = false;  ///< joint 3 is commanded against level, not against the lower arm
};

const Vector3 kX = Vector3::UnitX();
const Vector3 kY = Vector3::UnitY();
const Vector3 kZ = Vector3::UnitZ();

/// An elbow arm with forearm level and looking along x: heights and lengths as drawings give them;
/// `senses` of joints 1 to 6 against the right-hand rule about z, y, y, x, y, x.
std::vector<Axis> elbow(double height, double shoulder, double lower, double elbow_up,
                        double forearm, const std::array<double, 6>& senses) {
  const double level = height + lower + elbow_up;
  const Vector3 wrist(shoulder + forearm, 0, level);
  return {{senses[0] * kZ, Vector3::Zero()},
          {senses[1] * kY, {shoulder, 0, height}},
          {senses[2] * kY, {shoulder, 0, height + lower}},
          {senses[3] * kX, wrist},
          {senses[4] * kY, wrist},
          {senses[5] * kX, wrist}};
}

std::vector<Drawing> drawings() {
  const std::array<double, 6> right{1, 1, 1, 1, 1, 1};
  const std::array<double, 6> three_to_six{1, 1, -1, -1, -1, -1};
  std::vector<Drawing> all = {
      {"abb_irb6640-205-275.yaml",
       elbow(780, 320, 1280, 200, 1142, right),
       {1662, 0, 2260},
       -kZ,
       kX,
       2750},
      {"abb_irb120-3-06.yaml", elbow(290, 0, 270, 70, 302, right), {374, 0, 630}, -kZ, kX, 580},
      {"abb_irb1200-5-09.yaml",
       elbow(399.1, 0, 448, 42, 451, right),
       {533, 0, 889.1},
       -kZ,
       kX,
       901},
      {"fanuc_m-20ia.yaml",
       elbow(0, 150, 790, 250, 835, three_to_six),
       {1085, 0, 1040},
       kZ,
       kX,
       1811,
       true},
      {"yaskawa_gp25.yaml",
       elbow(0, 150, 760, 200, 795, three_to_six),
       {1045, 0, 960},
       kZ,
       kX,
       1730},
      // The arm lies stretched out along x.
      {"kuka_kr210-r2700-extra.yaml",
       {{-kZ},
        {kY, {350, 0, 675}},
        {kY, {1500, 0, 675}},
        {-kX, {2700, 0, 634}},
        {kY, {2700, 0, 634}},
        {-kX, {2700, 0, 634}}},
       {2915, 0, 634},
       -kZ,
       kX,
       2696},
      // The arm stands upright.
      {"staubli_tx2-90l.yaml",
       {{kZ},
        {kY, {50, 0, 0}},
        {kY, {50, 0, 500}},
        {kZ, {50, 50, 0}},
        {kY, {50, 0, 1050}},
        {kZ, {50, 50, 0}}},
       {50, 50, 1150},
       kX,
       kZ,
       1100},
      {"kuka_lbr-iiwa-7-r800.yaml",
       {{kZ}, {kY, {0, 0, 340}}, {kZ}, {-kY, {0, 0, 740}}, {kZ}, {kY, {0, 0, 1140}}, {kZ}},
       {0, 0, 1266},
       kX,
       kZ,
       800},
      // The arm lies stretched out along -x. The makers' reach is rounded and says no point, so it
      // is not compared.
      {"universal-robots_ur5.yaml",
       {{kZ},
        {-kY, {0, 0, 89.159}},
        {-kY, {-425, 0, 89.159}},
        {-kY, {-817.25, 0, 89.159}},
        {-kZ, {-817.25, -109.15, 0}},
        {-kY, {-817.25, 0, -5.491}}},
       {-817.25, -191.45, -5.491},
       kX,
       -kY,
       {}},
      {"universal-robots_ur10.yaml",
       {{kZ},
        {-kY, {0, 0, 127.3}},
        {-kY, {-612, 0, 127.3}},
        {-kY, {-1184.3, 0, 127.3}},
        {-kZ, {-1184.3, -163.941, 0}},
        {-kY, {-1184.3, 0, 11.6}}},
       {-1184.3, -256.141, 11.6},
       kX,
       -kY,
       {}}};
  // On the rail: B has z along the travel and y up.
  Drawing rail = all.front();
  rail.file = "abb_irb6640-205-275-on-rail.yaml";
  const Matrix3 R_rail = Eigen::AngleAxisd(-kPi / 2, kX).toRotationMatrix();
  for (Axis& axis : rail.axes) axis = {R_rail * axis.direction, R_rail * axis.point_mm};
  rail.axes.insert(rail.axes.begin(), {kZ, Vector3::Zero(), JointType::kPrismatic});
  rail.flange_mm = R_rail * rail.flange_mm;
  rail.flange_x = R_rail * rail.flange_x;
  rail.flange_z = R_rail * rail.flange_z;
  rail.wrist_reach_mm.reset();
  all.push_back(rail);
  return all;
}

Chain shipped_models(const std::string& file) {
  const Result<Chain> chain = read_robot(TRAMMEL_SOURCE_DIR "/models/" + file);
  EXPECT_TRUE(chain) << (chain ? "" : chain.error().message);
  return *chain;
}

/// The flange where the drawing's axes carry it, one after the other.
Pose carried(const Drawing& drawing, const JointVector& q) {
  Pose X = Pose::Identity();
  for (std::size_t j = 0; j < drawing.axes.size(); ++j) {
    const Axis& axis = drawing.axes[j];
    const double value = q(static_cast<Eigen::Index>(j)) + (drawing.follows && j == 2 ? q(1) : 0);
    if (axis.type == JointType::kPrismatic) {
      X = X * make_pose(Matrix3::Identity(), axis.direction * value);
      continue;
    }
    const Matrix3 R = Eigen::AngleAxisd(value, axis.direction).toRotationMatrix();
    const Vector3 p = axis.point_mm * from_mm(1);
    X = X * make_pose(R, p - R * p);
  }
  Matrix3 R;
  R << drawing.flange_x, drawing.flange_z.cross(drawing.flange_x), drawing.flange_z;
  return X * make_pose(R, drawing.flange_mm * from_mm(1));
}

JointVector within_limits(const Chain& chain, std::mt19937_64& random) {
  JointVector q(chain.size());
  for (int j = 0; j < chain.size(); ++j) {
    q(j) = std::uniform_real_distribution(chain.joint(j).lower, chain.joint(j).upper)(random);
  }
  return q;
}

TEST(ShippedRobots, EachHasItsDrawing) {
  std::set<std::string> drawn;
  for (const Drawing& drawing : drawings()) drawn.insert(drawing.file);
  for (const auto& entry : std::filesystem::directory_iterator(TRAMMEL_SOURCE_DIR "/models")) {
    if (entry.path().extension() == ".yaml") {
      EXPECT_TRUE(drawn.contains(entry.path().filename().string())) << entry.path();
    }
  }
}

TEST(ShippedRobots, MoveAsTheAxesOfTheirDrawingsCarryThem) {
  std::mt19937_64 random(1);
  for (const Drawing& drawing : drawings()) {
    const Chain chain = shipped_models(drawing.file);
    ASSERT_EQ(chain.size(), static_cast<int>(drawing.axes.size())) << drawing.file;
    for (int sample = 0; sample < 20; ++sample) {
      const JointVector q =
          sample == 0 ? JointVector::Zero(chain.size()) : within_limits(chain, random);
      const Vector6 difference = pose_difference(chain.flange_pose(q), carried(drawing, q));
      EXPECT_LT(difference.norm(), 1e-9) << drawing.file << " at " << q.transpose();
    }
  }
}

/// Horizontal distance of the wrist centre from axis 1 with the wrist straight.
double wrist_radius(const Chain& chain, const JointVector& q) {
  const Pose X = chain.flange_pose(q);
  const int last = chain.size() - 1;
  return (X.translation() - chain.joint(last).link.d * X.linear().col(2)).head<2>().norm();
}

/// The largest radius over the shoulder's and the elbow's joint, by a coarse grid and then ever
/// smaller steps.
double farthest(const Chain& chain, int shoulder, int elbow) {
  const auto keep = [&](int j, double value) {
    return std::clamp(value, chain.joint(j).lower, chain.joint(j).upper);
  };
  JointVector q = JointVector::Zero(chain.size());
  JointVector best = q;
  double radius = 0;
  for (int i = 0; i <= 60; ++i) {
    for (int k = 0; k <= 60; ++k) {
      const auto at = [&](int j, int step) {
        return chain.joint(j).lower + (chain.joint(j).upper - chain.joint(j).lower) * step / 60.0;
      };
      q(shoulder) = at(shoulder, i);
      q(elbow) = at(elbow, k);
      if (wrist_radius(chain, q) > radius) {
        radius = wrist_radius(chain, q);
        best = q;
      }
    }
  }
  for (double step = 0.1; step > 1e-6; step *= 0.7) {
    for (const double first : {-step, 0.0, step}) {
      for (const double second : {-step, 0.0, step}) {
        q = best;
        q(shoulder) = keep(shoulder, best(shoulder) + first);
        q(elbow) = keep(elbow, best(elbow) + second);
        if (wrist_radius(chain, q) > radius) {
          radius = wrist_radius(chain, q);
          best = q;
        }
      }
    }
  }
  return radius;
}

TEST(ShippedRobots, ReachAsFarAsTheirMakersSay) {
  for (const Drawing& drawing : drawings()) {
    if (!drawing.wrist_reach_mm) continue;
    const Chain chain = shipped_models(drawing.file);
    const int elbow = chain.size() == 7 ? 3 : 2;  // the seven-axis arm has its elbow at joint 4
    EXPECT_NEAR(to_mm(farthest(chain, 1, elbow)), *drawing.wrist_reach_mm, 5) << drawing.file;
  }
}

TEST(ShippedRobots, HaveAHayatiRowExactlyWhereTheNextAxisIsParallel) {
  for (const Drawing& drawing : drawings()) {
    const Chain chain = shipped_models(drawing.file);
    for (int j = 0; j + 1 < chain.size(); ++j) {
      const std::size_t at = static_cast<std::size_t>(j);
      const bool revolute = drawing.axes[at].type == JointType::kRevolute;
      const double sine = drawing.axes[at].direction.cross(drawing.axes[at + 1].direction).norm();
      EXPECT_EQ(chain.joint(j).hayati, revolute && sine < 1e-9)
          << drawing.file << " link " << j + 1;
    }
  }
}

TEST(ShippedRobots, ElbowArmsComeBackFromTheirPosesByTheClosedForm) {
  std::mt19937_64 random(2);
  int arms = 0;
  for (const Drawing& drawing : drawings()) {
    const Chain chain = shipped_models(drawing.file);
    if (!has_spherical_wrist(chain)) continue;
    ++arms;
    for (int sample = 0; sample < 20; ++sample) {
      const JointVector q = within_limits(chain, random);
      const Result<int> conf = branch_of(chain, q);
      ASSERT_TRUE(conf) << drawing.file;
      const Result<InverseResult> back = inverse_kinematics(chain, chain.flange_pose(q), *conf, q);
      ASSERT_TRUE(back) << drawing.file;
      EXPECT_LT((back->q - q).norm(), 1e-6)
          << drawing.file << " at " << q.transpose() << " conf " << *conf;
    }
  }
  EXPECT_EQ(arms, 7);
}

}  // namespace
}  // namespace trammel
