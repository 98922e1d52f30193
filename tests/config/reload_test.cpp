#include "server/config/reload.h"

#include <gtest/gtest.h>

#include "tests/support/small_cell.h"

namespace trammel {
namespace {

ServerConfig config() {
  ServerConfig config;
  config.cells = {{"cell-7", test::small_cell("cell-7")}};
  config.dds.server_id = "a";
  return config;
}

TEST(Reload, TakesOnLimitsAndTheLogAndNamesWhatHasChanged) {
  ServerConfig file = config();
  file.log = {"debug", "", "json"};
  file.dds.client_requests = 3;
  file.trainer.queue_capacity = 5;
  file.trainer.keep.models = 7;
  const ReloadPlan plan = plan_reload(config(), file);
  EXPECT_EQ(plan.config.log.level, "debug");
  EXPECT_EQ(plan.config.log.format, "json");
  EXPECT_EQ(plan.config.dds.client_requests, 3);
  EXPECT_EQ(plan.config.trainer.queue_capacity, 5);
  EXPECT_EQ(plan.config.trainer.keep.models, 7);
  EXPECT_EQ(plan.now,
            (std::vector<std::string>{"log: level", "log: format", "dds: client_requests",
                                      "trainer: queue_capacity", "trainer: keep_models"}));
  EXPECT_TRUE(plan.later.empty());
}

TEST(Reload, LeavesAndNamesWhatChangesWithTheNextStartOnly) {
  ServerConfig file = config();
  file.cells.clear();
  file.dds.compute_workers = 9;
  file.trainer.max_poses = 11;
  file.log.file = "elsewhere.log";
  const ReloadPlan plan = plan_reload(config(), file);
  EXPECT_TRUE(plan.now.empty());
  EXPECT_EQ(plan.config.dds.compute_workers, config().dds.compute_workers);
  EXPECT_TRUE(plan.config.cells.contains("cell-7"));
  EXPECT_EQ(plan.later, (std::vector<std::string>{"dds: compute_workers", "trainer: max_poses",
                                                  "log: file", "cells: cell-7 (left out)"}));
}

TEST(Reload, TakesOnCellsThatAreAddedAndKeepsTheOthersAsTheyAre) {
  ServerConfig file = config();
  Cell changed = *file.cells.at("cell-7");
  changed.robot_yaml += "# another robot\n";
  file.cells["cell-7"] = std::make_shared<const Cell>(changed);
  file.cells["cell-8"] = test::small_cell("cell-8");
  const ServerConfig present = config();
  const ReloadPlan plan = plan_reload(present, file);
  EXPECT_EQ(plan.now, (std::vector<std::string>{"cells: cell-8"}));
  EXPECT_EQ(plan.later, (std::vector<std::string>{"cells: cell-7 (its file)"}));
  EXPECT_EQ(plan.config.cells.at("cell-7"), present.cells.at("cell-7"));
  EXPECT_EQ(plan.config.cells.at("cell-8"), file.cells.at("cell-8"));
}

TEST(Reload, CellsForWhichTheWireHasNoRoomComeWithTheNextStart) {
  const auto cell = test::small_cell("cell-7");
  ServerConfig present = config(), file = config();
  for (int i = 0; i < 1023; ++i) present.cells[fmt::format("old-{}", i)] = cell;
  file.cells = present.cells;
  file.cells.erase("old-0");
  file.cells["new"] = cell;
  const ReloadPlan plan = plan_reload(present, file);
  EXPECT_TRUE(plan.now.empty());
  EXPECT_EQ(plan.later, (std::vector<std::string>{"cells: new", "cells: old-0 (left out)"}));
  EXPECT_EQ(plan.config.cells.size(), 1024u);
}

TEST(Reload, WhereItIsReachedAndWhereItStoresChangesWithTheNextStartAndIsNamed) {
  ServerConfig file = config();
  file.store = "other.db";
  file.dds.address = "127.0.0.2";
  file.dds.port = 20000;
  file.dds.domain = 7;
  file.http.port = 20001;
  const ReloadPlan plan = plan_reload(config(), file);
  EXPECT_TRUE(plan.now.empty());
  EXPECT_EQ(plan.later, (std::vector<std::string>{"store", "dds: address", "dds: port",
                                                  "dds: domain", "http: port"}));
  EXPECT_EQ(plan.config.store, config().store);
  EXPECT_EQ(plan.config.dds.port, config().dds.port);
  EXPECT_EQ(plan.config.http.port, config().http.port);
}

}  // namespace
}  // namespace trammel
