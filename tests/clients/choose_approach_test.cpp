#include "clients/cli/work/choose_approach.h"

#include <gtest/gtest.h>

#include <cmath>

#include "clients/cli/files/target_file.h"
#include "server/base/units.h"
#include "server/measurement/files/csv_table.h"
#include "tests/support/small_cell.h"

namespace trammel::cli {
namespace {

const Pose kTool = Pose(Eigen::Translation3d(0.1, 0, 0.2));

const std::string kTable =
    "name,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n"
    "near,-20,10,15,8,50,12\n"
    "far,25,12,10,-9,48,14\n";

/// Knows a target to 0.2 mm where its side of approach is not said, the first to 0.01 mm always.
Result<std::vector<exchange::CorrectedTarget>> with_play(
    const std::vector<exchange::AskedTarget>& targets) {
  std::vector<exchange::CorrectedTarget> items;
  for (const exchange::AskedTarget& target : targets) {
    exchange::CorrectedTarget item;
    item.status = "ok";
    for (const double q : target.seed_rad) item.joints_deg.push_back(to_deg(q));
    const bool known = !target.approach.directions.empty() || target.seed_rad[0] < 0;
    item.error_after_mm = known ? 0.02 : 0.35;
    item.sigma_mm = known ? 0.01 : 0.2;
    items.push_back(item);
  }
  return items;
}

TEST(TablesOfTargets, APointOfALeadInIsARowAboveTheTargetThatNeedsIt) {
  const auto cell = test::small_cell("cell-3");
  const TargetFile file = parse_targets_csv(kTable, "t.csv").value();
  Corrections corrections{"0123456789ab", file.joint_types, {}};
  std::vector<exchange::AskedTarget> targets;
  for (const TargetRow& row : file.rows) targets.push_back(row.target);
  corrections.items = with_play(targets).value();
  const cam::LeadInOptions options{
      {{0, 2e-3, 1}, {1, 2e-3, 1}},
      [](const exchange::CorrectedTarget& item) { return item.error_after_mm < 0.1; }};
  ASSERT_TRUE(lead_in_where_needed(with_play, cell->robot, kTool, options, targets, corrections));
  ASSERT_GT(corrections.lead_in_points(), 0u);
  EXPECT_TRUE(corrections.lead_ins[0].empty()) << "it is near enough";
  EXPECT_EQ(corrections.items[1].error_after_mm, 0.02);

  const CsvTable table = CsvTable::parse(corrections_csv(file, corrections), "out.csv").value();
  ASSERT_EQ(table.size(), 2 + corrections.lead_in_points());
  const std::size_t status = table.find("status").value(), name = table.find("name").value();
  EXPECT_EQ(table.field(0, status), "ok");
  for (std::size_t row = 1; row + 1 < table.size(); ++row) {
    EXPECT_EQ(table.field(row, status), "lead_in");
    EXPECT_EQ(table.field(row, name), "far");
    EXPECT_NE(table.field(row, table.find("q1_deg").value()), "");
  }
  EXPECT_EQ(table.field(table.size() - 1, status), "ok");
  EXPECT_EQ(corrections_json(file, corrections)["lead_ins"], corrections.lead_in_points());
}

/// Reaches a target where the tool is turned by 40 deg at least.
Result<std::vector<exchange::CorrectedTarget>> where_turned(
    const std::vector<exchange::AskedTarget>& targets) {
  std::vector<exchange::CorrectedTarget> items;
  for (const exchange::AskedTarget& target : targets) {
    exchange::CorrectedTarget item;
    item.status = std::abs(target.pose.q_wxyz[3]) < std::sin(from_deg(20)) ? "unreachable" : "ok";
    for (const double q : target.seed_rad) item.joints_deg.push_back(to_deg(q));
    item.sigma_mm = 0.1;
    items.push_back(item);
  }
  return items;
}

TEST(TablesOfTargets, ATargetThatIsLeftIsTurnedToWhereItIsReached) {
  const auto cell = test::small_cell("cell-3");
  const std::string table =
      "x_mm,y_mm,z_mm,qw,qx,qy,qz,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n"
      "1500,0,1000,1,0,0,0,-20,10,15,8,50,12\n";
  const TargetFile file = parse_targets_csv(table, "t.csv").value();
  std::vector<exchange::AskedTarget> targets = {file.rows[0].target};
  Corrections corrections{"0123456789ab", file.joint_types, where_turned(targets).value()};
  ASSERT_EQ(corrections.items[0].status, "unreachable");
  ASSERT_TRUE(turn_freely(where_turned, cell->robot, targets, corrections));
  EXPECT_EQ(corrections.items[0].status, "ok");
  EXPECT_EQ(std::abs(corrections.turned_deg[0]), 45);
}

}  // namespace
}  // namespace trammel::cli
