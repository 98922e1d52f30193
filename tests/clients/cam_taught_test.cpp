#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "clients/cam/taught.h"
#include "tests/support/shifting_model.h"

namespace trammel::cam {
namespace {

const std::string kTool =
    "MODULE M\n  PERS tooldata "
    "tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,0]];"
    "\n";

/// What is said of a module whose targets are these, with the digits of a controller; empty:
/// nothing of taught ones.
std::string said_of(const std::vector<Pose>& poses) {
  std::string data, moves;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    const Vector3 p = poses[k].translation() * to_mm(1);
    const Eigen::Quaterniond q(poses[k].linear());
    data += fmt::format(
        "  CONST robtarget "
        "p{}:=[[{:.2f},{:.2f},{:.2f}],[{:.6f},{:.6f},{:.6f},{:.6f}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,"
        "9E9]];\n",
        k, p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z());
    moves += fmt::format("    MoveL p{},v100,fine,tSpindle;\n", k);
  }
  const test::Corrected made = test::corrected_by_shift(
      Dialect::kRapid,
      {{"m.mod", kTool + data + "  PROC main()\n" + moves + "  ENDPROC\nENDMODULE\n"}});
  EXPECT_EQ(made.refusal, "");
  for (const std::string& note : made.program.notes) {
    if (note.find("look taught") != std::string::npos) return note;
  }
  return "";
}

/// Five places that somebody jogged to, the tool pointing down as well as the eye can see.
std::vector<Pose> jogged(unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> place(0, .2), tilt(0, 2e-3);
  std::vector<Pose> poses;
  for (int k = 0; k < 5; ++k)
    poses.push_back(make_pose(
        rotation_exp({0, kPi, 0}) * rotation_exp({tilt(random), tilt(random), tilt(random)}),
        {1.4 + place(random), place(random), .9 + place(random)}));
  return poses;
}

TEST(TaughtTargets, AreToldByNumbersOfWhichNoneIsRoundOrStandsTwice) {
  int told = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) told += said_of(jogged(seed)).empty() ? 0 : 1;
  EXPECT_GE(told, 15) << "some have a round coordinate by chance";
  const std::string note = said_of(jogged(1));
  EXPECT_NE(note.find("hold the robot's errors already"), std::string::npos) << note;
}

TEST(TaughtTargets, WhatADrawingOrAPostMadeIsNotTakenForThem) {
  std::vector<Pose> grid, panel, path;
  for (int k = 0; k < 8; ++k) {
    const double at = .05137 * k;
    const Matrix3 down = rotation_exp({0, kPi, 0});
    grid.push_back(make_pose(down, {1.40123 + at, .20317, .90551}));
    // The tool normal to a curved panel, in rows.
    panel.push_back(make_pose(down * rotation_exp({.1 * at, 0, 0}), {1.40123, at, .9 + at * at}));
    // Five axes, a point every few millimetres.
    path.push_back(make_pose(down * rotation_exp({.01123 * k, .02717 * k, 0}),
                             {1.4 + .00317 * k, .2 + .00213 * k * k / 8, .9 + .00171 * k}));
  }
  for (const auto& poses : {grid, panel, path}) EXPECT_EQ(said_of(poses), "");
  std::vector<Pose> few = jogged(1);
  few.resize(3);
  EXPECT_EQ(said_of(few), "") << "three poses show no habit";
}

}  // namespace
}  // namespace trammel::cam
