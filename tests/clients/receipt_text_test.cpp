#include "clients/programs/receipt_text.h"

#include <gtest/gtest.h>

namespace trammel::cam {
namespace {

cam::ReceiptRow left(const std::string& name, int line, const std::string& why,
                     std::vector<int> used_at) {
  cam::ReceiptRow row;
  row.name = name;
  row.file = "weld.mod";
  row.line = line;
  row.motion = "MoveL";
  row.status = "refused";
  row.message = why;
  row.used_at = std::move(used_at);
  return row;
}

cam::CorrectedProgram program(int without_tool, int sensed) {
  cam::CorrectedProgram made;
  for (int k = 0; k < sensed; ++k)
    made.rows.push_back(left("s" + std::to_string(k), 10 + k, "a sensor ends it", {10 + k}));
  for (int k = 0; k < without_tool; ++k)
    made.rows.push_back(left("p" + std::to_string(k), 50 + k, "it has no tool", {50 + k, 150 + k}));
  made.moves = static_cast<std::size_t>(sensed + 2 * without_tool);
  return made;
}

TEST(LeftTargets, AFewAreToldOneByOne) {
  EXPECT_EQ(left_alone_text(program(1, 1)),
            "2 of 2 targets are left as they were:\n"
            "  weld.mod line 10: s0: refused: a sensor ends it\n"
            "  weld.mod line 50: p0: refused: it has no tool\n");
}

TEST(LeftTargets, ManyAreToldByTheirReasonTheOneOfMostMotionsFirst) {
  EXPECT_EQ(left_alone_text(program(20, 30)),
            "50 of 50 targets are left as they were:\n"
            "  40 motions, p0 weld.mod line 50 and 19 more: refused: it has no tool\n"
            "  30 motions, s0 weld.mod line 10 and 29 more: refused: a sensor ends it\n"
            "no motion is corrected; one reason leaves 40 of 70 motions: "
            "refused: it has no tool\n");
}

TEST(LeftTargets, WhereSomethingIsCorrectedNoSingleReasonIsHeldUp) {
  cam::CorrectedProgram some = program(20, 30);
  some.moves_corrected = 3;
  EXPECT_EQ(left_alone_text(some).find("no motion is corrected"), std::string::npos);
}

TEST(Receipt, ANoteThatHoldsManyTimesStandsOnceWithItsNumber) {
  cam::CorrectedProgram made = program(1, 0);
  made.notes.assign(31, "a value is not read");
  made.notes.emplace_back("another one");
  const std::string said = receipt_summary(made);
  EXPECT_NE(said.find("note: a value is not read (31 times)\nnote: another one\n"),
            std::string::npos)
      << said;
}

}  // namespace
}  // namespace trammel::cam
