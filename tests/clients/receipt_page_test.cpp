#include "clients/cli/text/receipt_page.h"

#include <gtest/gtest.h>

#include "tests/support/page_text.h"

namespace trammel::cli {
namespace {

TEST(ReceiptPage, SaysOfEachTargetHowFarItWasMovedAlongTheAxes) {
  cam::CorrectedProgram program;
  cam::ReceiptRow corrected;
  corrected.name = "p1";
  corrected.file = "drill.mod";
  corrected.status = "ok";
  corrected.after = {1, 2, 3};
  corrected.correction_B = {1.25e-3, -0.5e-3, 2e-6};
  cam::ReceiptRow left = corrected;
  left.name = "p2";
  left.status = "unreachable";
  left.after.clear();
  program.rows = {corrected, left};
  const std::string page = receipt_page(program, 0);
  EXPECT_TRUE(test::has(page, "<td>ok</td><td>1.2500</td><td>-0.5000</td><td>0.0020</td>")) << page;
  EXPECT_TRUE(test::has(page, "<td>unreachable</td><td></td><td></td><td></td>"));
  for (const char* column : {"dx, mm", "dy, mm", "dz, mm"})
    EXPECT_TRUE(test::has(page, std::string("<th>") + column)) << column;
}

}  // namespace
}  // namespace trammel::cli
