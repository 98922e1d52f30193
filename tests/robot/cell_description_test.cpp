// The differences that tell two descriptions of a cell apart.
#include "server/robot/cell_description.h"

#include <gtest/gtest.h>

#include "tests/support/demand.h"
#include "tests/support/small_cell.h"

namespace trammel {
namespace {

CellDescription description(const std::string& cell_yaml,
                            const std::string& robot_yaml = test::small_robot_yaml()) {
  return description_of(test::demand(parse_cell(cell_yaml, robot_yaml, "cell.yaml")));
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  const std::size_t at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return at == std::string::npos ? text : text.replace(at, what.size(), by);
}

TEST(CellDescription, WhatIsSpelledOtherwiseOrForPeopleIsTheSame) {
  const std::string text = test::small_cell_yaml("cell-7");
  const CellDescription one = description(text);
  EXPECT_EQ(description("# of hall 3\n" + text), one);
  EXPECT_EQ(description(replaced(text, "0.02", "2e-2")), one);
  EXPECT_EQ(description(replaced(text, "robot.yaml", "../robots/robot.yaml")), one);
  EXPECT_EQ(description(text + "operator: Anna\nserial_number: 6640-1\n"), one);
  EXPECT_EQ(description(replaced(text, "xyz_mm: [0, 0, 0], q_wxyz: [1, 0, 0, 0]",
                                 "q_wxyz: [1, 0, 0, 0], xyz_mm: [0, 0, 0]")),
            one);
  EXPECT_EQ(what_differs(one, one), "");
}

TEST(CellDescription, WhatDecidesNumbersIsNotAndItIsSaidInWhichFile) {
  const std::string text = test::small_cell_yaml("cell-7"), robot = test::small_robot_yaml();
  const CellDescription one = description(text);
  const std::string shifted = replaced(text, "58.553", "58.554"),
                    other_robot = replaced(robot, "a_mm: 320", "a_mm: 321");
  EXPECT_EQ(what_differs(one, description(shifted)), "cell file");
  EXPECT_EQ(what_differs(one, description(text, other_robot)), "robot file");
  EXPECT_EQ(what_differs(one, description(shifted, other_robot)), "cell file and robot file");
  EXPECT_NE(description(text + "step_limit_mm: 1\n"), one);
}

}  // namespace
}  // namespace trammel
