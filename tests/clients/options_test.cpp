#include "clients/cli/terminal/options.h"

#include <gtest/gtest.h>

#include "clients/cli/command_line.h"

namespace trammel::cli {
namespace {

TEST(ModelReference, IsACellOrAVersionOfIt) {
  EXPECT_EQ(parse_model_reference("cell-7")->cell, "cell-7");
  EXPECT_EQ(parse_model_reference("cell-7")->version, 0);
  EXPECT_EQ(parse_model_reference("cell-7@12")->cell, "cell-7");
  EXPECT_EQ(parse_model_reference("cell-7@12")->version, 12);
}

TEST(ModelReference, RefusesWhatIsNoVersion) {
  for (const char* text : {"", "@3", "cell-7@", "cell-7@0", "cell-7@-1", "cell-7@x", "cell-7@3x",
                           "cell-7@99999999999"}) {
    const auto reference = parse_model_reference(text);
    ASSERT_FALSE(reference) << text;
    EXPECT_EQ(reference.error().code, ErrorCode::kUsage);
  }
}

TEST(CellId, IsTakenAsItIsOrFromTheCellFileThatHoldsIt) {
  EXPECT_EQ(cell_id("cell-7").value(), "cell-7");
  EXPECT_EQ(cell_id(TRAMMEL_SOURCE_DIR "/config/cell-7.yaml").value(), "cell-7");
  EXPECT_FALSE(cell_id("/nowhere/cell.yaml"));
}

TEST(ExitCode, TellsUsageDataAndServiceApart) {
  EXPECT_EQ(exit_code(ErrorCode::kUsage), 2);
  for (const ErrorCode code : {ErrorCode::kRefused, ErrorCode::kNotFound, ErrorCode::kConflict,
                               ErrorCode::kTooLarge, ErrorCode::kInternal}) {
    EXPECT_EQ(exit_code(code), 3);
  }
  EXPECT_EQ(exit_code(ErrorCode::kBusy), 4);
  EXPECT_EQ(exit_code(ErrorCode::kUnreachable), 4);
}

}  // namespace
}  // namespace trammel::cli
