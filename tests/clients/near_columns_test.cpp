#include "clients/cli/files/near_columns.h"

#include <gtest/gtest.h>

#include "server/measurement/files/batch_file.h"

namespace trammel::cli {
namespace {

using Words = std::vector<std::string>;

std::size_t near(const Words& columns, TableKind kind = TableKind::kBatch) {
  return near_columns(columns, kind, "b.csv").size();
}

TEST(NearColumns, AreToldWithTheOneThatWasMeant) {
  EXPECT_EQ(
      near_columns({"q1_deg", "x_mm", "temprature_c"}, TableKind::kBatch, "b.csv"),
      Words(
          {"b.csv: column temprature_c is not known and is left aside; temperature_c was meant?"}));
  EXPECT_EQ(near({"pose_ids"}), 1u);
  EXPECT_EQ(near({"Pose_Ids"}), 1u);
  EXPECT_EQ(near({"tiem_s"}), 1u);
  EXPECT_EQ(near({"sesion_id"}), 1u);
}

TEST(NearColumns, ThatAUserHasForHimselfAreNotTold) {
  EXPECT_EQ(near({"q1_deg", "x_mm", "POSE_ID", "Temperature_C", "set", "note"}), 0u);
  EXPECT_EQ(near({"pose_id", "pose_id2"}), 0u) << "the known one is there";
  EXPECT_EQ(near({"seq", "hole_id", "node_id", "probe_id", "pass_id", "row", "comment"}), 0u);
  EXPECT_EQ(near({"pose_ids", "tool_idx"}, TableKind::kTargets), 0u) << "targets have none";
  EXPECT_EQ(near({"pose_ids"}, TableKind::kJoints), 1u);
}

TEST(NearColumns, AndAllOtherColumnsOfNumbersAreToldOnceEach) {
  const std::string text =
      "q1_deg,x_mm,y_mm,z_mm,temprature_c,roll,pitch,yaw,note\n10,1,2,3,20.5,1,2,3,a\n"
      "20,4,5,6,21.5,4,5,6,b\n";
  const auto batch = parse_batch(text, "b.csv");
  ASSERT_TRUE(batch);
  testing::internal::CaptureStderr();
  tell_columns_left_aside(*batch, text, "b.csv");
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_NE(said.find("b.csv: columns roll, pitch, yaw hold numbers"), std::string::npos) << said;
  EXPECT_EQ(said.find("temprature_c"), said.rfind("temprature_c")) << said;
  EXPECT_EQ(said.find("note,"), std::string::npos) << said;
}

}  // namespace
}  // namespace trammel::cli
