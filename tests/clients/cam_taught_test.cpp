#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

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

/// What is said of a UR script with these lines; empty: nothing of taught ones.
std::string said_of_script(const std::string& lines) {
  const test::Corrected made = test::corrected_by_shift(
      Dialect::kUrScript,
      {{"p.script",
        "def p():\n  set_tcp(p[0.1, 0, 0.15, 0, -0.785398163, 0])\n" + lines + "end\n"}});
  EXPECT_EQ(made.refusal, "");
  for (const std::string& note : made.program.notes)
    if (note.find("look taught") != std::string::npos) return note;
  return "";
}

/// Joints of the pendant, as doubles; `round_deg`: the same to this, as somebody who wrote them.
std::string moved_to_joints(double round_deg) {
  std::string lines;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> angle(-.3, .3);
  for (int k = 0; k < 6; ++k) {
    std::vector<std::string> numbers;
    for (const double at : {0.1, -.35, .35, .1, .5, .1}) {
      const double deg = to_deg(at + angle(random));
      numbers.push_back(fmt::format(
          "{:.16f}", from_deg(round_deg > 0 ? round_deg * std::round(deg / round_deg) : deg)));
    }
    lines += fmt::format("  movej([{}])\n", fmt::join(numbers, ", "));
  }
  return lines;
}

TEST(TaughtTargets, OfAUrTheJointsOfThePendantAreToldByTheirDigits) {
  EXPECT_NE(said_of_script(moved_to_joints(0)).find("6 of 6 joint targets look taught"),
            std::string::npos)
      << said_of_script(moved_to_joints(0));
  EXPECT_EQ(said_of_script(moved_to_joints(0.5)), "") << "somebody wrote these";
}

TEST(TaughtTargets, OfAUrAWayJoggedAlongAnAxisIsTaughtThoughItsNumbersNearlyStandTwice) {
  // The pendant's digits: along z the others stay within picometres, and the turn stays.
  const auto script = [](bool written) {
    std::string lines = "  movej([0, -0.349, 0.349, 0, 0.524, 0])\n";
    for (int k = 0; k < 6; ++k)
      lines += fmt::format(
          "  movel(p[1.72013968656{},-0.12543562006{},0.{}3013002542,0.001221359682,1.566276528482,"
          "0.038891915637], a=1.2, v=0.25)\n",
          written ? 4 : k, written ? 4 : 7 - k, 80 + 3 * k);
    return lines;
  };
  EXPECT_NE(said_of_script(script(false)).find("look taught"), std::string::npos);
  EXPECT_EQ(said_of_script(script(true)), "") << "the same numbers: a post wrote them";
}

}  // namespace
}  // namespace trammel::cam
