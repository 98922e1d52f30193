#include "server/robot/cell_doubts.h"

#include <gtest/gtest.h>

namespace trammel {
namespace {

const std::string kRobot =
    "version: 1\nname: arm\njoints:\n"
    "  - {d_mm: 400, a_mm: 25, alpha_deg: -90}\n"
    "  - {a_mm: 455, alpha_deg: 0, hayati: true}\n"
    "  - {a_mm: 35, alpha_deg: -90}\n"
    "  - {d_mm: 420, alpha_deg: 90}\n";

Cell cell_of(const std::string& more, const std::string& robot = kRobot) {
  const Result<Cell> cell =
      parse_cell("version: 1\ncell: c\nrobot: r.yaml\n" + more, robot, "c.yaml");
  EXPECT_TRUE(cell) << sentence(cell.error());
  return *cell;
}

std::vector<std::string> codes(const Cell& cell) {
  std::vector<std::string> all;
  for (const CellDoubt& doubt : doubts_of(cell)) all.push_back(doubt.code);
  return all;
}

using Codes = std::vector<std::string>;

TEST(CellDoubts, AnOrdinaryCellHasNone) {
  EXPECT_EQ(codes(cell_of("base: {xyz_mm: [0, 0, 800]}\ngravity: [0, 0, -1]\ntools: {t: {xyz_mm: "
                          "[0, 0, 150], q_wxyz: [0.92387953, 0, -0.38268343, 0]}}\npayloads: {p: "
                          "{mass_kg: 100, cog_mm: [0, 0, 100]}}\n")),
            Codes{});
  EXPECT_EQ(
      codes(cell_of("base: {xyz_mm: [0, 0, 3000], q_wxyz: [0, 1, 0, 0]}\ntools: {t: null}\n")),
      Codes{})
      << "hangs from a ceiling";
  EXPECT_EQ(codes(cell_of("base: {xyz_mm: [0, 0, 900], q_wxyz: [0.70710678, 0, 0.70710678, "
                          "0]}\ntools: {t: null}\n")),
            Codes{})
      << "on a wall";
}

TEST(CellDoubts, NamesGravityUpsideDown) {
  EXPECT_EQ(codes(cell_of("base: {xyz_mm: [0, 0, 0]}\ngravity: [0, 0, 1]\ntools: {t: null}\n")),
            Codes{"gravity_up"});
  EXPECT_EQ(codes(cell_of("base: null\ngravity: [0, 0, 9.81]\ntools: {t: null}\n")),
            Codes{"gravity_up"});
}

TEST(CellDoubts, NamesAQuaternionInTheOtherOrder) {
  EXPECT_EQ(codes(cell_of("base: {xyz_mm: [0, 0, 0], q_wxyz: [0, 0, 0, 1]}\ntools: {t: null}\n")),
            Codes{"quaternion_order"});
  EXPECT_EQ(
      codes(cell_of(
          "base: {xyz_mm: [0, 0, 0], q_wxyz: [0, 0, 0.70710678, 0.70710678]}\ntools: {t: null}\n")),
      Codes{"quaternion_order"});
  EXPECT_EQ(codes(cell_of("base: null\ntools: {t: {xyz_mm: [0, 0, 100], q_wxyz: [0, 0, 0, 1]}}\n")),
            Codes{"quaternion_order"});
}

TEST(CellDoubts, NamesLengthsInMetres) {
  EXPECT_EQ(codes(cell_of("base: {xyz_mm: [0, 0, 0.8]}\ntools: {t: {xyz_mm: [0, 0, "
                          "0.15]}}\npayloads: {p: {mass_kg: 3, cog_mm: [0, 0, 0.1]}}\n")),
            (Codes{"lengths_in_metres", "lengths_in_metres", "lengths_in_metres"}));
  const Result<Chain> small = parse_robot(
      "version: 1\nname: arm\njoints:\n  - {d_mm: 0.4, alpha_deg: -90}\n  - {a_mm: 0.455, hayati: "
      "true}\n  - {d_mm: 0.42, alpha_deg: 90}\n",
      "r.yaml");
  ASSERT_FALSE(small);
  EXPECT_EQ(small.error().next, "in metres? write them in mm");
}

TEST(CellDoubts, NamesParallelAxesWithoutAHayatiRow) {
  std::string robot = kRobot;
  robot.erase(robot.find(", hayati: true"), std::string(", hayati: true").size());
  const std::vector<CellDoubt> doubts = doubts_of(cell_of("base: null\ntools: {t: null}\n", robot));
  ASSERT_EQ(doubts.size(), 1U);
  EXPECT_EQ(doubts[0].code, "hayati_missing");
  EXPECT_NE(doubts[0].text.find("joints 2 and 3"), std::string::npos);
}

TEST(CellDoubts, APayloadInGramsIsRefused) {
  EXPECT_FALSE(
      parse_cell("version: 1\ncell: c\nrobot: r.yaml\ntools: {t: null}\npayloads: {p: {mass_kg: "
                 "4500, cog_mm: [0, 0, 100]}}\n",
                 kRobot, "c.yaml"));
}

}  // namespace
}  // namespace trammel
