#include "server/trainer/dark_cells.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "server/store/store.h"
#include "tests/support/demand.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

using test::demand;
using State = CellAtStart::State;

class DarkCellsTest : public testing::Test {
 protected:
  /// Puts a model of `poses` in force.
  void serve(const std::string& cell, int poses) {
    auto store = demand(Store::open(path_));
    const std::string csv = fmt::format("q1_deg\n{}\n", poses);
    StoredJob job;
    job.cell = cell;
    job.batch_ids = {fmt::format("b{}", poses)};
    const auto added = demand(store->add_batch({cell, job.batch_ids[0], csv, csv, csv, 1, 1}, job));
    ASSERT_TRUE(store->add_model(cell, test::nominal_model(cells_.at(cell), poses), added.id, true,
                                 "made"));
  }
  CellAtStart at_start(const std::string& cell) {
    for (CellAtStart& one : demand(cells_at_start(path_, cells_)))
      if (one.cell == cell) return std::move(one);
    return {};
  }
  /// Every `old` in the store's file becomes `with`, which is as long.
  void damage(const std::string& old, const std::string& with) {
    std::string bytes = test::read_file(path_);
    for (std::size_t at = bytes.find(old); at != std::string::npos; at = bytes.find(old, at))
      bytes.replace(at, old.size(), with);
    std::ofstream(path_, std::ios::binary) << bytes;
  }

  test::TemporaryFolder folder_;
  const std::string path_ = folder_.file("trammel.db");
  ServedCells cells_ = {{"cell-7", test::small_cell("cell-7")},
                        {"cell-8", test::small_cell("cell-8")}};
};

TEST_F(DarkCellsTest, CellsWithAModelAreServedAndOthersHaveNoneYet) {
  EXPECT_EQ(at_start("cell-7").state, State::kUntrained) << "there is no store";
  serve("cell-7", 40);
  EXPECT_EQ(at_start("cell-7").state, State::kServed);
  EXPECT_EQ(at_start("cell-7").version, 1);
  EXPECT_EQ(at_start("cell-8").state, State::kUntrained);
}

TEST_F(DarkCellsTest, ACellWhoseModelIsOfAnotherToolWouldGoDarkAndTheReasonIsSaid) {
  serve("cell-7", 40);
  auto other = *cells_.at("cell-7");
  other.tools = {{"gripper", other.tools.begin()->second}};
  cells_["cell-7"] = std::make_shared<const Cell>(other);
  EXPECT_EQ(at_start("cell-7").state, State::kDark);
  EXPECT_NE(at_start("cell-7").why.find("spindle"), std::string::npos) << at_start("cell-7").why;
}

TEST_F(DarkCellsTest, AModelWhoseTextIsBadWouldBeServedFromItsCopyAndThatIsSaid) {
  serve("cell-7", 40);
  damage("\"training_poses\":40", "\"training_poses\":99");
  EXPECT_EQ(at_start("cell-7").state, State::kCopyServed);
  EXPECT_NE(at_start("cell-7").why.find("version 1 is served from its copy " + path_),
            std::string::npos)
      << at_start("cell-7").why;
}

TEST_F(DarkCellsTest, AModelThatThisProgramCannotReadLeavesItsCellDarkUnlessAnOlderOneIsThere) {
  serve("cell-7", 40);
  serve("cell-7", 41);
  std::filesystem::remove_all(path_ + ".models");
  damage("\"training_poses\":41", "\"training_poses\":99");
  EXPECT_EQ(at_start("cell-7").state, State::kOlderServed);
  EXPECT_NE(at_start("cell-7").why.find("version 2"), std::string::npos);
  damage("\"training_poses\":40", "\"training_poses\":99");
  EXPECT_EQ(at_start("cell-7").state, State::kDark);
}

TEST_F(DarkCellsTest, AServiceThatRunsOnTheStoreIsNotDisturbed) {
  serve("cell-7", 40);
  auto store = demand(Store::open(path_));
  EXPECT_EQ(at_start("cell-7").state, State::kServed);
  EXPECT_TRUE(store->set_quarantine("cell-7", "b40", "odd"));
}

TEST_F(DarkCellsTest, WhatIsNoStoreIsRefused) {
  std::ofstream(path_) << std::string(5000, 'x');
  EXPECT_FALSE(cells_at_start(path_, cells_));
}

}  // namespace
}  // namespace trammel
