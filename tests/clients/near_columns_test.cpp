#include "clients/cli/files/near_columns.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace trammel::cli
